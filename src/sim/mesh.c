#include "sim/mesh.h"

#include <stdlib.h>

#include "base/memory.h"
#include "sim/listing.h"

/* place[old] = 1 for the elements of a list. */
static void mark(const clt_weights *list, int *place) {
  for (int k = 0; k < clt_weights_count(list); k++) {
    place[list->element[k]] = 1;
  }
}

static void renumber(clt_weights *list, const int *place) {
  for (int k = 0; k < clt_weights_count(list); k++) {
    list->element[k] = place[list->element[k]];
  }
}

/* Numbers the elements: place[old] = new, used ones last. place comes as zeros. */
static void order_elements(clt_mesh *mesh, clt_listing *lists, int *place) {
  for (int k = 0; k < CLT_LISTS; k++) {
    mark(&lists->list[k], place);
  }
  for (int k = 0; k < mesh->count; k++) {
    mesh->used += place[k];
  }
  int unused = 0, used = mesh->count - mesh->used;
  for (int k = 0; k < mesh->count; k++) {
    place[k] = place[k] != 0 ? used++ : unused++;
  }
  for (int k = 0; k < CLT_LISTS; k++) {
    renumber(&lists->list[k], place);
  }
}

static void place_elements(clt_mesh *mesh, const clt_scene_description *description, const clt_division *divisions,
                           const int *place) {
  for (int k = 0; k < description->surface_count; k++) {
    const clt_rectangle *whole = &description->surfaces[k];
    const clt_division *by = &divisions[k];
    for (int e = 0; e < by->columns * by->rows; e++) {
      mesh->elements[place[by->first + e]] = clt_division_part(whole, by, e);
      mesh->surface[place[by->first + e]] = k;
    }
  }
}

static bool make_elements(clt_mesh *mesh, const clt_scene_description *description, const clt_division *divisions,
                          clt_listing *lists) {
  int *place = clt_alloc((size_t)mesh->count, sizeof *place);
  mesh->elements = clt_alloc((size_t)mesh->count, sizeof *mesh->elements);
  mesh->surface = clt_alloc((size_t)mesh->count, sizeof *mesh->surface);
  bool enough = place != NULL && mesh->elements != NULL && mesh->surface != NULL;
  if (enough) {
    order_elements(mesh, lists, place);
    place_elements(mesh, description, divisions, place);
  }
  free(place);
  return enough;
}

/* The lists become the mesh's, which shares arrays where two say the same. */
static void take_lists(clt_mesh *mesh, const clt_listing *lists) {
  mesh->lights = lists->list[CLT_LIST_LIGHTS];
  mesh->sees = lists->sees ? lists->list[CLT_LIST_SEES] : mesh->lights;
  for (int c = 0; c < CLT_SIM_CHANNELS_MAX && lists->mirror_planes > 0; c++) {
    mesh->mirrors[c] = lists->list[CLT_LIST_MIRRORS + (c < lists->mirror_planes ? c : 0)];
  }
}

clt_status clt_mesh_init(clt_mesh *mesh, const clt_scene_description *description, const clt_visibility *visibility,
                         const clt_cells *cells, const clt_sights *sights, clt_mesh_size size, clt_error *error) {
  clt_division *divisions = clt_alloc((size_t)description->surface_count, sizeof *divisions);
  clt_listing lists = {.description = description, .visibility = visibility, .divisions = divisions};
  mesh->cells = cells->count;
  bool enough = divisions != NULL;
  if (enough) {
    mesh->count = lists.elements = clt_divide(description, sights, cells->footprint, size, divisions);
    enough = clt_listing_make(&lists, cells) && make_elements(mesh, description, divisions, &lists);
    take_lists(mesh, &lists);
  }
  free(divisions);
  return enough ? CLT_OK
                : clt_fail(error, CLT_FAILED, "%s: out of memory for the light's mesh; use a smaller grid",
                           description->path);
}

void clt_mesh_drop_lists(clt_mesh *mesh) {
  clt_weights *lists[] = {&mesh->lights, &mesh->sees, &mesh->mirrors[0], &mesh->mirrors[1], &mesh->mirrors[2]};
  enum { LISTS = sizeof lists / sizeof lists[0] };
  for (int k = LISTS - 1; k >= 0; k--) {
    bool shared = false;
    for (int before = 0; before < k; before++) {
      shared = shared || lists[before]->start == lists[k]->start;
    }
    if (shared) {
      *lists[k] = (clt_weights){0};
    } else {
      clt_weights_finish(lists[k]);
    }
  }
}

void clt_mesh_finish(clt_mesh *mesh) {
  clt_mesh_drop_lists(mesh);
  free(mesh->elements);
  free(mesh->surface);
  *mesh = (clt_mesh){0};
}
