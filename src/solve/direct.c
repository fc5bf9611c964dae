/* A factor of S: Cholesky where the flux weights make S symmetric, else LU. */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "solve/matrix.h"
#include "solve/refine.h"

/* What symmetrising takes from S is at most this share of it; refinement gives it back. */
static const double RECIPROCAL = 1e-4;
static const double LEAST = 1e-8;    /* that one solve leaves of a single-precision T */
static const double SINGULAR = 1e15; /* a condition number that leaves no digit */

typedef struct factor {
  clt_matrix matrix;  /* its entries become the factor */
  lapack_int *pivots; /* of LU; unused by Cholesky */
  double *weight;     /* sqrt(w) of each listed cell */
  double *brief;      /* one vector over the listed cells */
  bool symmetric;
  double condition; /* estimate of ||M|| ||M^-1|| in the 1-norm, M the factored matrix */
} factor;

/* N = (W^-1/2 S W^1/2 + its transpose) / 2: unit diagonal, and as well conditioned as S is for fluxes. */
static void symmetrise(const clt_system *system, factor *of) {
  size_t n = of->matrix.count;
  double *entries = of->matrix.entries;
  for (size_t i = 0; i < n; i++) {
    of->weight[i] = sqrt(system->flux[of->matrix.cell[i]]);
  }
  for (size_t i = 0; i < n; i++) {
    for (size_t j = 0; j <= i; j++) {
      double ratio = of->weight[j] / of->weight[i];
      double mean = (entries[i * n + j] * ratio + entries[j * n + i] / ratio) / 2;
      entries[i * n + j] = entries[j * n + i] = mean;
    }
  }
}

static double condition_of(double reciprocal, lapack_int info) {
  return info == 0 && reciprocal > 0 ? 1 / reciprocal : INFINITY;
}

/* False where the symmetrised matrix is not positive definite; then the entries are lost. */
static bool factor_symmetric(factor *of) {
  lapack_int n = (lapack_int)of->matrix.count, lead = n > 0 ? n : 1;
  double *entries = of->matrix.entries, reciprocal = 0;
  double norm = LAPACKE_dlansy(LAPACK_COL_MAJOR, '1', 'U', n, entries, lead);
  if (LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', n, entries, lead) != 0) {
    return false;
  }
  lapack_int info = LAPACKE_dpocon(LAPACK_COL_MAJOR, 'U', n, entries, lead, norm, &reciprocal);
  of->condition = condition_of(reciprocal, info);
  return true;
}

/* The entries, row by row, are S' column by column; that is what is factored. */
static void factor_general(factor *of) {
  lapack_int n = (lapack_int)of->matrix.count, lead = n > 0 ? n : 1;
  double *entries = of->matrix.entries, reciprocal = 0;
  double norm = LAPACKE_dlange(LAPACK_COL_MAJOR, '1', n, n, entries, lead);
  lapack_int info = LAPACKE_dgetrf(LAPACK_COL_MAJOR, n, n, entries, lead, of->pivots);
  if (info == 0) {
    info = LAPACKE_dgecon(LAPACK_COL_MAJOR, '1', n, entries, lead, norm, &reciprocal);
  }
  of->condition = condition_of(reciprocal, info);
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  factor *of = *prepared = clt_alloc(1, sizeof *of);
  if (of == NULL) {
    return clt_fail(error, CLT_FAILED, "direct: not enough memory for a factor");
  }
  clt_status status = clt_matrix_init(&of->matrix, system, "direct", error);
  if (status != CLT_OK) {
    return status;
  }
  of->pivots = clt_alloc(of->matrix.count, sizeof *of->pivots);
  of->weight = clt_alloc(of->matrix.count, sizeof *of->weight);
  of->brief = clt_alloc(of->matrix.count, sizeof *of->brief);
  if (of->pivots == NULL || of->weight == NULL || of->brief == NULL) {
    return clt_fail(error, CLT_FAILED, "direct: not enough memory for vectors of %zu cells", of->matrix.count);
  }
  if (of->matrix.count > 0 && system->reciprocity <= RECIPROCAL) {
    symmetrise(system, of);
    of->symmetric = factor_symmetric(of);
    if (!of->symmetric) {
      clt_matrix_finish(&of->matrix);
      status = clt_matrix_init(&of->matrix, system, "direct", error);
    }
  }
  if (status == CLT_OK && of->matrix.count > 0 && !of->symmetric) {
    factor_general(of);
  }
  return status;
}

static void release(void *prepared) {
  factor *of = prepared;
  if (of == NULL) {
    return;
  }
  clt_matrix_finish(&of->matrix);
  free(of->pivots);
  free(of->weight);
  free(of->brief);
  free(of);
}

/* d = S^-1 r; of the symmetrised S, W^1/2 N^-1 W^-1/2 r. */
static void apply(void *context, const double *r, double *d) {
  factor *of = context;
  lapack_int n = (lapack_int)of->matrix.count;
  clt_matrix_gather(&of->matrix, r, of->brief);
  if (of->symmetric) {
    for (size_t i = 0; i < of->matrix.count; i++) {
      of->brief[i] /= of->weight[i];
    }
    LAPACKE_dpotrs_work(LAPACK_COL_MAJOR, 'U', n, 1, of->matrix.entries, n, of->brief, n);
    for (size_t i = 0; i < of->matrix.count; i++) {
      of->brief[i] *= of->weight[i];
    }
  } else {
    LAPACKE_dgetrs_work(LAPACK_COL_MAJOR, 'T', n, 1, of->matrix.entries, n, of->pivots, of->brief, n);
  }
  clt_matrix_scatter(&of->matrix, of->brief, d);
}

static clt_outcome run_direct(clt_system *system, clt_run *run) {
  factor *of = system->prepared;
  clt_inverse inverse = {.apply = apply, .context = of};
  if (!(of->condition < SINGULAR)) {
    clt_run_open(run, clt_system_residual(system, system->light, clt_system_vector(system, 0)));
    clt_run_note(run, "S is singular to working precision (condition number %.2g)", of->condition);
    return CLT_RUN_BROKE;
  }
  memset(clt_system_vector(system, 2), 0, system->cols * sizeof(double)); /* d at the cells that `apply` leaves */
  clt_outcome outcome = clt_refine(&inverse, system, run);
  if (outcome != CLT_RUN_BROKE) {
    clt_run_note(run, "%s, condition number %.2g", of->symmetric ? "Cholesky" : "LU", of->condition);
  }
  return outcome;
}

static void expect(clt_effort *effort) {
  double n = (double)effort->model->cells, cube = n * n * n;
  bool symmetric = effort->channel->reciprocity <= RECIPROCAL;
  clt_effort_steady(effort, symmetric ? fmax(effort->channel->reciprocity, LEAST) : LEAST);
  clt_effort_take(effort, 1, 1, 2 * n);
  clt_effort_prepare(effort, symmetric ? cube / 3 : 2 * cube / 3);
}

const clt_method clt_method_direct = {
    .name = "direct",
    .summary = "LAPACK's Cholesky factor of the flux-symmetrised S where it is reciprocal, LU elsewhere, refined by "
               "products with T; up to 12288 lit cells, at any albedo",
    .apart = true,
    .invests = true,
    .vectors = CLT_REFINE_VECTORS,
    .prepare = prepare,
    .release = release,
    .expect = expect,
    .run = run_direct,
};
