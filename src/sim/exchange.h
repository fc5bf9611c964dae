/* The diffuse exchange of light between the elements of a scene. */
#ifndef CLT_SIM_EXCHANGE_H
#define CLT_SIM_EXCHANGE_H

#include "counterlight/status.h"
#include "sim/visibility.h"

/* Elements, and the surfaces that they are parts of; nothing here is owned. */
typedef struct clt_parts {
  const clt_rectangle *surfaces, *elements;
  const int *surface; /* of each element */
  int surface_count, count;
  const clt_visibility *visibility; /* of the surfaces */
} clt_parts;

/* H: area_i times the form factor from element i to j, m^2, so that H_ij = H_ji. exchange: count^2 values,
 * column-major, of which those above the diagonal (row < column) are written. Elements of one surface, and pairs of
 * surfaces that do not face each other, exchange nothing and are not computed.
 *
 * Energy: no element sends more than all of its light. Where the room is closed (each element sees only fronts of
 * others), each sends exactly all: H is then scaled symmetrically, X H X, until every row sum is the element's area to
 * 1e-12. */
clt_status clt_exchange_compute(const clt_parts *parts, double *exchange, clt_error *error);

/* The fraction of CLT_SEGMENTS segments between elements i and j that nothing cuts. */
double clt_exchange_visible(const clt_parts *parts, int i, int j);
/* True where the room is closed: 64 rays from the middle of each element (of more than 8192 elements, of as many of
 * them) meet fronts only. */
bool clt_exchange_closed(const clt_parts *parts);

/* H_ij of any two elements. */
double clt_exchange_between(const double *exchange, int count, int i, int j);

#endif
