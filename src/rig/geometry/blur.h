/* What blurred stripes look like: the light of Gray code bits along a panel axis, lens and panel blur taken together as
 * one Gaussian. */
#ifndef CLT_RIG_GEOMETRY_BLUR_H
#define CLT_RIG_GEOMETRY_BLUR_H

#include "counterlight/status.h"

enum {
  CLT_BLUR_WIDTHS = 34,   /* standard deviations that are told apart */
  CLT_BLUR_BITS = 6,      /* bits with a table; stripes of higher ones are single edges */
  CLT_BLUR_STEPS_MAX = 64 /* table entries a panel pixel */
};

/* Tables of one width: profile[bit][k] is picture less inverse, -1..1, at panel coordinate (k + 1/2) / steps, periodic
 * over 2^(bit + 2) pixels. */
typedef struct clt_blur {
  double width;              /* standard deviation, panel pixels */
  int steps;                 /* entries a panel pixel, a power of 2: at least two a width, and four */
  double rms[CLT_BLUR_BITS]; /* of each profile */
  float peak[CLT_BLUR_BITS]; /* largest value */
  const float *profile[CLT_BLUR_BITS];
} clt_blur;

typedef struct clt_blurs {
  clt_blur blur[CLT_BLUR_WIDTHS]; /* ascending in width */
  float *memory;
} clt_blurs;

clt_status clt_blurs_init(clt_blurs *blurs, clt_error *error);
void clt_blurs_finish(clt_blurs *blurs); /* accepts a zeroed one */
/* The width whose profiles have these mean squares, mean_square[bit < bits] of differences over amplitudes, up to a
 * *gain: the share of the amplitude that fine stripes have, light from other surfaces that see wide ones being in it.
 */
const clt_blur *clt_blurs_fit(const clt_blurs *blurs, const double *mean_square, int bits, double *gain);
/* Picture less inverse at coordinate x of a single edge at `edge` from dark to lit. */
float clt_blur_edge(const clt_blur *blur, float x, float edge);

#endif
