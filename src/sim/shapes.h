/* Solid shapes as flat surfaces. */
#ifndef CLT_SIM_SHAPES_H
#define CLT_SIM_SHAPES_H

#include "sim/description.h"

/* Which side of a shape reflects; the other is black. */
typedef enum clt_facing { CLT_FACING_OUT, CLT_FACING_IN } clt_facing;

/* The functions append to the description's surfaces, each of the given albedo per channel. False where they do not fit
 * into CLT_SURFACES_MAX; the description is then as before. */

/* The six sides of the box of points corner + s e0 + t e1 + r e2, 0 <= s, t, r <= 1; the edges are perpendicular, in
 * any order. */
bool clt_shape_box(clt_scene_description *description, clt_vector corner, const clt_vector edges[3], clt_facing facing,
                   const double *albedo);

typedef struct clt_cylinder {
  clt_vector centre, axis; /* middle of one end, and the way from there to the other */
  clt_vector start; /* the way from the axis to where the arc starts: perpendicular to axis, its length is the radius */
  double arc;       /* radians, counter-clockwise seen against the axis; 2 pi is all around */
  int pieces;
} clt_cylinder;

/* The wall of a cylinder, without its ends, as equal rectangles whose corners lie on it. */
bool clt_shape_cylinder(clt_scene_description *description, const clt_cylinder *cylinder, clt_facing facing,
                        const double *albedo);

/* The part of a sphere between two angles from its axis, and as far around it as a cylinder's arc. */
typedef struct clt_sphere {
  clt_vector centre;
  double radius;
  clt_vector axis, start; /* directions, perpendicular: of the pole, and to where the arc begins */
  double from, to;        /* radians from the pole, 0 <= from < to <= pi; both poles take two rings */
  double arc;             /* radians, counter-clockwise seen against the axis; 2 pi is all around */
  int rings, pieces;      /* along the way from the pole, and along the arc */
} clt_sphere;

/* rings x pieces flat facets whose corners lie on the sphere, each of two triangles, or of one at a pole. */
bool clt_shape_sphere(clt_scene_description *description, const clt_sphere *sphere, clt_facing facing,
                      const double *albedo);

#endif
