/* Surfaces that throw light towards the mirror direction: highlights of the projector, and images of other surfaces, as
 * the camera sees them. Light from surface to surface stays diffuse. Computed with the scene's light; here is told
 * where. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  const clt_scene_description *description = &scene->description;
  int surfaces = description->surface_count, glossy = 0;
  double strongest = 0.0, sharpest = 0.0;
  for (int k = 0; k < surfaces; k++) {
    const clt_gloss *gloss = &description->gloss[description->surfaces[k].material];
    bool on = clt_scene_is_glossy(description, k);
    glossy += on;
    for (int c = 0; c < description->channels; c++) {
      strongest = fmax(strongest, gloss->strength[c]);
    }
    sharpest = on ? fmax(sharpest, gloss->exponent) : sharpest;
  }
  if (surfaces == 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "a transport file has its highlights in it");
  } else if (glossy == 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "no material has gloss: all surfaces are Lambertian");
  } else {
    snprintf(why, CLT_EFFECT_WHY_MAX,
             "%d of %d surfaces have a lobe, and the camera sees %d of them; strength up to %.3g, exponent up to %.4g",
             glossy, surfaces, scene->light.glossy, strongest, sharpest);
  }
  return scene->light.glossy > 0;
}

/* T holds it; the time and memory for it are interreflection's. */
const clt_effect clt_effect_gloss = {.name = "gloss", .called_for = called_for};
