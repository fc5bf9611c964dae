/* H, the diffuse exchange of light between many elements, as a hierarchical matrix.
 *
 * Far blocks share nested bases (an H2 matrix: Hackbusch, Khoromskij, Sauter 2000; interpolated: Börm 2010): element e
 * of a leaf has the weights V_ea = integral over e of the Lagrange polynomial of node a, a parent's polynomials are
 * sums of its children's, and a block is the kernel between nodes. A product gathers V' x up the trees, exchanges
 * between clusters and spreads back down: memory and time grow linearly with the elements. Near blocks are exact form
 * factors between elements. */
#ifndef CLT_SIM_HIERARCHY_H
#define CLT_SIM_HIERARCHY_H

#include <stddef.h>

#include "sim/exchange.h"

/* One value for each of four products that are done at once. */
enum { CLT_LANES = 4 };
typedef float clt_lanes __attribute__((vector_size(16)));

typedef struct clt_hierarchy clt_hierarchy;

/* What it consists of. */
typedef struct clt_hierarchy_size {
  size_t elements, clusters;
  size_t far_blocks, near_blocks;
  size_t bytes;
} clt_hierarchy_size;

/* Computes H of the parts, which are read here only: row sums are scaled in a closed room and limited in an open one as
 * clt_exchange_compute does, to the precision of float. tolerance: wanted error of a product with a positive vector,
 * relative, 1e-6..1e-1. The same for any number of threads. */
clt_status clt_hierarchy_create(const clt_parts *parts, double tolerance, clt_hierarchy **out, clt_error *error);
void clt_hierarchy_destroy(clt_hierarchy *hierarchy); /* accepts NULL */

clt_hierarchy_size clt_hierarchy_measure(const clt_hierarchy *hierarchy);
/* Whether no two elements exchange anything. */
bool clt_hierarchy_is_empty(const clt_hierarchy *hierarchy);
/* The element of the parts that stands at each place of a product's vectors. */
const int *clt_hierarchy_order(const clt_hierarchy *hierarchy);

/* Values of work space that a product needs. */
size_t clt_hierarchy_work(const clt_hierarchy *hierarchy);
/* y = H x: one entry for each element, in the hierarchy's order. Each lane is a product of its own. work:
 * clt_hierarchy_work entries, used by one product at a time. The same for any number of threads. */
void clt_hierarchy_product(const clt_hierarchy *hierarchy, const clt_lanes *x, clt_lanes *y, clt_lanes *work);

#endif
