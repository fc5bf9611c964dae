/* Surfaces that stand in the way: of the projector's light, of the camera's view (which is the projector's), or of the
 * light between two others. Computed with the scene's light; here is told where. */
#include <stdio.h>

#include "sim/sides.h"
#include "sim/state.h"

static const char nothing[] = "nothing stands between the projector, the camera and the surfaces";

/* Surfaces that a ray meets. */
static int surfaces_met(const clt_scene_description *description, clt_vector direction) {
  int met = 0;
  for (int k = 0; k < description->surface_count; k++) {
    met +=
        clt_first_hit(&description->surfaces[k], 1, description->projector.pinhole.position, direction, -1).surface >=
        0;
  }
  return met;
}

/* Cells in whose middle one surface hides another from projector and camera. */
static int hiding_cells(const clt_scene_description *description) {
  int count = 0;
  for (int y = 0; y < description->height; y++) {
    for (int x = 0; x < description->width; x++) {
      clt_vector direction =
          clt_pinhole_direction(&description->projector.pinhole, (2.0 * x + 1.0) / description->width - 1.0,
                                1.0 - (2.0 * y + 1.0) / description->height);
      count += surfaces_met(description, direction) > 1;
    }
  }
  return count;
}

/* Pairs of surfaces that face each other with another one perhaps between; -1 where memory is short. */
static int blocked_pairs(const clt_scene_description *description) {
  int pairs = 0, count = description->surface_count;
  clt_error error = {.status = CLT_OK};
  clt_sides *sides = NULL;
  if (clt_sides_create(description->surfaces, count, description->surfaces, count, &sides, &error) != CLT_OK) {
    return -1;
  }
  for (int a = 0; a < count; a++) {
    for (int b = 0; b < a; b++) {
      bool face = clt_sides_in_front(sides, a, b) && clt_sides_in_front(sides, b, a);
      pairs += face && clt_sides_may_be_parted(sides, a, b, a, b);
    }
  }
  clt_sides_destroy(sides);
  return pairs;
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_scene_description *description = &scene->description;
  if (description->surface_count == 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "a transport file has its shadows in it");
    return false;
  }
  int hiding = hiding_cells(description), blocked = blocked_pairs(description);
  if (hiding == 0 && blocked == 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "%s", nothing);
    return false;
  }
  int length = snprintf(why, CLT_EFFECT_WHY_MAX, "in %d cells a surface hides another; ", hiding);
  if (blocked < 0) {
    snprintf(why + length, CLT_EFFECT_WHY_MAX - (size_t)length, "memory is too short to tell where else");
  } else {
    snprintf(why + length, CLT_EFFECT_WHY_MAX - (size_t)length, "between %d pairs of facing surfaces others may stand",
             blocked);
  }
  return true;
}

/* Light is traced through the surfaces all at once; the time and memory for it are interreflection's. */
const clt_effect clt_effect_occlusion = {.name = "occlusion", .called_for = called_for};
