/* A pixel holds so many electrons; from here on the signal is a fraction of them. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  snprintf(why, CLT_EFFECT_WHY_MAX, "a pixel holds at most %.6g electrons", scene->description.camera.full_well);
  return true;
}

static void samples(const void *state, clt_row *row) {
  double full_well = ((const clt_scene_description *)state)->camera.full_well;
  for (int k = 0; k < row->count; k++) {
    row->values[k] = fmin(row->values[k] / full_well, 1.0);
  }
}

const clt_effect clt_effect_saturation = {
    .name = "saturation", .called_for = called_for, .prepare = clt_effect_lend_description, .samples = samples};
