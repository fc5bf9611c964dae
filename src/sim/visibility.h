/* What a ray of a scene meets first, and what stands between two points.
 *
 * Rays through more than a few surfaces are traced by Embree, whose answer (in single precision) says which surface;
 * where on it is then computed in double. A few surfaces are tried one by one, which is exact and no slower. Either
 * answer depends on nothing but the ray. */
#ifndef CLT_SIM_VISIBILITY_H
#define CLT_SIM_VISIBILITY_H

#include "counterlight/status.h"
#include "sim/geometry.h"

typedef struct clt_visibility clt_visibility;

/* surfaces outlive it and do not change. */
clt_status clt_visibility_create(const clt_rectangle *surfaces, int count, clt_visibility **out, clt_error *error);
void clt_visibility_destroy(clt_visibility *visibility); /* accepts NULL */

/* The first surface but `leaving` (the one that the ray starts on; -1: none) that origin + distance * direction meets.
 */
clt_hit clt_visibility_first_hit(const clt_visibility *visibility, clt_vector origin, clt_vector direction,
                                 int leaving);

/* True where a surface but a and b, on which the points lie, cuts the open segment between them. */
bool clt_visibility_blocked(const clt_visibility *visibility, clt_vector from, clt_vector to, int a, int b);

/* How many of the segments nothing blocks: all go from surface a to surface b. They are traced together, several times
 * as fast as one by one. */
enum { CLT_SEGMENTS = 16 };
int clt_visibility_open(const clt_visibility *visibility, const clt_vector from[CLT_SEGMENTS],
                        const clt_vector to[CLT_SEGMENTS], int a, int b);

#endif
