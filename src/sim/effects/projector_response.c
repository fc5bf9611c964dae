/* How the panel turns code values into light. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  const clt_curve *response = &scene->description.projector.response;
  char name[64];
  clt_curve_format(response, name, sizeof name);
  snprintf(why, CLT_EFFECT_WHY_MAX,
           response->kind != CLT_CURVE_LINEAR ? "the panel turns its %d codes into light by its response, %s"
                                              : "each of the panel's %d codes is that share of the light: %s",
           1 << scene->description.projector.bits, name);
  return response->kind != CLT_CURVE_LINEAR;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)error;
  int codes = 1 << scene->description.projector.bits;
  for (int code = 0; code < codes; code++) {
    scene->drive_of_code[code] =
        (float)clt_curve_decode(&scene->description.projector.response, (double)code / (codes - 1));
  }
  stage->bytes = (size_t)codes * sizeof *scene->drive_of_code;
  return CLT_OK;
}

const clt_effect clt_effect_projector_response = {
    .name = "projector-response", .called_for = called_for, .prepare = prepare};
