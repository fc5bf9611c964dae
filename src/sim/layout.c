#include "sim/layout.h"

clt_status clt_layout_init(clt_layout *layout, const clt_scene_description *description, clt_mesh_size size,
                           clt_error *error) {
  layout->description = description;
  clt_status status =
      clt_visibility_create(description->surfaces, description->surface_count, &layout->visibility, error);
  if (status == CLT_OK) {
    status = clt_cells_init(&layout->cells, description, layout->visibility, error);
  }
  if (status == CLT_OK) {
    status = clt_sights_init(&layout->sights, description, layout->visibility, &layout->cells, error);
  }
  if (status == CLT_OK && layout->sights.exchanging > 0) {
    status =
        clt_mesh_init(&layout->mesh, description, layout->visibility, &layout->cells, &layout->sights, size, error);
  }
  return status;
}

void clt_layout_finish(clt_layout *layout) {
  clt_mesh_finish(&layout->mesh);
  clt_sights_finish(&layout->sights);
  clt_cells_finish(&layout->cells);
  clt_visibility_destroy(layout->visibility);
  *layout = (clt_layout){0};
}
