/* Monotone fits. */
#ifndef CLT_RIG_PHOTOMETRY_MONOTONE_H
#define CLT_RIG_PHOTOMETRY_MONOTONE_H

/* Replaces y by the ascending sequence that is nearest to it in least squares with weights (pool adjacent violators,
 * Barlow et al. 1972). n <= CLT_MONOTONE_MAX. */
enum { CLT_MONOTONE_MAX = 256 };
void clt_monotone_fit(double *y, const double *weight, int n);

#endif
