/* The projector's lens is out of focus: every cell's light spreads over its neighbours by a Gaussian. */
#include <stdio.h>
#include <stdlib.h>

#include "sim/effects/cell_blur.h"
#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section projector = clt_section_group(root, "projector");
  description->effects.defocus = clt_read_number(projector, "defocus", 0.0, 0.0, CLT_GAUSSIAN_SIGMA_MAX);
}

static bool called_for(const clt_scene *scene, char *why) {
  double sigma = scene->description.effects.defocus;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           sigma > 0.0 ? "the projector's picture is blurred by %.4g cells" : "the projector's picture is sharp",
           sigma);
  return sigma > 0.0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  return clt_cell_blur_prepare(scene, scene->description.effects.defocus, 1.0, stage, error);
}

const clt_effect clt_effect_defocus = {.name = "defocus",
                                       .read = read,
                                       .called_for = called_for,
                                       .prepare = prepare,
                                       .finish = free,
                                       .drive = clt_cell_blur_apply};
