#include "sim/mesh_file.h"

bool clt_mesh_file_is_y_up(const char *path) {
  (void)path;
  return false;
}

clt_status clt_mesh_file_add(clt_scene_description *description, const char *path, const clt_mesh_place *place,
                             clt_facing facing, const double *albedo, clt_error *error) {
  (void)description, (void)place, (void)facing, (void)albedo;
  return clt_fail(error, CLT_FAILED, "%s: this build reads no meshes; install assimp and build with -Dmeshes=enabled",
                  path);
}
