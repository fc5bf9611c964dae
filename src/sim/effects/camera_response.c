/* How the camera encodes the light it collected. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  const clt_curve *response = &scene->description.camera.response;
  char name[64];
  clt_curve_format(response, name, sizeof name);
  snprintf(why, CLT_EFFECT_WHY_MAX,
           response->kind != CLT_CURVE_LINEAR ? "the camera encodes light by its response, %s"
                                              : "the camera's samples are proportional to light: %s",
           name);
  return response->kind != CLT_CURVE_LINEAR;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)error;
  stage->state = &scene->description.camera.response;
  return CLT_OK;
}

/* Odd below zero, where noise may carry the signal. */
static void samples(const void *state, clt_row *row) {
  for (int k = 0; k < row->count; k++) {
    row->values[k] = copysign(clt_curve_encode(state, fabs(row->values[k])), row->values[k]);
  }
}

const clt_effect clt_effect_camera_response = {
    .name = "camera-response", .called_for = called_for, .prepare = prepare, .samples = samples};
