/* The camera's picture darkens towards its corners, by the cos^4 law of a lens: at distance r from the middle, in units
 * of the half diagonal, a pixel gets (1 + k r^2)^-2 of the light, where cos^2 = 1 / (1 + k r^2). */
#include <stdio.h>

#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section camera = clt_section_group(root, "camera");
  description->effects.vignetting = clt_read_number(camera, "vignetting", 0.0, 0.0, 0.95);
}

static bool called_for(const clt_scene *scene, char *why) {
  double loss = scene->description.effects.vignetting;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           loss > 0.0 ? "the corners of the camera's picture lose %.4g %% of the light"
                      : "the camera's picture is as bright in its corners as in the middle",
           100.0 * loss);
  return loss > 0.0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)error;
  stage->state = &scene->description.effects.vignetting;
  return CLT_OK;
}

static void signal(const void *state, clt_signal *signal) {
  const double *loss = state;
  double width = signal->width, height = signal->height;
  double slope = (1.0 / sqrt(1.0 - *loss) - 1.0) / (width * width + height * height);
  for (int k = 0; k < signal->channels * signal->height; k++) {
    double y = 2.0 * (k % signal->height) + 1.0 - height;
    float *row = &signal->radiance[(size_t)k * (size_t)signal->width];
    for (int x = 0; x < signal->width; x++) {
      double across = 2.0 * x + 1.0 - width, squared = 1.0 + slope * (across * across + y * y);
      row[x] = (float)((double)row[x] / (squared * squared));
    }
  }
}

const clt_effect clt_effect_vignetting = {.name = "vignetting",
                                          .read = read,
                                          .called_for = called_for,
                                          .prepare = prepare,
                                          .signal = signal,
                                          .per_pixel = true};
