#include "analysis/krylov.h"

#include <cblas.h>
#include <math.h>
#include <string.h>

/* The Hessenberg matrix of one cycle, made triangular by rotations as it grows, and the right-hand side with it. */
typedef struct cycle {
  double h[CLT_KRYLOV_STEPS + 1][CLT_KRYLOV_STEPS];
  double cosine[CLT_KRYLOV_STEPS], sine[CLT_KRYLOV_STEPS], rest[CLT_KRYLOV_STEPS + 1];
} cycle;

static double *basis_vector(const clt_krylov *krylov, size_t index) {
  return krylov->basis + index * krylov->count;
}

/* r = b - M v into the last basis vector; its norm. */
static double residual(const clt_krylov *krylov, const double *b, const double *v) {
  double *r = basis_vector(krylov, CLT_KRYLOV_VECTORS - 1);
  krylov->apply(krylov->context, v, r);
  for (size_t i = 0; i < krylov->count; i++) {
    r[i] = b[i] - r[i];
  }
  return cblas_dnrm2((int)krylov->count, r, 1);
}

/* q_(k+1) = M q_k less its parts along q_0..q_k (modified Gram-Schmidt). */
static void extend(const clt_krylov *krylov, cycle *state, size_t k) {
  int n = (int)krylov->count;
  double *next = basis_vector(krylov, k + 1);
  krylov->apply(krylov->context, basis_vector(krylov, k), next);
  for (size_t i = 0; i <= k; i++) {
    state->h[i][k] = cblas_ddot(n, next, 1, basis_vector(krylov, i), 1);
    cblas_daxpy(n, -state->h[i][k], basis_vector(krylov, i), 1, next, 1);
  }
  state->h[k + 1][k] = cblas_dnrm2(n, next, 1);
  if (state->h[k + 1][k] > 0) {
    cblas_dscal(n, 1 / state->h[k + 1][k], next, 1);
  }
}

/* Column k under the earlier rotations and one more, which makes h[k+1][k] 0; |rest[k+1]| is the residual's norm. */
static void rotate(cycle *state, size_t k) {
  for (size_t i = 0; i < k; i++) {
    double upper = state->h[i][k], lower = state->h[i + 1][k];
    state->h[i][k] = state->cosine[i] * upper + state->sine[i] * lower;
    state->h[i + 1][k] = state->cosine[i] * lower - state->sine[i] * upper;
  }
  double length = hypot(state->h[k][k], state->h[k + 1][k]);
  state->cosine[k] = length > 0 ? state->h[k][k] / length : 1;
  state->sine[k] = length > 0 ? state->h[k + 1][k] / length : 0;
  state->h[k][k] = length;
  state->rest[k + 1] = -state->sine[k] * state->rest[k];
  state->rest[k] *= state->cosine[k];
}

/* v += Q y, y from the triangle of the first `steps` columns. */
static void add_answer(const clt_krylov *krylov, cycle *state, size_t steps, double *v) {
  for (size_t k = steps; k-- > 0;) {
    double sum = state->rest[k];
    for (size_t j = k + 1; j < steps; j++) {
      sum -= state->h[k][j] * state->rest[j];
    }
    state->rest[k] = state->h[k][k] > 0 ? sum / state->h[k][k] : 0;
    cblas_daxpy((int)krylov->count, state->rest[k], basis_vector(krylov, k), 1, v, 1);
  }
}

/* One cycle from the residual of the given norm. */
static void improve(const clt_krylov *krylov, double norm, double target, double *v) {
  cycle state;
  size_t k = 0;
  const double *r = basis_vector(krylov, CLT_KRYLOV_VECTORS - 1);
  for (size_t i = 0; i < krylov->count; i++) {
    krylov->basis[i] = r[i] / norm;
  }
  state.rest[0] = norm;
  while (k < CLT_KRYLOV_STEPS && fabs(state.rest[k]) > target) {
    extend(krylov, &state, k);
    rotate(&state, k);
    k++;
  }
  add_answer(krylov, &state, k, v);
}

double clt_krylov_solve(const clt_krylov *krylov, const double *b, double tolerance, double *v) {
  double whole = cblas_dnrm2((int)krylov->count, b, 1);
  if (!(whole > 0)) {
    memset(v, 0, krylov->count * sizeof *v);
    return whole;
  }
  double norm = residual(krylov, b, v), before = INFINITY;
  while (norm > tolerance * whole && norm < 0.9 * before) {
    before = norm;
    improve(krylov, norm, tolerance * whole, v);
    norm = residual(krylov, b, v);
  }
  return norm / whole;
}
