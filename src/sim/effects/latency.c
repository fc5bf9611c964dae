/* Light follows a refresh, and exposures follow a request, with a delay. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  double latency_s = scene->description.projector.latency_s;
  int delay = scene->description.camera.exposure_delay;
  double jitter_s = scene->description.projector.jitter_s;
  if (latency_s > 0.0 || jitter_s > 0.0 || delay > 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX,
             "light follows a refresh by %.4g +- %.4g ms; a new exposure time holds %d frame%s later", 1e3 * latency_s,
             1e3 * jitter_s, delay, delay == 1 ? "" : "s");
  } else {
    snprintf(why, CLT_EFFECT_WHY_MAX, "projector and camera answer at once");
  }
  return latency_s > 0.0 || jitter_s > 0.0 || delay > 0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)stage;
  (void)error;
  scene->latency_ns = llround(scene->description.projector.latency_s * 1e9);
  scene->jitter_ns = llround(scene->description.projector.jitter_s * 1e9);
  scene->exposure_delay = scene->description.camera.exposure_delay;
  return CLT_OK;
}

const clt_effect clt_effect_latency = {.name = "latency", .called_for = called_for, .prepare = prepare};
