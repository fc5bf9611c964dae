/* The elements that surfaces are divided into, and what each cell has to do with them.
 *
 * With F the direct light, Phi_j = solid_angle_j intensity the flux of cell j, the rows of `lights` W, those of `sees`
 * V and those of `mirrors` M, and D, K as in sim/light.h,
 *   T = diag(F) + ((V + M) D ((I - K)^-1 - I) D W' + M diag(albedo / area) W') diag(Phi) / pi. */
#ifndef CLT_SIM_MESH_H
#define CLT_SIM_MESH_H

#include "sim/cells.h"
#include "sim/division.h"
#include "sim/weights.h"

typedef struct clt_mesh {
  /* The elements, small rectangles or triangles. Those that a cell lights, sees or mirrors come last, from number
   * count - used on. */
  int count, used;
  clt_rectangle *elements;
  int *surface; /* of each element */
  int cells;
  clt_weights lights; /* of cell j: the elements that it lights, by shares of its solid angle */
  /* of row i: the elements that the camera sees in it, by shares of what it sees. Where the camera stands at the
   * projector these are the arrays of `lights`. */
  clt_weights sees;
  /* mirrors[c] of row i: the elements whose light the gloss of what the camera sees there throws to the camera, in
   * channel c, by what their radiance counts in the cell's. No rows (start is NULL) without gloss; channels of equal
   * gloss share arrays. */
  clt_weights mirrors[CLT_SIM_CHANNELS_MAX];
} clt_mesh;

/* Divides the surfaces that exchange light into elements about as large as the median footprint of a cell, smaller
 * where that gives fewer than size.wanted, larger where it gives more than size.most; then finds what the cells have to
 * do with them. visibility is of the description's surfaces. mesh was zeroed by the caller and is finished by it in
 * either case. */
clt_status clt_mesh_init(clt_mesh *mesh, const clt_scene_description *description, const clt_visibility *visibility,
                         const clt_cells *cells, const clt_sights *sights, clt_mesh_size size, clt_error *error);
/* Lets the lists of the cells go; the elements stay. */
void clt_mesh_drop_lists(clt_mesh *mesh);
void clt_mesh_finish(clt_mesh *mesh);

#endif
