#include "transport/hierarchy_share.h"

#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "counterlight/transport.h"

/* One side of all channels side by side, each column as long as its singular value over the tolerance: its singular
 * value decomposition by the eigenvectors of the Gram matrix. */
typedef struct stack {
  double *columns; /* nodes x all */
  double *vector;  /* all x all: eigenvectors, the largest eigenvalue first */
  double *length;  /* all: the singular values */
} stack;

typedef struct share {
  const clt_singular *of;
  size_t channels, nodes, all;
  const double *tolerance;
  size_t first[CLT_CHANNELS_MAX + 1]; /* column of each channel in the stacks, and how many there are in all */
  stack left, right;
  double *core; /* channels x all x all, column by column: C over the tolerance, at full rank */
  double *room; /* 2 x all */
} share;

static void count_columns(share *s) {
  for (size_t c = 0; c < s->channels; c++) {
    size_t count = 0;
    while (count < s->of[c].count && s->of[c].value[count] > s->tolerance[c]) {
      count++;
    }
    s->first[c + 1] = s->first[c] + count;
  }
  s->all = s->first[s->channels];
}

static double *reserve_stack(stack *of, size_t nodes, size_t all) {
  of->columns = clt_alloc(nodes * all + all * all + all, sizeof *of->columns);
  of->vector = of->columns + nodes * all;
  of->length = of->vector + all * all;
  return of->columns;
}

static void fill_stack(const share *s, bool left, stack *to) {
  for (size_t c = 0; c < s->channels; c++) {
    const double *from = left ? s->of[c].left : s->of[c].right;
    for (size_t k = s->first[c]; k < s->first[c + 1]; k++) {
      const double length = s->of[c].value[k - s->first[c]] / s->tolerance[c];
      for (size_t m = 0; m < s->nodes; m++) {
        to->columns[k * s->nodes + m] = length * from[(k - s->first[c]) * s->nodes + m];
      }
    }
  }
}

/* Eigenvectors come with the least eigenvalue first; they are turned round. */
static bool decompose(const share *s, stack *of) {
  const lapack_int all = (lapack_int)s->all, nodes = (lapack_int)s->nodes;
  cblas_dsyrk(CblasColMajor, CblasLower, CblasTrans, all, nodes, 1, of->columns, nodes, 0, of->vector, all);
  if (LAPACKE_dsyevd(LAPACK_COL_MAJOR, 'V', 'L', all, of->vector, all, of->length) != 0) {
    return false;
  }
  for (size_t k = 0; k < s->all; k++) {
    of->length[k] = sqrt(fmax(of->length[k], 0));
  }
  for (size_t k = 0; k < s->all / 2; k++) {
    const size_t other = s->all - 1 - k;
    const double length = of->length[k];
    of->length[k] = of->length[other];
    of->length[other] = length;
    cblas_dswap(all, of->vector + k * s->all, 1, of->vector + other * s->all, 1);
  }
  return true;
}

/* part = diag(length) vector_c', all x the channel's columns: what U'A is, or V'B. By weight: each column as much as
 * its singular value lies under the tolerance. */
static void project(const share *s, const stack *of, size_t c, bool weighed, double *part) {
  for (size_t k = s->first[c]; k < s->first[c + 1]; k++) {
    const double by = weighed ? s->tolerance[c] / s->of[c].value[k - s->first[c]] : 1;
    for (size_t i = 0; i < s->all; i++) {
      part[(k - s->first[c]) * s->all + i] = by * of->length[i] * of->vector[i * s->all + k];
    }
  }
}

/* C of every channel in both whole bases: U'A (tolerance / value) B'V with A and B the channel's part of the stacks. */
static bool make_cores(share *s) {
  const size_t all = s->all;
  double *part = clt_alloc(2 * all * all, sizeof *part);
  s->core = clt_alloc(s->channels * all, all * sizeof *s->core);
  s->room = clt_alloc(2 * all, sizeof *s->room);
  const bool made = part != NULL && s->core != NULL && s->room != NULL;
  for (size_t c = 0; made && c < s->channels; c++) {
    const blasint wide = (blasint)all, inner = (blasint)(s->first[c + 1] - s->first[c]);
    project(s, &s->left, c, false, part);
    project(s, &s->right, c, true, part + all * all);
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, wide, wide, inner, 1, part, wide, part + all * all, wide, 0,
                s->core + c * all * all, wide);
  }
  free(part);
  return made;
}

/* out = N in, or N' in, N the channel's C without its first rank rows and columns. */
static void apply_rest(const share *s, size_t c, size_t rank, bool transposed, const double *in, double *out) {
  const blasint all = (blasint)s->all, kept = (blasint)rank;
  const enum CBLAS_TRANSPOSE turn = transposed ? CblasTrans : CblasNoTrans;
  const double *core = s->core + c * s->all * s->all;
  cblas_dgemv(CblasColMajor, turn, all, all, 1, core, all, in, 1, 0, out, 1);
  cblas_dgemv(CblasColMajor, turn, kept, kept, -1, core, all, in, 1, 1, out, 1);
}

/* Whether what is left out of every channel at this rank is within the tolerance: the norm of N by power iteration. */
static bool is_enough(const share *s, size_t rank) {
  enum { ROUNDS = 20 };
  double *x = s->room, *y = s->room + s->all;
  for (size_t c = 0; c < s->channels; c++) {
    double norm = 0;
    for (size_t k = 0; k < s->all; k++) {
      x[k] = (k + rank) % 2 == 0 ? 1 : 0.5;
    }
    for (int round = 0; round < ROUNDS; round++) {
      cblas_dscal((blasint)s->all, 1 / fmax(cblas_dnrm2((blasint)s->all, x, 1), 1e-300), x, 1);
      apply_rest(s, c, rank, false, x, y);
      norm = cblas_dnrm2((blasint)s->all, y, 1);
      apply_rest(s, c, rank, true, y, x);
    }
    if (norm > 1) {
      return false;
    }
  }
  return true;
}

/* The least rank by halving; 0 where `most` is not enough. */
static size_t find_rank(const share *s, size_t step, size_t most) {
  size_t low = 0, high = (most < s->all ? most : s->all) / step;
  if (high == 0 || !is_enough(s, high * step)) {
    return 0;
  }
  while (high - low > 1) {
    const size_t middle = (low + high) / 2;
    if (is_enough(s, middle * step)) {
      high = middle;
    } else {
      low = middle;
    }
  }
  return high * step;
}

/* to = the first columns of the basis: columns vector / length. */
static void write_basis(const share *s, const stack *from, size_t rank, double *to) {
  const blasint nodes = (blasint)s->nodes, all = (blasint)s->all;
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, nodes, (blasint)rank, all, 1, from->columns, nodes,
              from->vector, all, 0, to, nodes);
  for (size_t k = 0; k < rank; k++) {
    cblas_dscal(nodes, from->length[k] > 0 ? 1 / from->length[k] : 0, to + k * s->nodes, 1);
  }
}

static bool write_shared(const share *s, clt_shared *out) {
  const size_t rank = out->rank;
  out->left = clt_alloc(2 * s->nodes * rank, sizeof *out->left);
  out->core = clt_alloc(s->channels * rank, rank * sizeof *out->core);
  if (out->left == NULL || out->core == NULL) {
    return false;
  }
  out->right = out->left + s->nodes * rank;
  write_basis(s, &s->left, rank, out->left);
  write_basis(s, &s->right, rank, out->right);
  for (size_t at = 0; at < s->channels * rank * rank; at++) {
    const size_t c = at / (rank * rank), row = at / rank % rank, column = at % rank;
    out->core[at] = (float)(s->tolerance[c] * s->core[(c * s->all + column) * s->all + row]);
  }
  return true;
}

static bool run(share *s, size_t step, size_t most, clt_shared *out) {
  if (reserve_stack(&s->left, s->nodes, s->all) == NULL || reserve_stack(&s->right, s->nodes, s->all) == NULL) {
    return false;
  }
  fill_stack(s, true, &s->left);
  fill_stack(s, false, &s->right);
  if (!decompose(s, &s->left) || !decompose(s, &s->right) || !make_cores(s)) {
    return false;
  }
  out->rank = find_rank(s, step, most);
  return out->rank == 0 || write_shared(s, out);
}

clt_status clt_singular_share(const clt_singular *of, size_t channels, const double *tolerance, size_t step,
                              size_t most, clt_shared *out, clt_error *error) {
  share s = {.of = of, .channels = channels, .nodes = of[0].nodes, .tolerance = tolerance};
  *out = (clt_shared){0};
  count_columns(&s);
  if (s.all < step || most < step) {
    return CLT_OK;
  }
  const bool done = run(&s, step, most, out);
  free(s.left.columns);
  free(s.right.columns);
  free(s.core);
  free(s.room);
  return done ? CLT_OK
              : clt_fail(error, CLT_FAILED,
                         "far light that %zu channels share was not found: no memory, or no singular values", channels);
}

void clt_shared_finish(clt_shared *shared) {
  free(shared->left);
  free(shared->core);
  *shared = (clt_shared){0};
}
