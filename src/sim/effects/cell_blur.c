#include "sim/effects/cell_blur.h"

#include <string.h>

#include "base/memory.h"
#include "sim/state.h"

typedef struct cell_blur {
  clt_gaussian gaussian;
  float share;
  int channels, height, width;
} cell_blur;

clt_status clt_cell_blur_prepare(clt_scene *scene, double sigma, double share, clt_stage *stage, clt_error *error) {
  cell_blur *blur = clt_alloc(1, sizeof *blur);
  stage->state = blur;
  if (blur == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
  }
  *blur = (cell_blur){.share = (float)share,
                      .channels = scene->description.channels,
                      .height = scene->description.height,
                      .width = scene->description.width};
  clt_gaussian_init(&blur->gaussian, sigma);
  stage->bytes = sizeof *blur;
  return CLT_OK;
}

void clt_cell_blur_apply(const void *state, float *values, float *scratch) {
  const cell_blur *blur = state;
  size_t count = (size_t)blur->channels * (size_t)blur->height * (size_t)blur->width;
  float *sharp = scratch + count;
  memcpy(sharp, values, count * sizeof *values);
  clt_gaussian_blur(&blur->gaussian, blur->channels, blur->height, blur->width, values, scratch);
  for (size_t k = 0; k < count; k++) {
    values[k] = blur->share * values[k] + (1.0f - blur->share) * sharp[k];
  }
}
