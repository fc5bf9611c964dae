/* Far light of least rank: from left right' the singular value decomposition, by the triangles of both factors.
 *
 * With W what the four functions of a leaf weigh (their norms over its cells), W left = Q1 R1, W right = Q2 R2 and
 * R1 R2' = U S V', far light is W^-1 Q1 U S V' Q2' W^-1. Singular values up to the tolerance are left out: they change
 * the appearance of a drive x by no more than that times ||x||. */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/hierarchy_tree.h"

typedef struct factors {
  size_t nodes, rank;
  double *left, *right, *weight; /* nodes x rank, column by column; nodes */
  double *tau[2], *triangle[2];
  double *core, *u, *v, *value; /* rank x rank, column by column; rank */
} factors;

static clt_status reserve(factors *of, size_t nodes, size_t rank, clt_error *error) {
  *of = (factors){.nodes = nodes, .rank = rank};
  double *tall = clt_alloc(2 * nodes * rank + nodes, sizeof *tall);
  double *small = clt_alloc(5 * rank * rank + 3 * rank, sizeof *small);
  if (tall == NULL || small == NULL) {
    free(tall);
    free(small);
    return clt_fail(error, CLT_FAILED, "no memory to compress far light of rank %zu", rank);
  }
  of->left = tall;
  of->right = tall + nodes * rank;
  of->weight = tall + 2 * nodes * rank;
  of->core = small;
  of->u = small + rank * rank;
  of->v = small + 2 * rank * rank;
  of->triangle[0] = small + 3 * rank * rank;
  of->triangle[1] = small + 4 * rank * rank;
  of->value = small + 5 * rank * rank;
  of->tau[0] = of->value + rank;
  of->tau[1] = of->value + 2 * rank;
  return CLT_OK;
}

static void release(factors *of) {
  free(of->left);
  free(of->core);
}

static void weigh(const clt_hierarchy_storage *own, double *weight) {
  for (size_t k = 0; k < own->leaves; k++) {
    const double cells = (double)own->leaf[k].width * own->leaf[k].height;
    const double norm[CLT_LEAF_TERMS] = {cells, cells / 3, cells / 3, cells / 9};
    for (size_t t = 0; t < CLT_LEAF_TERMS; t++) {
      weight[CLT_LEAF_TERMS * k + t] = sqrt(norm[t]);
    }
  }
}

/* matrix = W factor; becomes Q, its triangle R apart. */
static bool split(factors *of, const float *factor, double *matrix, double *tau, double *triangle) {
  const lapack_int nodes = (lapack_int)of->nodes, rank = (lapack_int)of->rank;
  for (size_t r = 0; r < of->rank; r++) {
    for (size_t m = 0; m < of->nodes; m++) {
      matrix[r * of->nodes + m] = of->weight[m] * (double)factor[m * of->rank + r];
    }
  }
  if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR, nodes, rank, matrix, nodes, tau) != 0) {
    return false;
  }
  memset(triangle, 0, of->rank * of->rank * sizeof *triangle);
  for (size_t r = 0; r < of->rank; r++) {
    memcpy(triangle + r * of->rank, matrix + r * of->nodes, (r + 1) * sizeof *triangle);
  }
  return LAPACKE_dorgqr(LAPACK_COL_MAJOR, nodes, rank, rank, matrix, nodes, tau) == 0;
}

static bool decompose(factors *of, const float *left, const float *right) {
  const lapack_int rank = (lapack_int)of->rank;
  if (!split(of, left, of->left, of->tau[0], of->triangle[0]) ||
      !split(of, right, of->right, of->tau[1], of->triangle[1])) {
    return false;
  }
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, rank, rank, rank, 1, of->triangle[0], rank, of->triangle[1],
              rank, 0, of->core, rank);
  return LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'A', rank, rank, of->core, rank, of->value, of->u, rank, of->v, rank) == 0;
}

/* How many singular values must stay. */
static size_t rank_needed(const factors *of, double tolerance) {
  size_t needed = of->rank;
  while (needed > 1 && of->value[needed - 1] <= tolerance) {
    needed--;
  }
  return needed;
}

/* out = W^-1 Q U (times the singular values), nodes x kept, row by row. */
static void write_factor(const factors *of, const double *q, bool left, size_t kept, double *room, float *out) {
  const blasint nodes = (blasint)of->nodes, rank = (blasint)of->rank;
  cblas_dgemm(CblasColMajor, CblasNoTrans, left ? CblasNoTrans : CblasTrans, nodes, (blasint)kept, rank, 1, q, nodes,
              left ? of->u : of->v, rank, 0, room, nodes);
  for (size_t m = 0; m < of->nodes; m++) {
    for (size_t r = 0; r < kept; r++) {
      out[m * kept + r] = (float)((left ? of->value[r] : 1) * room[r * of->nodes + m] / of->weight[m]);
    }
  }
}

/* The channels share the largest rank of any. */
static clt_status write_all(clt_hierarchy_storage *own, size_t channels, size_t kept, const factors *of,
                            clt_error *error) {
  const size_t each = of->nodes * kept;
  float *made = clt_alloc(2 * channels * each, sizeof *made);
  double *room = clt_alloc(each, sizeof *room);
  if (made == NULL || room == NULL) {
    free(made);
    free(room);
    return clt_fail(error, CLT_FAILED, "no memory to compress far light of rank %zu", of->rank);
  }
  for (size_t c = 0; c < channels; c++) {
    write_factor(&of[c], of[c].left, true, kept, room, made + c * each);
    write_factor(&of[c], of[c].right, false, kept, room, made + (channels + c) * each);
  }
  memcpy(own->left, made, channels * each * sizeof *made);
  memcpy(own->right, made + channels * each, channels * each * sizeof *made);
  own->rank = kept;
  free(made);
  free(room);
  return CLT_OK;
}

clt_status clt_leaves_compress(clt_hierarchy_storage *own, size_t channels, const double *tolerance, clt_error *error) {
  factors of[CLT_CHANNELS_MAX] = {{0}};
  const size_t nodes = CLT_LEAF_TERMS * own->leaves, rank = own->rank, whole = nodes * rank;
  size_t kept = 1;
  if (nodes < rank) {
    return CLT_OK;
  }
  clt_status status = CLT_OK;
  for (size_t c = 0; c < channels && status == CLT_OK; c++) {
    status = reserve(&of[c], nodes, rank, error);
    if (status == CLT_OK) {
      weigh(own, of[c].weight);
      status = decompose(&of[c], own->left + c * whole, own->right + c * whole)
                   ? CLT_OK
                   : clt_fail(error, CLT_FAILED, "far light of rank %zu has no singular values", rank);
    }
    const size_t needed = status == CLT_OK ? rank_needed(&of[c], tolerance[c]) : 1;
    kept = needed > kept ? needed : kept;
  }
  if (status == CLT_OK) {
    status = write_all(own, channels, kept, of, error);
  }
  for (size_t c = 0; c < channels; c++) {
    release(&of[c]);
  }
  return status;
}
