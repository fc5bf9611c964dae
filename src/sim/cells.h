/* What the rays of the projector's cells meet: where they end, how large the cells are there, and their direct light.
 */
#ifndef CLT_SIM_CELLS_H
#define CLT_SIM_CELLS_H

#include "sim/description.h"
#include "sim/visibility.h"

enum { CLT_CELL_RAYS_MAX = 256 };

/* A sub-ray of a cell. */
typedef struct clt_ray_end {
  int surface;    /* that it lights from the front; -1: none */
  double share;   /* its solid angle over the cell's */
  double falloff; /* cos / r^2, 1/m^2: irradiance per radiant intensity */
  double s, t;    /* where on the surface */
} clt_ray_end;

/* Traces the rays * rays (at most CLT_CELL_RAYS_MAX) sub-rays of a cell. Returns its solid angle, sr. */
double clt_cell_trace(const clt_scene_description *description, const clt_visibility *visibility, int cell,
                      clt_ray_end *ends);

typedef struct clt_cells {
  int count, channels;
  double *solid_angle; /* of each cell, sr */
  /* direct[c * count + i]: F_i, W/(m^2 sr), of a panel without black leak: mean over the sub-rays of albedo / pi *
   * intensity * cos / r^2 */
  double *direct;
  double footprint; /* median over lit cells of the area that a cell covers, m^2 */
  bool *lit;        /* of each surface: a sub-ray meets its front */
} clt_cells;

/* Traces every cell; the ends are not kept (at 64 each they outgrow all else). visibility is of the description's
 * surfaces. cells was zeroed by the caller and is finished by it in either case. */
clt_status clt_cells_init(clt_cells *cells, const clt_scene_description *description, const clt_visibility *visibility,
                          clt_error *error);
void clt_cells_finish(clt_cells *cells);

#endif
