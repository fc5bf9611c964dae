/* On which sides of the planes of a scene's surfaces other flat pieces lie: told once for all, so that asking for a
 * pair takes a few operations on words of bits instead of a look at every surface. */
#ifndef CLT_SIM_SIDES_H
#define CLT_SIM_SIDES_H

#include "counterlight/status.h"
#include "sim/geometry.h"

typedef struct clt_sides clt_sides;

/* pieces may be the surfaces themselves, or elements of them. Nothing is kept of either. Takes about
 * surface_count * piece_count / 4 bytes. */
clt_status clt_sides_create(const clt_rectangle *surfaces, int surface_count, const clt_rectangle *pieces,
                            int piece_count, clt_sides **out, clt_error *error);
void clt_sides_destroy(clt_sides *sides); /* accepts NULL */

/* True where some point of the piece lies well in front of the surface's plane. */
bool clt_sides_in_front(const clt_sides *sides, int piece, int surface);

/* What clt_rectangles_may_be_parted says of pieces i and j of surfaces a and b: true where some other surface could
 * stand between points of them. */
bool clt_sides_may_be_parted(const clt_sides *sides, int i, int j, int a, int b);

#endif
