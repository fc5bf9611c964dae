/* Form factors between flat polygons. */
#ifndef CLT_SIM_FORMFACTOR_H
#define CLT_SIM_FORMFACTOR_H

#include "sim/geometry.h"

/* The form factor from a small area at `point` with unit normal `normal` to a convex polygon: the fraction of the
 * light leaving the area diffusely that meets its front (Lambert 1760; Baum, Rushmeier, Winget, SIGGRAPH 1989, eq. 4).
 * The part below the area's horizon is cut off. vertices: counter-clockwise seen from the front, plane_normal its unit
 * normal, count at most 4; 0 where the point is behind it. */
double clt_formfactor_point(clt_vector point, clt_vector normal, const clt_vector *vertices, int count,
                            clt_vector plane_normal);

/* area(a) times the form factor from a to b where nothing stands between, m^2 (so that it is the same from b to a).
 * Each is first cut to what lies in front of the other's plane. Pairs that are close by the double contour integral
 *   H = 1/(2 pi) sum over edge pairs of (e_a . e_b) integral integral ln r dt ds    (Stokes; Goral et al. 1984, eq.
 * 15), the inner integral in closed form, the outer by bisected Gauss-Legendre quadrature; others by the point form
 * factor integrated over a. */
double clt_formfactor_exchange(const clt_rectangle *a, const clt_rectangle *b);

#endif
