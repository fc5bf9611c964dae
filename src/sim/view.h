/* The image of a camera with pixels of its own: what each pixel sees, of which cell. */
#ifndef CLT_SIM_VIEW_H
#define CLT_SIM_VIEW_H

#include "sim/effects/effect.h"
#include "sim/sightline.h"
#include "sim/weights.h"

/* A pixel's radiance is the sum over its rays' equal shares of
 *   a place that the projector lights:      y_i of the cell i that lights it;
 *   a front that it does not light there:   y_i - F_i x_i, the light without the projector's own, of the cell i of the
 *     same surface that lies nearest in the projector's picture: light that changes slowly along a surface;
 *   anything else:                          nothing.
 * A cell of whose light the camera sees nothing has no row of T that says how it looks; where a pixel sees a sliver of
 * it all the same, the nearest cell of the same surface stands for it. */
typedef struct clt_view {
  int width, height; /* pixels */
  int cells, channels;
  /* Row y * width + x: shares of radiance, which lie at element + channel * cells in the layers of an exposure: the
   * radiance y of the cells, channels * cells values, and then the same without the projector's own light. */
  clt_weights pixels;
  float *direct;                     /* channels * cells values: F of the drive above the panel's black */
  double leak;                       /* of the panel: drive that is there anyway */
  double share[CLT_SIGHTLINE_FATES]; /* of the image, by what is seen */
} clt_view;

enum { CLT_VIEW_LAYERS = 2 };

/* Traces every pixel of a camera with pixels of its own. view was zeroed by the caller and is finished by it in either
 * case. */
clt_status clt_view_init(clt_view *view, const clt_scene_description *description, clt_error *error);
void clt_view_finish(clt_view *view);
/* Memory that it holds. */
size_t clt_view_bytes(const clt_view *view);

/* Behind the radiance of the cells under a drive, in a layer of its own: the same without the projector's own light.
 * radiance: 2 * channels * cells values. */
void clt_view_add_indirect(const clt_view *view, const float *drive, float *radiance);

/* Rows first <= y < last of the image: signal->radiance from the layers of an exposure, as the cells' radiance alone
 * lies in it. The same for any number of threads. */
void clt_view_form(const clt_view *view, const float *layers, int first, int last, clt_signal *signal);

#endif
