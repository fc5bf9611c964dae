/* The light that is there anyway. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  double most = clt_ambient_most(&scene->description);
  snprintf(why, CLT_EFFECT_WHY_MAX,
           most > 0.0 ? "other light adds up to %.4g W/(m^2 sr) to every cell" : "no other light than the projector's",
           most);
  return most > 0.0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)stage;
  (void)error;
  size_t cells = (size_t)scene->description.width * (size_t)scene->description.height;
  for (size_t k = 0; k < scene->plan.values; k++) {
    scene->added[k] += scene->description.ambient[k / cells];
  }
  return CLT_OK;
}

const clt_effect clt_effect_ambient = {.name = "ambient", .called_for = called_for, .prepare = prepare};
