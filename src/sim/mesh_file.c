#include "sim/mesh_file.h"

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "sim/ply_file.h"

/* Far more than the triangles of a scene take. */
static const double BYTES_MAX = 256e6;

/* A file on its way into a description. */
typedef struct loading {
  const struct aiScene *file;
  clt_scene_description *description;
  const clt_mesh_place *place;
  clt_facing facing;
  const double *albedo;
} loading;

/* x -> rows * (x, 1) */
typedef struct affine {
  double rows[3][4];
} affine;

static affine affine_of(const struct aiMatrix4x4 *m) {
  return (affine){{{(double)m->a1, (double)m->a2, (double)m->a3, (double)m->a4},
                   {(double)m->b1, (double)m->b2, (double)m->b3, (double)m->b4},
                   {(double)m->c1, (double)m->c2, (double)m->c3, (double)m->c4}}};
}

static affine after(const affine *outer, const affine *inner) {
  affine both;
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 4; j++) {
      both.rows[i][j] = j == 3 ? outer->rows[i][3] : 0.0;
      for (int k = 0; k < 3; k++) {
        both.rows[i][j] += outer->rows[i][k] * inner->rows[k][j];
      }
    }
  }
  return both;
}

static bool mirrors(const affine *a) {
  const double(*r)[4] = a->rows;
  clt_vector x = {r[0][0], r[1][0], r[2][0]}, y = {r[0][1], r[1][1], r[2][1]}, z = {r[0][2], r[1][2], r[2][2]};
  return vec_dot(vec_cross(x, y), z) < 0.0;
}

static clt_vector placed(const struct aiVector3D *point, const affine *node, const clt_mesh_place *place) {
  const double x[4] = {(double)point->x, (double)point->y, (double)point->z, 1.0};
  double to[3] = {0.0};
  for (int i = 0; i < 3; i++) {
    for (int k = 0; k < 4; k++) {
      to[i] += node->rows[i][k] * x[k];
    }
  }
  clt_vector from = place->y_up ? (clt_vector){to[0], -to[2], to[1]} : (clt_vector){to[0], to[1], to[2]};
  return vec_along(place->at, place->scale, from, 0.0, from);
}

static bool finite_vector(clt_vector a) {
  return isfinite(a.x) && isfinite(a.y) && isfinite(a.z);
}

/* Makes the triangle of a face. */
static clt_status make_triangle(const loading *from, const struct aiMesh *mesh, unsigned number, const affine *node,
                                clt_rectangle *made, clt_error *error) {
  const unsigned *corners = mesh->mFaces[number].mIndices;
  clt_vector at[3];
  for (int k = 0; k < 3; k++) {
    at[k] = placed(&mesh->mVertices[corners[k]], node, from->place);
    if (!finite_vector(at[k])) {
      return clt_fail(error, CLT_BAD_INPUT, "face %u has a corner that is not a number; correct or delete it",
                      number + 1);
    }
  }
  bool out = (from->facing == CLT_FACING_OUT) != mirrors(node);
  *made = (clt_rectangle){
      .corner = at[0], .u = vec_sub(at[out ? 1 : 2], at[0]), .v = vec_sub(at[out ? 2 : 1], at[0]), .triangle = true};
  if (!clt_rectangle_complete(made)) {
    return clt_fail(error, CLT_BAD_INPUT, "face %u has no area; delete it", number + 1);
  }
  return CLT_OK;
}

static clt_status add_faces(const loading *to, const struct aiMesh *mesh, const affine *node, clt_error *error) {
  clt_scene_description *description = to->description;
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
    status = make_triangle(to, mesh, k, node, added, error);
    if (status == CLT_OK) {
      memcpy(added->albedo, to->albedo, sizeof added->albedo);
      description->surface_count++;
    }
  }
  return status;
}

static clt_status add_node(const loading *to, const struct aiNode *node, const affine *outer, clt_error *error) {
  affine own = affine_of(&node->mTransformation), whole = after(outer, &own);
  clt_status status = CLT_OK;
  for (unsigned k = 0; k < node->mNumMeshes && status == CLT_OK; k++) {
    status = add_faces(to, to->file->mMeshes[node->mMeshes[k]], &whole, error);
  }
  for (unsigned k = 0; k < node->mNumChildren && status == CLT_OK; k++) {
    status = add_node(to, node->mChildren[k], &whole, error);
  }
  return status;
}

/* Before polygons are divided, for that reads the corners. A face of one or two corners is a point or a line where the
 * format has such, else what is left of a face. */
static clt_status check_faces(const struct aiMesh *mesh, clt_error *error) {
  for (unsigned k = 0; k < mesh->mNumFaces; k++) {
    const struct aiFace *face = &mesh->mFaces[k];
    bool drawn = (face->mNumIndices == 1 && (mesh->mPrimitiveTypes & aiPrimitiveType_POINT) != 0) ||
                 (face->mNumIndices == 2 && (mesh->mPrimitiveTypes & aiPrimitiveType_LINE) != 0);
    if (face->mNumIndices < 3 && !drawn) {
      return clt_fail(error, CLT_BAD_INPUT, "face %u has %u corners; give it three, or delete it", k + 1,
                      face->mNumIndices);
    }
    for (unsigned corner = 0; corner < face->mNumIndices; corner++) {
      if (face->mIndices[corner] >= mesh->mNumVertices) {
        return clt_fail(error, CLT_BAD_INPUT,
                        "face %u has a corner that is none of the %u vertices; correct or delete it", k + 1,
                        mesh->mNumVertices);
      }
    }
  }
  return CLT_OK;
}

static clt_status add_file(loading *to, clt_error *error) {
  const affine unit = {{{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}}};
  int before = to->description->surface_count;
  clt_status status = CLT_OK;
  for (unsigned k = 0; k < to->file->mNumMeshes && status == CLT_OK; k++) {
    status = check_faces(to->file->mMeshes[k], error);
  }
  if (status != CLT_OK) {
    return status;
  }
  if (aiApplyPostProcessing(to->file, aiProcess_Triangulate) == NULL) {
    to->file = NULL; /* released by it */
    return clt_fail(error, CLT_BAD_INPUT, "its polygons cannot be divided into triangles; divide them before");
  }
  status = add_node(to, to->file->mRootNode, &unit, error);
  if (status == CLT_OK && to->description->surface_count == before) {
    return clt_fail(error, CLT_BAD_INPUT, "has no faces");
  }
  return status;
}

static bool ends_with(const char *path, const char *ending) {
  size_t length = strlen(path), tail = strlen(ending);
  return length >= tail && strcasecmp(path + length - tail, ending) == 0;
}

bool clt_mesh_file_is_y_up(const char *path) {
  return ends_with(path, ".gltf") || ends_with(path, ".glb");
}

/* What would make the reader guess, or take long. */
static clt_status check_file(const char *path, clt_error *error) {
  struct stat found;
  if (!clt_mesh_file_is_y_up(path) && !ends_with(path, ".obj") && !ends_with(path, ".ply")) {
    return clt_fail(error, CLT_BAD_INPUT, "is no mesh by its name; legal endings are .obj, .ply, .gltf and .glb");
  }
  if (stat(path, &found) != 0 || !S_ISREG(found.st_mode)) {
    return clt_fail(error, CLT_BAD_INPUT, "is no file that can be read; check its name");
  }
  if ((double)found.st_size > BYTES_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "has %.0f MB; a scene takes at most %d flat surfaces: simplify it",
                    1e-6 * (double)found.st_size, CLT_SURFACES_MAX);
  }
  return ends_with(path, ".ply") ? clt_ply_check(path, error) : CLT_OK;
}

clt_status clt_mesh_file_add(clt_scene_description *description, const char *path, const clt_mesh_place *place,
                             clt_facing facing, const double *albedo, clt_error *error) {
  int before = description->surface_count;
  clt_error wrong = {.status = CLT_OK};
  clt_status status = check_file(path, &wrong);
  if (status != CLT_OK) {
    return clt_fail(error, status, "%s: %s", path, wrong.message);
  }
  loading to = {aiImportFile(path, 0), description, place, facing, albedo};
  if (to.file == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be read as a mesh; write it again: %.120s", path,
                    aiGetErrorString());
  }
  status = add_file(&to, &wrong);
  if (to.file != NULL) {
    aiReleaseImport(to.file);
  }
  if (status != CLT_OK) {
    description->surface_count = before;
    return clt_fail(error, status, "%s: %s", path, wrong.message);
  }
  return CLT_OK;
}
