/* Sample values are whole numbers above a pedestal. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  snprintf(why, CLT_EFFECT_WHY_MAX, "the camera's samples count in %d steps from a pedestal of %d",
           1 << scene->description.camera.bits, scene->description.camera.black_level);
  return true;
}

static void samples(const void *state, clt_row *row) {
  const clt_camera_description *sensor = &((const clt_scene_description *)state)->camera;
  double full = (1 << sensor->bits) - 1;
  for (int k = 0; k < row->count; k++) {
    double value = rint(sensor->black_level + row->values[k] * (full - sensor->black_level));
    row->values[k] = fmin(fmax(value, 0.0), full);
  }
}

const clt_effect clt_effect_quantisation = {
    .name = "quantisation", .called_for = called_for, .prepare = clt_effect_lend_description, .samples = samples};
