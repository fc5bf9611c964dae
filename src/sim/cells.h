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
  double view;    /* over that of what the camera sees of the cell; 0 where that is hidden from it, or dark */
  double falloff; /* cos / r^2, 1/m^2: irradiance per radiant intensity */
  double s, t;    /* where on the surface */
  clt_vector at;  /* the same place, m */
} clt_ray_end;

/* Whether a placed camera sees the front of a surface at a place on it. */
bool clt_camera_sees(const clt_scene_description *description, const clt_visibility *visibility, int surface,
                     clt_vector at);

/* Traces the rays * rays (at most CLT_CELL_RAYS_MAX) sub-rays of a cell. Returns its solid angle, sr.
 *
 * A row of T is the mean over the cell, weighted by solid angle, of what the camera sees of it. Sub-rays whose ends are
 * hidden from the camera (behind another surface, from behind, or outside its image) are no part of that mean; those
 * that meet no front are black in it. */
double clt_cell_trace(const clt_scene_description *description, const clt_visibility *visibility, int cell,
                      clt_ray_end *ends);

typedef struct clt_cells {
  int count, channels;
  double *solid_angle; /* of each cell, sr */
  /* direct[c * count + i]: F_i, W/(m^2 sr), of a panel without black leak: mean over what the camera sees of
   * (albedo / pi + gloss towards the camera) * intensity * cos / r^2 */
  double *direct;
  double footprint; /* median over lit cells of the area that a cell covers, m^2 */
  bool *lit, *seen; /* of each surface: a sub-ray meets its front; and the camera sees it there */
  int hidden;       /* lit cells of which the camera sees nothing */
  int partly;       /* lit cells of which it sees a part */
} clt_cells;

/* Traces every cell; the ends are not kept (at 64 each they outgrow all else). visibility is of the description's
 * surfaces. cells was zeroed by the caller and is finished by it in either case. */
clt_status clt_cells_init(clt_cells *cells, const clt_scene_description *description, const clt_visibility *visibility,
                          clt_error *error);
void clt_cells_finish(clt_cells *cells);

#endif
