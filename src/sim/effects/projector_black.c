/* The light that leaks from a black panel. T is for drive above the leak, so that a fully driven panel gives T 1 + b0;
 * light = black + (1 - black) drive makes the leak black / (1 - black) of T 1. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  double black = scene->description.projector.black;
  if (black > 0.0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "a black panel leaks 1/%.0f of its full light", 1.0 / black);
  } else {
    snprintf(why, CLT_EFFECT_WHY_MAX, "the panel's black is perfect");
  }
  return black > 0.0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)stage;
  (void)error;
  double leak = scene->description.projector.black / (1.0 - scene->description.projector.black);
  for (size_t k = 0; k < scene->plan.values; k++) {
    scene->added[k] += leak * scene->flood[k];
  }
  return CLT_OK;
}

const clt_effect clt_effect_projector_black = {.name = "projector-black", .called_for = called_for, .prepare = prepare};
