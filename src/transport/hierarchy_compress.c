/* Far light of least rank: from left right' the singular value decomposition, by the triangles of both factors.
 *
 * With W what the four functions of a leaf weigh (their norms over its cells), W left = Q1 R1, W right = Q2 R2 and
 * R1 R2' = U S V', far light is W^-1 Q1 U S V' Q2' W^-1. Singular values up to the tolerance are left out: they change
 * the appearance of a drive x by no more than that times ||x||. Channels share their factors where that takes less room
 * (hierarchy_share.h). */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/hierarchy_share.h"
#include "transport/hierarchy_tree.h"

static const double SMALLER = 2.0 / 3; /* than without: what channels share must be */

/* The decomposition of one channel under way. */
typedef struct work {
  const clt_hierarchy_storage *own;
  size_t nodes, rank;
  double *weight;            /* nodes */
  double *room;              /* nodes x rank */
  double *tau, *triangle[2]; /* rank; rank x rank, column by column */
  double *core, *u, *v;      /* the same */
} work;

static clt_status fail(size_t rank, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "no memory to compress far light of rank %zu", rank);
}

static bool reserve(work *job, const clt_hierarchy_storage *own) {
  const size_t nodes = CLT_LEAF_TERMS * own->leaves, rank = own->rank, square = rank * rank;
  *job = (work){.own = own, .nodes = nodes, .rank = rank};
  job->weight = clt_alloc(nodes + nodes * rank + rank + 5 * square, sizeof *job->weight);
  job->room = job->weight + nodes;
  job->tau = job->room + nodes * rank;
  job->triangle[0] = job->tau + rank;
  job->triangle[1] = job->triangle[0] + square;
  job->core = job->triangle[1] + square;
  job->u = job->core + square;
  job->v = job->u + square;
  return job->weight != NULL;
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
static bool split(work *job, const float *factor, double *matrix, double *triangle) {
  const lapack_int nodes = (lapack_int)job->nodes, rank = (lapack_int)job->rank;
  for (size_t r = 0; r < job->rank; r++) {
    for (size_t m = 0; m < job->nodes; m++) {
      matrix[r * job->nodes + m] = job->weight[m] * (double)factor[m * job->rank + r];
    }
  }
  if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR, nodes, rank, matrix, nodes, job->tau) != 0) {
    return false;
  }
  memset(triangle, 0, job->rank * job->rank * sizeof *triangle);
  for (size_t r = 0; r < job->rank; r++) {
    memcpy(triangle + r * job->rank, matrix + r * job->nodes, (r + 1) * sizeof *triangle);
  }
  return LAPACKE_dorgqr(LAPACK_COL_MAJOR, nodes, rank, rank, matrix, nodes, job->tau) == 0;
}

/* q becomes q turn, or q turn'. */
static void turn_basis(const work *job, const double *turn, bool transposed, double *q) {
  const blasint nodes = (blasint)job->nodes, rank = (blasint)job->rank;
  cblas_dgemm(CblasColMajor, CblasNoTrans, transposed ? CblasTrans : CblasNoTrans, nodes, rank, rank, 1, q, nodes, turn,
              rank, 0, job->room, nodes);
  memcpy(q, job->room, job->nodes * job->rank * sizeof *q);
}

static bool decompose(work *job, size_t channel, clt_singular *of) {
  const lapack_int rank = (lapack_int)job->rank;
  const size_t whole = channel * job->nodes * job->rank;
  if (!split(job, job->own->left.value + whole, of->left, job->triangle[0]) ||
      !split(job, job->own->right.value + whole, of->right, job->triangle[1])) {
    return false;
  }
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, rank, rank, rank, 1, job->triangle[0], rank, job->triangle[1],
              rank, 0, job->core, rank);
  if (LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'A', rank, rank, job->core, rank, of->value, job->u, rank, job->v, rank) != 0) {
    return false;
  }
  turn_basis(job, job->u, false, of->left);
  turn_basis(job, job->v, true, of->right);
  return true;
}

/* How many singular values must stay; a whole number of steps where there are so many. */
static size_t rank_needed(const clt_singular *of, double tolerance) {
  size_t needed = of->count;
  while (needed > 1 && of->value[needed - 1] <= tolerance) {
    needed--;
  }
  const size_t whole = (needed + CLT_RANK_STEP - 1) / CLT_RANK_STEP * CLT_RANK_STEP;
  return whole < of->count ? whole : of->count;
}

/* Rows = W^-1 columns, each times its length (NULL: 1). */
static void write_rows(const work *job, const double *columns, const double *length, size_t rank, float *rows) {
  for (size_t m = 0; m < job->nodes; m++) {
    for (size_t r = 0; r < rank; r++) {
      rows[m * rank + r] = (float)((length != NULL ? length[r] : 1) * columns[r * job->nodes + m] / job->weight[m]);
    }
  }
}

/* Rows of `rank` numbers in place of those that were there. */
static clt_status begin_rows(clt_hierarchy_storage *own, size_t sets, size_t rank, clt_error *error) {
  clt_leaf_rows_finish(&own->left);
  clt_leaf_rows_finish(&own->right);
  own->rank = rank;
  return clt_leaf_rows_reserve(&own->left, 32, sets, own->leaves, rank) &&
                 clt_leaf_rows_reserve(&own->right, 32, sets, own->leaves, rank)
             ? CLT_OK
             : fail(rank, error);
}

/* Each channel's own; they have the largest rank of any. */
static clt_status write_each(const work *job, clt_hierarchy_storage *own, const clt_singular *of, size_t channels,
                             size_t rank, clt_error *error) {
  const clt_status status = begin_rows(own, channels, rank, error);
  for (size_t c = 0; status == CLT_OK && c < channels; c++) {
    write_rows(job, of[c].left, of[c].value, rank, own->left.value + c * job->nodes * rank);
    write_rows(job, of[c].right, NULL, rank, own->right.value + c * job->nodes * rank);
  }
  return status;
}

static clt_status write_shared(const work *job, clt_hierarchy_storage *own, clt_shared *shared, clt_error *error) {
  const clt_status status = begin_rows(own, 1, shared->rank, error);
  if (status == CLT_OK) {
    write_rows(job, shared->left, NULL, shared->rank, own->left.value);
    write_rows(job, shared->right, NULL, shared->rank, own->right.value);
    own->core = shared->core;
    shared->core = NULL;
  }
  return status;
}

/* The largest rank with which shared factors are so much smaller: 2 nodes k + channels k^2 numbers. */
static size_t rank_worth(size_t nodes, size_t channels, size_t rank) {
  const double each = 2 * (double)channels * (double)nodes * (double)rank, half = (double)nodes / (double)channels;
  return channels > 1 ? (size_t)(sqrt(half * half + SMALLER * each / (double)channels) - half) : 0;
}

static clt_status write_all(const work *job, clt_hierarchy_storage *own, const clt_singular *of, size_t channels,
                            const double *tolerance, clt_error *error) {
  size_t rank = 1;
  for (size_t c = 0; c < channels; c++) {
    const size_t needed = rank_needed(&of[c], tolerance[c]);
    rank = needed > rank ? needed : rank;
  }
  clt_shared shared;
  clt_status status = clt_singular_share(of, channels, tolerance, CLT_RANK_STEP, rank_worth(job->nodes, channels, rank),
                                         &shared, error);
  if (status == CLT_OK) {
    status = shared.rank > 0 ? write_shared(job, own, &shared, error) : write_each(job, own, of, channels, rank, error);
  }
  clt_shared_finish(&shared);
  return status;
}

static clt_status decompose_all(work *job, clt_singular *of, size_t channels, clt_error *error) {
  const size_t whole = job->nodes * job->rank;
  weigh(job->own, job->weight);
  for (size_t c = 0; c < channels; c++) {
    double *tall = clt_alloc(2 * whole + job->rank, sizeof *tall);
    of[c] = (clt_singular){job->nodes, job->rank, tall, tall + whole, tall + 2 * whole};
    if (tall == NULL) {
      return fail(job->rank, error);
    }
    if (!decompose(job, c, &of[c])) {
      return clt_fail(error, CLT_FAILED, "far light of rank %zu has no singular values", job->rank);
    }
  }
  return CLT_OK;
}

clt_status clt_leaves_compress(clt_hierarchy_storage *own, size_t channels, const double *tolerance, clt_error *error) {
  if (CLT_LEAF_TERMS * own->leaves < own->rank) {
    return CLT_OK;
  }
  clt_singular of[CLT_CHANNELS_MAX] = {{0}};
  work job;
  clt_status status = reserve(&job, own) ? CLT_OK : fail(own->rank, error);
  if (status == CLT_OK) {
    status = decompose_all(&job, of, channels, error);
  }
  if (status == CLT_OK) {
    status = write_all(&job, own, of, channels, tolerance, error);
  }
  for (size_t c = 0; c < channels; c++) {
    free(of[c].left);
  }
  free(job.weight);
  return status;
}
