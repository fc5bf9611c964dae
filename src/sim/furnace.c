/* The furnace test: a room that glows evenly. */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "sim/light.h"
#include "sim/state.h"

/* (D - albedo H) B = area with D = diag(area) is the light equation times the areas, and symmetric positive definite.
 * H stands above the diagonal, and its factor takes its place. */
static clt_status solve(clt_light *light, double albedo, double *radiance, clt_error *error) {
  const clt_mesh *mesh = &light->layout.mesh;
  size_t count = (size_t)mesh->count;
  for (size_t j = 0; j < count; j++) {
    radiance[j] = clt_rectangle_area(&mesh->elements[j]);
    for (size_t i = 0; i < j; i++) {
      light->exchange[j * count + i] *= -albedo;
    }
    light->exchange[j * count + j] = radiance[j];
  }
  int failed =
      LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', mesh->count, 1, light->exchange, mesh->count, radiance, mesh->count);
  return failed == 0 ? CLT_OK
                     : clt_fail(error, CLT_FAILED, "%s: the furnace could not be solved (LAPACK says %d)",
                                light->layout.description->path, failed);
}

static clt_status glow(const clt_scene *scene, clt_light *light, double albedo, clt_furnace *out, clt_error *error) {
  clt_status status = clt_light_init(light, &scene->description, error);
  if (status == CLT_OK && light->layout.mesh.count == 0) {
    status = clt_fail(error, CLT_BAD_INPUT, "%s: no surfaces exchange light; a furnace needs a room, best a closed one",
                      scene->description.path);
  }
  if (status != CLT_OK) {
    return status;
  }
  int count = light->layout.mesh.count;
  double *radiance = clt_alloc((size_t)count, sizeof *radiance);
  status = radiance != NULL ? solve(light, albedo, radiance, error)
                            : clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
  *out = (clt_furnace){.elements = count, .least = INFINITY};
  for (int k = 0; k < count && status == CLT_OK; k++) {
    out->least = fmin(out->least, radiance[k]);
    out->greatest = fmax(out->greatest, radiance[k]);
  }
  free(radiance);
  return status;
}

clt_status clt_scene_furnace(const clt_scene *scene, double albedo, clt_furnace *out, clt_error *error) {
  if (scene->description.surface_count == 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: a transport file has no surfaces that could glow",
                    scene->description.path);
  }
  if (!(albedo >= 0.0 && albedo < 1.0)) {
    return clt_fail(error, CLT_BAD_INPUT, "the albedo of a furnace is %g; legal is 0 to below 1", albedo);
  }
  clt_light light = {.solved = -1};
  clt_status status = glow(scene, &light, albedo, out, error);
  clt_light_finish(&light);
  return status;
}
