/* Surfaces that stand in the way: of the projector's light, of the camera's view, or of the light between two others.
 * Computed with the scene's light; here is told where. */
#include <stdio.h>

#include "sim/state.h"

static bool called_for(const clt_scene *scene, char *why) {
  const clt_occlusion *found = &scene->light.occlusion;
  if (scene->description.surface_count == 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "a transport file has its shadows in it");
    return false;
  }
  if (found->shading + found->hidden + found->partly + found->shadowed + found->parted == 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "nothing stands between the projector, the camera and the surfaces");
    return false;
  }
  if (scene->description.camera.placed) {
    snprintf(why, CLT_EFFECT_WHY_MAX,
             "%d cells are hidden from the camera, %d in part; %d of %d points that it sees are in the projector's "
             "shadow; %d facing pairs of surfaces may be parted",
             found->hidden, found->partly, found->shadowed, found->viewed, found->parted);
  } else {
    snprintf(why, CLT_EFFECT_WHY_MAX,
             "in %d cells a surface shades another; between %d pairs of facing surfaces others may stand",
             found->shading, found->parted);
  }
  return true;
}

/* Light is traced through the surfaces all at once; the time and memory for it are interreflection's. */
const clt_effect clt_effect_occlusion = {.name = "occlusion", .called_for = called_for};
