/* Sparse matrices between cells and elements, for products of CLT_LANES vectors at once. */
#ifndef CLT_SIM_SPARSE_H
#define CLT_SIM_SPARSE_H

#include "sim/hierarchy.h"
#include "sim/weights.h"

/* Row i is column[k] with weight[k], start[i] <= k < start[i + 1]. */
typedef struct clt_sparse {
  int rows;
  int *start, *column;
  float *weight;
} clt_sparse;

/* The lists as a matrix of rows x columns, its columns numbered anew: place[old] = new. False where memory is short;
 * sparse was zeroed by the caller and is finished by it in either case. */
bool clt_sparse_init(clt_sparse *sparse, const clt_weights *lists, const int *place);
/* The transpose of a matrix of so many columns. As above. */
bool clt_sparse_transpose(const clt_sparse *of, int columns, clt_sparse *sparse);
void clt_sparse_finish(clt_sparse *sparse);
size_t clt_sparse_bytes(const clt_sparse *sparse);

/* out_i = factor_i sum over k of weight x[column]: one entry a row. factor: NULL for 1. The same for any number of
 * threads. */
void clt_sparse_product(const clt_sparse *sparse, const clt_lanes *x, const clt_lanes *factor, clt_lanes *out);

#endif
