#include "sim/occlusion.h"

#include "sim/sides.h"

/* Image coordinates of the middle of a cell of a picture. */
static void middle_of(const clt_scene_description *description, int cell, double *x, double *y) {
  *x = (2.0 * (cell % description->width) + 1.0) / description->width - 1.0;
  *y = 1.0 - (2.0 * (cell / description->width) + 1.0) / description->height;
}

/* Whether a ray meets a surface and, clearly behind it, the front of another. Surfaces that meet at an edge lie at the
 * same distance. */
static bool stands_before_a_front(const clt_visibility *visibility, clt_vector from, clt_vector direction) {
  enum { SURFACES = 16 };
  const double touching = 1e-6; /* of the distance */
  clt_hit hit = clt_visibility_first_hit(visibility, from, direction, -1);
  double nearest = hit.distance, distance = hit.distance;
  for (int k = 0; k < SURFACES && hit.surface >= 0; k++) {
    from = vec_along(from, hit.distance, direction, 0.0, direction);
    hit = clt_visibility_first_hit(visibility, from, direction, hit.surface);
    distance += hit.distance;
    if (hit.surface >= 0 && hit.front && distance > (1.0 + touching) * nearest) {
      return true;
    }
  }
  return false;
}

/* What a camera with a pose of its own sees of the projector's shadow. */
static void look_at_shadow(const clt_scene_description *description, const clt_visibility *visibility,
                           clt_occlusion *found) {
  const clt_pinhole *camera = &description->camera.pinhole, *projector = &description->projector.pinhole;
  int viewed = 0, shadowed = 0;
#pragma omp parallel for schedule(static) reduction(+ : viewed, shadowed)
  for (int cell = 0; cell < description->width * description->height; cell++) {
    double x, y;
    clt_vector direction;
    middle_of(description, cell, &x, &y);
    if (!clt_optics_direction(camera, description->camera.distortion, x, y, &direction)) {
      continue;
    }
    clt_hit hit = clt_visibility_first_hit(visibility, camera->position, direction, -1);
    clt_vector at = vec_along(camera->position, hit.distance, direction, 0.0, direction);
    if (hit.surface >= 0 && hit.front && clt_pinhole_covers(projector, at) &&
        vec_dot(vec_sub(projector->position, at), description->surfaces[hit.surface].normal) > 0.0) {
      viewed++;
      shadowed += clt_visibility_blocked(visibility, at, projector->position, hit.surface, -1);
    }
  }
  found->viewed = viewed;
  found->shadowed = shadowed;
}

static clt_status count_parted(const clt_scene_description *description, int *pairs, clt_error *error) {
  int count = description->surface_count, found = 0;
  clt_sides *sides = NULL;
  clt_status status = clt_sides_create(description->surfaces, count, description->surfaces, count, &sides, error);
#pragma omp parallel for schedule(dynamic) reduction(+ : found) if (status == CLT_OK)
  for (int a = 0; a < count; a++) {
    for (int b = 0; b < a && status == CLT_OK; b++) {
      bool face = clt_sides_in_front(sides, a, b) && clt_sides_in_front(sides, b, a);
      found += face && clt_sides_may_be_parted(sides, a, b, a, b);
    }
  }
  clt_sides_destroy(sides);
  *pairs = found;
  return status;
}

clt_status clt_occlusion_find(const clt_scene_description *description, const clt_visibility *visibility,
                              const clt_cells *cells, clt_occlusion *out, clt_error *error) {
  const clt_pinhole *projector = &description->projector.pinhole;
  clt_occlusion found = {.hidden = cells->hidden, .partly = cells->partly};
  int shading = 0;
#pragma omp parallel for schedule(static) reduction(+ : shading)
  for (int cell = 0; cell < cells->count; cell++) {
    double x, y;
    middle_of(description, cell, &x, &y);
    shading += stands_before_a_front(visibility, projector->position, clt_pinhole_direction(projector, x, y));
  }
  found.shading = shading;
  if (description->camera.placed) {
    look_at_shadow(description, visibility, &found);
  }
  clt_status status = count_parted(description, &found.parted, error);
  *out = found;
  return status;
}
