/* Triangles from files of 3D programs. */
#ifndef CLT_SIM_MESH_FILE_H
#define CLT_SIM_MESH_FILE_H

#include "sim/shapes.h"

/* How a file's points become the scene's: at + scale * point. Where the file's y points up, its x stays and its z
 * comes towards the one who looks along the scene's y. */
typedef struct clt_mesh_place {
  clt_vector at;
  double scale;
  bool y_up;
} clt_mesh_place;

/* True of the formats that say that y points up: glTF. */
bool clt_mesh_file_is_y_up(const char *path);

/* Appends the triangles of an OBJ, PLY or glTF (.gltf, .glb) file, by its ending, to the description's surfaces;
 * polygons are divided, and the nodes of a glTF file put their parts where they belong. The outside is where a face's
 * corners go around counter-clockwise (clockwise in a part that its node mirrors, as glTF says). CLT_BAD_INPUT, with
 * the description as before, where the file is of another format, cannot be read or ends early, has no faces or more
 * than fit, a coordinate that is not a number, a corner that it does not have, or a face without area; CLT_FAILED where
 * this build reads no meshes. */
clt_status clt_mesh_file_add(clt_scene_description *description, const char *path, const clt_mesh_place *place,
                             clt_facing facing, const double *albedo, clt_error *error);

#endif
