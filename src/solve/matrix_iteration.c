/* The matrix form of the report's iteration (Bai et al. 2010, eq. 45), X_k = I - R X_(k-1), X_0 = I, kept as A = I - X.
 *
 * X_k = sum_(j <= k) (-R)^j, so that I - S X_k = (-R)^(k+1), and since I - S X_k = X_(k+1) - X_k each step shows what
 * the one before it left. */
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "solve/matrix_iteration.h"
#include "solve/stored.h"

static const double SHARE = 0.5;    /* of the tolerance, for what the last term leaves */
static const double FINEST = 1e-13; /* what double holds */
static const double SHIFT = 0.05;   /* of the power iteration, relative to the radius */
enum { POWER_STEPS = 12, TERMS_MAX = 400, SPARE = 2, SPARE_TERMS = 5 };

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  if (channel->lit > 0 && channel->radius_low >= 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "matrix diverges here: rho(R) is in [%.3g, %.3g] and must be below 1; use direct or auto",
                    channel->radius_low, channel->radius_high);
  }
  return CLT_OK;
}

/* max (|R| x)_i / x_i >= rho(R) (Collatz-Wielandt), with x drawn towards the Perron vector. */
static double radius_bound(const double *r, size_t n, double *x, double *y) {
  double bound = INFINITY;
  for (size_t i = 0; i < n; i++) {
    x[i] = 1;
  }
  for (int step = 0; step < POWER_STEPS; step++) {
    double most = 0;
    for (size_t i = 0; i < n; i++) {
      y[i] = 0;
      for (size_t j = 0; j < n; j++) {
        y[i] += fabs(r[i * n + j]) * x[j];
      }
      most = fmax(most, y[i] / x[i]);
    }
    bound = fmin(bound, most);
    for (size_t i = 0; i < n && most > 0; i++) {
      x[i] = y[i] / most + SHIFT * x[i];
    }
  }
  return bound;
}

double clt_matrix_step(const double *r, const double *x, size_t n, double *next) {
  double squares = 0;
  memset(next, 0, n * n * sizeof *next);
  for (size_t i = 0; i < n; i++) {
    next[i * n + i] = 1;
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (blasint)n, (blasint)n, (blasint)n, -1, r, (blasint)n, x,
              (blasint)n, 1, next, (blasint)n);
  for (size_t i = 0; i < n * n; i++) {
    squares += (next[i] - x[i]) * (next[i] - x[i]);
  }
  return sqrt(squares);
}

/* The least k with radius^(k+1) <= wanted, and some to spare where R is far from normal. */
static int count_terms(double radius, double wanted) {
  double terms = radius > 0 && radius < 1 ? log(wanted) / log(radius) : radius > 0 ? TERMS_MAX : 1;
  return (int)fmin(SPARE * terms + SPARE_TERMS, TERMS_MAX);
}

/* Iterates until a step is at most `wanted`; its X takes the place of *next, and what it leaves that of *rest. */
static int iterate(const double *r, size_t n, int terms, double wanted, double **x, double **next, double *rest) {
  int k = 0;
  *rest = INFINITY;
  for (; k <= terms && *rest > wanted; k++) {
    *rest = clt_matrix_step(r, *x, n, *next);
    double *last = *x;
    *x = *next;
    *next = last;
  }
  return k;
}

/* X_k from R (in matrix->entries, which is used up), and of it A = I - X. */
static clt_status fill(clt_stored *stored, clt_matrix *matrix, double tolerance, clt_error *error) {
  clt_status status = clt_stored_init(stored, matrix, "matrix", error);
  size_t n = stored->count;
  double *next = clt_alloc(n * n, sizeof *next), *r = matrix->entries;
  stored->full = clt_alloc(n * n, sizeof *stored->full);
  if (status == CLT_OK && (next == NULL || stored->full == NULL)) {
    status = clt_fail(error, CLT_FAILED, "matrix: not enough memory for three matrices of %zu x %zu; use pcg or gmres",
                      n, n);
  }
  if (status == CLT_OK) {
    for (size_t i = 0; i < n; i++) {
      r[i * n + i] -= 1;
      stored->full[i * n + i] = 1;
    }
    double wanted = fmax(SHARE * tolerance, FINEST * sqrt((double)n)),
           radius = radius_bound(r, n, stored->in, stored->out);
    int terms = iterate(r, n, count_terms(radius, wanted), wanted, &stored->full, &next, &stored->rest);
    if (!(stored->rest < 1)) {
      status =
          clt_fail(error, CLT_BAD_INPUT,
                   "matrix diverges here: after %d terms it leaves %.2g of the target (rho(R) <= %.3g); use direct "
                   "or auto",
                   terms, stored->rest, radius);
    }
    for (size_t i = 0; i < n * n; i++) {
      stored->full[i] = (i % (n + 1) == 0 ? 1 : 0) - stored->full[i];
    }
  }
  free(next);
  return status;
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  clt_stored *stored = *prepared = clt_alloc(1, sizeof *stored);
  if (stored == NULL) {
    return clt_fail(error, CLT_FAILED, "matrix: not enough memory");
  }
  clt_matrix matrix = {0};
  clt_status status = clt_matrix_init(&matrix, system, "matrix", error);
  if (status == CLT_OK) {
    status = fill(stored, &matrix, system->tolerance, error);
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

/* A term is a product of matrices; terms until a step, in the Frobenius norm, is half of the tolerance. */
static void expect(clt_effort *effort) {
  double n = (double)effort->model->cells, radius = fmin(effort->channel->radius_high, 0.999);
  double terms = 1 + log(SHARE * effort->tolerance) / log(fmax(radius, 1e-6));
  clt_effort_steady(effort, effort->tolerance);
  clt_effort_take(effort, 1, 0, n);
  clt_effort_prepare(effort, 2 * n * n * n * fmin(terms, TERMS_MAX));
}

static clt_outcome run_matrix(clt_system *system, clt_run *run) {
  return clt_stored_run(system->prepared, system, run);
}

const clt_method clt_method_matrix = {
    .name = "matrix",
    .summary =
        "the report's iteration for the whole inverse, X = I - R X (eq. 45), made once; then one product a frame; "
        "where rho(R) < 1, up to 12288 lit cells",
    .apart = true,
    .invests = true,
    .vectors = CLT_REFINE_VECTORS,
    .check = check,
    .prepare = prepare,
    .release = release,
    .expect = expect,
    .run = run_matrix,
};
