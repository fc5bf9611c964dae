/* What may stand between two flat pieces of surface: shaft culling (Haines and Wallace, Eurographics Workshop on
 * Rendering 1991). */
#ifndef CLT_SIM_SHAFT_H
#define CLT_SIM_SHAFT_H

#include "sim/geometry.h"

enum { CLT_SHAFT_AXES = 8 };

/* The convex hull of two convex polygons that face each other. */
typedef struct clt_shaft {
  clt_vector corner[8]; /* of the one, then of the other */
  clt_vector normal[2];
  clt_vector axis[CLT_SHAFT_AXES]; /* along which it reaches from low to high */
  double low[CLT_SHAFT_AXES], high[CLT_SHAFT_AXES];
  double touching; /* a height, m, below which a point lies on a plane */
} clt_shaft;

/* The polygons have four corners each (a triangle its last one twice) and unit normals. */
void clt_shaft_init(clt_shaft *shaft, const clt_vector a[4], clt_vector normal_a, const clt_vector b[4],
                    clt_vector normal_b);
/* False where the surface certainly cuts no segment from the front of the one to the front of the other. */
bool clt_shaft_may_hold(const clt_shaft *shaft, const clt_rectangle *surface);
/* True where the surface certainly cuts every such segment: it cuts those from corner to corner, and where a segment
 * meets its plane is a projective map of either end, which keeps convex sets convex. */
bool clt_shaft_closed_by(const clt_shaft *shaft, const clt_rectangle *surface);

#endif
