/* Blurring planes of values by a Gaussian, energy conserved: light that would leave at an edge is reflected there. */
#ifndef CLT_SIM_EFFECTS_GAUSSIAN_H
#define CLT_SIM_EFFECTS_GAUSSIAN_H

#define CLT_GAUSSIAN_SIGMA_MAX 8.0

typedef struct clt_gaussian {
  int reach; /* weights 0..reach count, the same to both sides */
  double weight[34];
} clt_gaussian;

/* The light of a point in the middle of a value that falls on the value k further on: the integral of the density over
 * it, cut off beyond 4 sigma. 0 < sigma <= CLT_GAUSSIAN_SIGMA_MAX, in values. */
void clt_gaussian_init(clt_gaussian *gaussian, double sigma);
/* Blurs `planes` planes of height x width values in place, across and down; scratch is as large as all. Sums over a
 * plane stay, and so do constant planes. The same for any number of threads. */
void clt_gaussian_blur(const clt_gaussian *gaussian, int planes, int height, int width, float *values, float *scratch);

#endif
