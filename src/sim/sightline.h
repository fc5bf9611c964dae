/* Where the rays of a camera with pixels of its own end, and where that lies in the projector's picture. */
#ifndef CLT_SIM_SIGHTLINE_H
#define CLT_SIM_SIGHTLINE_H

#include "sim/description.h"
#include "sim/visibility.h"

typedef enum clt_sightline_fate {
  CLT_SIGHTLINE_NOTHING,  /* meets no surface, or a back, which is black */
  CLT_SIGHTLINE_LIT,      /* a front that the projector lights there */
  CLT_SIGHTLINE_SHADOWED, /* a front inside the projector's picture, turned away from it or behind another surface */
  CLT_SIGHTLINE_OUTSIDE,  /* a front beyond the projector's picture */
  CLT_SIGHTLINE_FATES
} clt_sightline_fate;

typedef struct clt_sightline {
  clt_sightline_fate fate;
  int surface; /* whose front is met; -1: none */
  double x, y; /* of a front: its place in the projector's picture, in cells from the left and from the top; cell k
                  spans k <= x < k + 1. Far beyond it for one behind the projector. */
} clt_sightline;

/* The ray through a place in the camera's image, in pixels from its left and top: pixel k spans k <= column < k + 1. */
clt_sightline clt_sightline_trace(const clt_scene_description *description, const clt_visibility *visibility,
                                  double column, double row);

/* Where the middles of the camera's pixels look: x[row * width + column], y likewise, NaN where not lit. fate may be
 * NULL. */
clt_status clt_sightline_map(const clt_scene_description *description, float *x, float *y, float *fate,
                             clt_error *error);

#endif
