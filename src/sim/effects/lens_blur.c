/* The camera's lens is out of focus: every pixel's light spreads over its neighbours by a Gaussian. */
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "sim/effects/gaussian.h"
#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section camera = clt_section_group(root, "camera");
  description->effects.lens_blur = clt_read_number(camera, "lens_blur", 0.0, 0.0, CLT_GAUSSIAN_SIGMA_MAX);
}

static bool called_for(const clt_scene *scene, char *why) {
  double sigma = scene->description.effects.lens_blur;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           sigma > 0.0 ? "the camera's picture is blurred by %.4g pixels" : "the camera's picture is sharp", sigma);
  return sigma > 0.0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  clt_gaussian *gaussian = clt_alloc(1, sizeof *gaussian);
  stage->state = gaussian;
  if (gaussian == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
  }
  clt_gaussian_init(gaussian, scene->description.effects.lens_blur);
  stage->bytes = sizeof *gaussian;
  return CLT_OK;
}

static void signal(const void *state, clt_signal *signal) {
  clt_gaussian_blur(state, signal->channels, signal->height, signal->width, signal->radiance, signal->scratch);
}

const clt_effect clt_effect_lens_blur = {.name = "lens-blur",
                                         .read = read,
                                         .called_for = called_for,
                                         .prepare = prepare,
                                         .finish = free,
                                         .signal = signal,
                                         .per_pixel = true};
