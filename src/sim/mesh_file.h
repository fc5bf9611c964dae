/* Triangles from files of 3D programs. */
#ifndef CLT_SIM_MESH_FILE_H
#define CLT_SIM_MESH_FILE_H

#include "sim/shapes.h"

/* How a file's points become the scene's: at + scale * point. */
typedef struct clt_mesh_place {
  clt_vector at;
  double scale;
} clt_mesh_place;

/* Appends the triangles of an OBJ, PLY or glTF file (polygons are divided) to the description's surfaces. The outside
 * is where a face's corners go around counter-clockwise. CLT_BAD_INPUT, with the description as before, where the file
 * cannot be read, has no faces or more than fit, a coordinate that is not a number or a face without area; CLT_FAILED
 * where this build reads no meshes. */
clt_status clt_mesh_file_add(clt_scene_description *description, const char *path, const clt_mesh_place *place,
                             clt_facing facing, const double *albedo, clt_error *error);

#endif
