/* What every way of computing a scene's light starts from. */
#ifndef CLT_SIM_LAYOUT_H
#define CLT_SIM_LAYOUT_H

#include "sim/mesh.h"

typedef struct clt_layout {
  const clt_scene_description *description; /* outlives the layout */
  clt_visibility *visibility;
  clt_cells cells;
  clt_sights sights;
  clt_mesh mesh; /* without elements where no light goes from surface to surface: T is then diag(F) */
} clt_layout;

/* Traces the cells, finds which surfaces exchange light, and meshes those. layout was zeroed by the caller and is
 * finished by it in either case; description must outlive it. */
clt_status clt_layout_init(clt_layout *layout, const clt_scene_description *description, clt_mesh_size size,
                           clt_error *error);
void clt_layout_finish(clt_layout *layout);

#endif
