#include "tradeoff/reproduce/view.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

const double clt_room_view_albedo[CLT_VIEW_CHANNELS][CLT_CUBE_SIDES] = {
    {0.55, 0.6, 0.55, 0.1, 0.55}, {0.55, 0.1, 0.55, 0.5, 0.55}, {0.55, 0.1, 0.55, 0.1, 0.55}};

/* The eye stands before the open front. */
static int seen_patch(const clt_cube *cube, int row, int column) {
  const clt_vector eye = {0.5, -1.15, 0.5};
  clt_vector direction = {((column + 0.5) / CLT_VIEW_PIXELS - 0.5) * 0.92, 1.0,
                          (0.5 - (row + 0.5) / CLT_VIEW_PIXELS) * 0.92};
  return clt_first_hit(cube->patches, (int)cube->cells, eye, direction, -1).surface;
}

clt_status clt_room_view_init(clt_room_view *view, const clt_cube *cube, clt_error *error) {
  view->cells = cube->cells;
  view->patch = clt_alloc((size_t)CLT_VIEW_PIXELS * CLT_VIEW_PIXELS, sizeof *view->patch);
  if (view->patch == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a view of %zu patches", cube->cells);
  }
#pragma omp parallel for schedule(static)
  for (int k = 0; k < CLT_VIEW_PIXELS * CLT_VIEW_PIXELS; k++) {
    view->patch[k] = seen_patch(cube, k / CLT_VIEW_PIXELS, k % CLT_VIEW_PIXELS);
  }
  return CLT_OK;
}

void clt_room_view_finish(clt_room_view *view) {
  free(view->patch);
  *view = (clt_room_view){0};
}

void clt_room_view_paint(const clt_room_view *view, const double *light, double offset, double gain, int column,
                         int line, clt_image *strip) {
  size_t width = (size_t)strip->width, picture = (size_t)strip->height * width;
  for (size_t k = 0; k < (size_t)CLT_VIEW_PIXELS * CLT_VIEW_PIXELS; k++) {
    size_t row = (size_t)line * CLT_VIEW_PIXELS + k / CLT_VIEW_PIXELS;
    size_t pixel = row * width + (size_t)column * CLT_VIEW_PIXELS + k % CLT_VIEW_PIXELS;
    for (size_t c = 0; c < CLT_VIEW_CHANNELS; c++) {
      int patch = view->patch[k];
      double value = patch >= 0 ? offset + gain * light[c * view->cells + (size_t)patch] : 0.0;
      strip->data[c * picture + pixel] = (float)fmin(fmax(value, 0.0), 1.0);
    }
  }
}
