#include "sim/mesh_file.h"

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <string.h>

static clt_vector placed(const struct aiVector3D *point, const clt_mesh_place *place) {
  clt_vector from = {(double)point->x, (double)point->y, (double)point->z};
  return vec_along(place->at, place->scale, from, 0.0, from);
}

static bool finite_vector(clt_vector a) {
  return isfinite(a.x) && isfinite(a.y) && isfinite(a.z);
}

/* Makes the triangle of a face. */
static clt_status make_triangle(const struct aiMesh *mesh, unsigned number, const clt_mesh_place *place,
                                clt_facing facing, clt_rectangle *made, clt_error *error) {
  const unsigned *corners = mesh->mFaces[number].mIndices;
  clt_vector at[3];
  for (int k = 0; k < 3; k++) {
    at[k] = placed(&mesh->mVertices[corners[k]], place);
    if (!finite_vector(at[k])) {
      return clt_fail(error, CLT_BAD_INPUT, "face %u has a corner that is not a number", number + 1);
    }
  }
  bool out = facing == CLT_FACING_OUT;
  *made = (clt_rectangle){
      .corner = at[0], .u = vec_sub(at[out ? 1 : 2], at[0]), .v = vec_sub(at[out ? 2 : 1], at[0]), .triangle = true};
  if (!clt_rectangle_complete(made)) {
    return clt_fail(error, CLT_BAD_INPUT, "face %u has no area; delete it", number + 1);
  }
  return CLT_OK;
}

static clt_status add_faces(clt_scene_description *description, const struct aiMesh *mesh, const clt_mesh_place *place,
                            clt_facing facing, const double *albedo, clt_error *error) {
  clt_status status = CLT_OK;
  for (unsigned k = 0; k < mesh->mNumFaces && status == CLT_OK; k++) {
    if (mesh->mFaces[k].mNumIndices != 3) { /* points and lines */
      continue;
    }
    if (!clt_scene_reserve_surfaces(description, 1)) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "has too many triangles: a scene takes at most %d flat surfaces; simplify it", CLT_SURFACES_MAX);
    }
    clt_rectangle *added = &description->surfaces[description->surface_count];
    status = make_triangle(mesh, k, place, facing, added, error);
    if (status == CLT_OK) {
      memcpy(added->albedo, albedo, sizeof added->albedo);
      description->surface_count++;
    }
  }
  return status;
}

clt_status clt_mesh_file_add(clt_scene_description *description, const char *path, const clt_mesh_place *place,
                             clt_facing facing, const double *albedo, clt_error *error) {
  int before = description->surface_count;
  clt_error wrong = {.status = CLT_OK};
  const struct aiScene *scene =
      aiImportFile(path, aiProcess_Triangulate | aiProcess_PreTransformVertices | aiProcess_SortByPType);
  if (scene == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be read as a mesh: %.120s", path, aiGetErrorString());
  }
  clt_status status = CLT_OK;
  for (unsigned k = 0; k < scene->mNumMeshes && status == CLT_OK; k++) {
    status = add_faces(description, scene->mMeshes[k], place, facing, albedo, &wrong);
  }
  aiReleaseImport(scene);
  if (status == CLT_OK && description->surface_count == before) {
    status = clt_fail(&wrong, CLT_BAD_INPUT, "has no faces");
  }
  if (status != CLT_OK) {
    description->surface_count = before;
    return clt_fail(error, status, "%s: %s", path, wrong.message);
  }
  return CLT_OK;
}
