#include "sim/sightline.h"

/* Fills in x and y of a place; false where it lies beyond the picture. */
static bool find_in_picture(const clt_scene_description *description, clt_vector at, clt_sightline *line) {
  const double behind = 1e-9; /* least depth, of the distance: what lies behind the lens is far beyond the edges */
  const clt_pinhole *projector = &description->projector.pinhole;
  clt_vector view = vec_sub(at, projector->position);
  double true_depth = vec_dot(view, projector->forward), depth = fmax(true_depth, behind * vec_length(view));
  double right = vec_dot(view, projector->right) / (depth * projector->tangent[0]);
  double up = vec_dot(view, projector->up) / (depth * projector->tangent[1]);
  line->x = 0.5 * (1.0 + right) * description->width;
  line->y = 0.5 * (1.0 - up) * description->height;
  return true_depth > 0.0 && line->x >= 0.0 && line->x < description->width && line->y >= 0.0 &&
         line->y < description->height;
}

static bool is_lit(const clt_scene_description *description, const clt_visibility *visibility, int surface,
                   clt_vector at) {
  clt_vector lamp = description->projector.pinhole.position;
  return vec_dot(vec_sub(lamp, at), description->surfaces[surface].normal) > 0.0 &&
         !clt_visibility_blocked(visibility, at, lamp, surface, -1);
}

clt_sightline clt_sightline_trace(const clt_scene_description *description, const clt_visibility *visibility,
                                  double column, double row) {
  const clt_camera_description *camera = &description->camera;
  clt_sightline line = {.fate = CLT_SIGHTLINE_NOTHING, .surface = -1, .x = NAN, .y = NAN};
  clt_vector direction, eye = camera->pinhole.position;
  if (!clt_optics_direction(&camera->pinhole, camera->distortion, 2.0 * column / camera->width - 1.0,
                            1.0 - 2.0 * row / camera->height, &direction)) {
    return line;
  }
  clt_hit hit = clt_visibility_first_hit(visibility, eye, direction, -1);
  if (hit.surface < 0 || !hit.front) {
    return line;
  }
  clt_vector at = vec_along(eye, hit.distance, direction, 0.0, direction);
  line.surface = hit.surface;
  line.fate = !find_in_picture(description, at, &line)            ? CLT_SIGHTLINE_OUTSIDE
              : is_lit(description, visibility, line.surface, at) ? CLT_SIGHTLINE_LIT
                                                                  : CLT_SIGHTLINE_SHADOWED;
  return line;
}

clt_status clt_sightline_map(const clt_scene_description *description, float *x, float *y, float *fate,
                             clt_error *error) {
  int width = description->camera.width, height = description->camera.height;
  clt_visibility *visibility = NULL;
  clt_status status = clt_visibility_create(description->surfaces, description->surface_count, &visibility, error);
  if (status != CLT_OK) {
    return status;
  }
#pragma omp parallel for schedule(dynamic)
  for (int row = 0; row < height; row++) {
    for (int column = 0; column < width; column++) {
      size_t k = (size_t)row * (size_t)width + (size_t)column;
      clt_sightline line = clt_sightline_trace(description, visibility, column + 0.5, row + 0.5);
      bool lit = line.fate == CLT_SIGHTLINE_LIT;
      x[k] = lit ? (float)line.x : NAN;
      y[k] = lit ? (float)line.y : NAN;
      fate[k] = (float)line.fate;
    }
  }
  clt_visibility_destroy(visibility);
  return CLT_OK;
}
