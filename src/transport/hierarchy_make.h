/* Making a hierarchy: what its ways share. */
#ifndef CLT_TRANSPORT_HIERARCHY_MAKE_H
#define CLT_TRANSPORT_HIERARCHY_MAKE_H

#include "transport/hierarchy.h"

/* Fills the storage of `to`, which knows its grid and channels: from blocks storage (hierarchy_build.c), or from any
 * storage of a square T by its rows (hierarchy_fit.c). What they have allocated when they fail, destroy frees. */
clt_status clt_hierarchy_from_blocks(const clt_transport *from, double tolerance, clt_transport *to, clt_error *error);
clt_status clt_hierarchy_from_rows(const clt_transport *from, double tolerance, clt_transport *to, clt_error *error);

/* Makes room for the factors and for what stands cell by cell, once leaves and rank are known; zeros. */
clt_status clt_hierarchic_reserve_cells(clt_transport *transport, clt_error *error);
/* Makes room for near entries. */
clt_status clt_hierarchic_reserve_near(clt_transport *transport, size_t entries, clt_error *error);
/* What a light of 1 is: the median of what cells show of themselves, 1 where that is not positive. room: N values. */
double clt_own_light(const clt_transport *transport, int channel, double *room);

#endif
