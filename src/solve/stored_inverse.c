/* A = I - S^-1 made once, in single precision. */
#include <float.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "solve/stored.h"

/* X = S^-1 by LU in place of the entries: stored row by row they are S' column by column, and so is the inverse. */
static clt_status invert(clt_matrix *matrix, clt_error *error) {
  lapack_int n = (lapack_int)matrix->count, info = 0;
  lapack_int *pivots = clt_alloc(matrix->count, sizeof *pivots);
  if (pivots == NULL) {
    return clt_fail(error, CLT_FAILED, "stored-inverse: not enough memory for %zu pivots", matrix->count);
  }
  if (n > 0) {
    info = LAPACKE_dgetrf(LAPACK_COL_MAJOR, n, n, matrix->entries, n, pivots);
  }
  if (n > 0 && info == 0) {
    info = LAPACKE_dgetri(LAPACK_COL_MAJOR, n, matrix->entries, n, pivots);
  }
  free(pivots);
  return info == 0 ? CLT_OK
                   : clt_fail(error, CLT_BAD_INPUT,
                              "stored-inverse: S has no inverse (pivot %d is 0); use lsmr or auto", (int)info);
}

/* Rounds A. Its rounding E has ||E|| <= u ||A||_F with u = 2^-24, so that ||I - S X|| = ||S E|| <= ||S|| u ||A||_F, to
 * which LU and the product add some N eps ||S|| ||X||. */
static void round_entries(clt_stored *stored, const clt_matrix *matrix, double size) {
  size_t n = stored->count;
  double squares = 0, inverse_squares = 0;
  for (size_t i = 0; i < n; i++) {
    for (size_t j = 0; j < n; j++) {
      double x = matrix->entries[i * n + j], a = (i == j ? 1 : 0) - x;
      stored->single[i * n + j] = (float)a;
      squares += a * a;
      inverse_squares += x * x;
    }
  }
  stored->rest = size * (FLT_EPSILON / 2 * sqrt(squares) + (double)n * DBL_EPSILON * sqrt(inverse_squares));
}

static clt_status fill(clt_stored *stored, clt_matrix *matrix, clt_error *error) {
  clt_status status = clt_stored_init(stored, matrix, "stored-inverse", error);
  if (status != CLT_OK) {
    return status;
  }
  double size = clt_norm_bound(matrix->entries, matrix->count, stored->in);
  status = invert(matrix, error);
  if (status != CLT_OK) {
    return status;
  }
  stored->single = clt_alloc(matrix->count * matrix->count, sizeof *stored->single);
  if (stored->single == NULL) {
    return clt_fail(error, CLT_FAILED, "stored-inverse: not enough memory for %zu x %zu entries; use pcg or gmres",
                    matrix->count, matrix->count);
  }
  round_entries(stored, matrix, size);
  return CLT_OK;
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  clt_stored *stored = *prepared = clt_alloc(1, sizeof *stored);
  if (stored == NULL) {
    return clt_fail(error, CLT_FAILED, "stored-inverse: not enough memory");
  }
  clt_matrix matrix = {0};
  clt_status status = clt_matrix_init(&matrix, system, "stored-inverse", error);
  if (status == CLT_OK) {
    status = fill(stored, &matrix, error);
  }
  clt_matrix_finish(&matrix);
  return status;
}

static void release(void *prepared) {
  if (prepared != NULL) {
    clt_stored_finish(prepared);
    free(prepared);
  }
}

/* A's rounding leaves 2^-24 of it, times what S makes of that. */
static void expect(clt_effort *effort) {
  double n = (double)effort->model->cells, size = 1 + effort->channel->norm_high;
  clt_effort_steady(effort, fmin(size * FLT_EPSILON * size, 0.1));
  clt_effort_take(effort, 1, effort->iterations > 1, n / 2);
  clt_effort_prepare(effort, 2 * n * n * n);
}

static clt_outcome run_stored(clt_system *system, clt_run *run) {
  return clt_stored_run(system->prepared, system, run);
}

const clt_method clt_method_stored_inverse = {
    .name = "stored-inverse",
    .summary =
        "A = I - S^-1 kept in single precision: one product a frame down to about 1e-5, refined by products with "
        "T below; up to 12288 lit cells",
    .apart = true,
    .invests = true,
    .vectors = CLT_REFINE_VECTORS,
    .prepare = prepare,
    .release = release,
    .expect = expect,
    .run = run_stored,
};
