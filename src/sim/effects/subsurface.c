/* Light enters the surfaces and leaves them a little further on: a share of every cell's radiance spreads over its
 * neighbours. */
#include <stdio.h>
#include <stdlib.h>

#include "sim/effects/cell_blur.h"
#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(root, "subsurface");
  description->effects.subsurface = (clt_subsurface_description){
      .share = clt_read_number(section, "share", 0.0, 0.0, 1.0),
      .radius = clt_read_number(section, "radius", 1.0, 0.1, CLT_GAUSSIAN_SIGMA_MAX),
  };
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_subsurface_description *law = &scene->description.effects.subsurface;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           law->share > 0.0 ? "%.4g %% of the light leaves the surfaces about %.4g cells from where it came in"
                            : "light leaves the surfaces where it came in",
           100.0 * law->share, law->radius);
  return law->share > 0.0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  const clt_subsurface_description *law = &scene->description.effects.subsurface;
  return clt_cell_blur_prepare(scene, law->radius, law->share, stage, error);
}

const clt_effect clt_effect_subsurface = {.name = "subsurface",
                                          .read = read,
                                          .called_for = called_for,
                                          .prepare = prepare,
                                          .finish = free,
                                          .radiance = clt_cell_blur_apply};
