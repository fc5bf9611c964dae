/* Form factors between flat polygons. */
#ifndef CLT_SIM_FORMFACTOR_H
#define CLT_SIM_FORMFACTOR_H

#include "sim/geometry.h"

/* The form factor from a small area at `point` with unit normal `normal` to a convex quadrilateral: the fraction of the
 * light leaving the area diffusely that meets its front (Lambert 1760; Baum, Rushmeier, Winget, SIGGRAPH 1989, eq. 4).
 * The part below the area's horizon is cut off. vertices: counter-clockwise seen from the front, plane_normal its unit
 * normal; 0 where the point is behind it. */
double clt_formfactor_point(clt_vector point, clt_vector normal, const clt_vector vertices[4], clt_vector plane_normal);

/* What may stand between two rectangles. */
typedef struct clt_blockers {
  const clt_rectangle *rectangles;
  const int *which;
  int count;
} clt_blockers;

/* area(a) times the form factor from a to b, m^2 (so that it is the same from b to a): the point form factor integrated
 * over a by Gauss-Legendre quadrature of an order that grows as they get close. Visibility is judged from each
 * quadrature point to the centre of b. Both are small elements of larger rectangles. */
double clt_formfactor_exchange(const clt_rectangle *a, const clt_rectangle *b, const clt_blockers *blockers);

#endif
