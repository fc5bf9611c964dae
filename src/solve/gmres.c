#include <math.h>

#include "solve/method.h"

static const double STALE_FACTOR = 0.9; /* a cycle that leaves more than this of the residual gains nothing */
static const double LITTLE = 0.1;       /* of a vector: what is left of it may have lost a digit of its orthogonality */
enum { STALE_CYCLES = 2 };

/* The least-squares problem min ||norm e_1 - H y|| of a cycle, H reduced to triangular by Givens rotations. */
typedef struct triangle {
  double h[CLT_GMRES_STEPS][CLT_GMRES_STEPS + 1]; /* column k of H */
  double cosine[CLT_GMRES_STEPS], sine[CLT_GMRES_STEPS];
  double rest[CLT_GMRES_STEPS + 1]; /* the rotated right side; |rest[k]| is the residual after k steps */
} triangle;

static double *basis_vector(const clt_gmres *gmres, int index) {
  return gmres->basis + (size_t)index * gmres->stride;
}

/* v_(k+1) = A v_k made orthogonal to v_0..v_k: modified Gram-Schmidt, and once more where little is left, so that it
 * stays so in double. */
static double extend_basis(const clt_gmres *gmres, int k, double *column) {
  double *next = basis_vector(gmres, k + 1);
  gmres->apply(gmres->context, basis_vector(gmres, k), next);
  for (int i = 0; i <= k; i++) {
    column[i] = 0;
  }
  double before = 0, left = clt_norm(gmres->count, next);
  for (int pass = 0; pass < 2 && (pass == 0 || left < LITTLE * before); pass++) {
    before = left;
    for (int i = 0; i <= k; i++) {
      double part = clt_dot(gmres->count, basis_vector(gmres, i), next);
      clt_add(gmres->count, -part, basis_vector(gmres, i), next);
      column[i] += part;
    }
    left = clt_norm(gmres->count, next);
  }
  return column[k + 1] = left;
}

static void rotate(triangle *t, int k) {
  double *column = t->h[k];
  for (int i = 0; i < k; i++) {
    double upper = t->cosine[i] * column[i] + t->sine[i] * column[i + 1];
    column[i + 1] = t->cosine[i] * column[i + 1] - t->sine[i] * column[i];
    column[i] = upper;
  }
  double length = hypot(column[k], column[k + 1]);
  t->cosine[k] = length > 0 ? column[k] / length : 1;
  t->sine[k] = length > 0 ? column[k + 1] / length : 0;
  column[k] = length;
  t->rest[k + 1] = -t->sine[k] * t->rest[k];
  t->rest[k] *= t->cosine[k];
}

/* x += V y with H y = rest; directions that A annihilates (a zero on the diagonal) are left out. */
static void add_solution(const clt_gmres *gmres, const triangle *t, int steps, double *x) {
  double y[CLT_GMRES_STEPS];
  for (int k = steps - 1; k >= 0; k--) {
    double value = t->rest[k];
    for (int j = k + 1; j < steps; j++) {
      value -= t->h[j][k] * y[j];
    }
    y[k] = fabs(t->h[k][k]) > 1e-14 * fabs(t->h[0][0]) ? value / t->h[k][k] : 0;
  }
  for (int k = 0; k < steps; k++) {
    clt_add(gmres->count, y[k], basis_vector(gmres, k), x);
  }
}

void clt_gmres_cycle(const clt_gmres *gmres, clt_run *run, const double *r, double norm, double *x) {
  triangle t;
  int k = 0;
  t.rest[0] = norm;
  double *first = basis_vector(gmres, 0);
  for (size_t i = 0; i < gmres->count; i++) {
    first[i] = r[i] / norm;
  }
  while (k < CLT_GMRES_STEPS && fabs(t.rest[k]) > gmres->target && clt_run_may_go_on(run)) {
    double length = extend_basis(gmres, k, t.h[k]);
    double before = clt_norm((size_t)k + 2, t.h[k]);
    rotate(&t, k);
    clt_run_count(run, fabs(t.rest[++k]));
    if (!(length > 1e-14 * before)) {
      break; /* the Krylov space is complete */
    }
    double *next = basis_vector(gmres, k);
    for (size_t i = 0; i < gmres->count; i++) {
      next[i] *= 1 / length;
    }
  }
  add_solution(gmres, &t, k, x);
}

static void apply_system(void *context, const double *in, double *out) {
  clt_system_apply(context, in, out);
}

static clt_outcome run_gmres(clt_system *system, clt_run *run) {
  double *r = clt_system_vector(system, CLT_GMRES_VECTORS);
  clt_gmres gmres = {.apply = apply_system,
                     .context = system,
                     .count = system->cols,
                     .basis = clt_system_vector(system, 0),
                     .stride = system->stride,
                     .target = clt_run_target(run, system)};
  double norm = clt_system_residual(system, system->light, r);
  clt_run_open(run, norm);
  int stale = 0;
  while (norm > gmres.target) {
    if (!clt_run_may_go_on(run) || stale == STALE_CYCLES) {
      return CLT_RUN_STOPPED;
    }
    double before = norm;
    clt_gmres_cycle(&gmres, run, r, norm, system->light);
    norm = clt_system_residual(system, system->light, r);
    gmres.target = clt_run_target(run, system);
    stale = norm > STALE_FACTOR * before ? stale + 1 : 0;
  }
  return CLT_RUN_CONVERGED;
}

/* Gram-Schmidt goes over the basis four times a step, and the basis grows. */
static void expect(clt_effort *effort) {
  clt_effort_krylov(effort, true);
  clt_effort_take(effort, 3, 1, 2.0 * fmin(effort->iterations, CLT_GMRES_STEPS) + 4);
}

const clt_method clt_method_gmres = {
    .name = "gmres",
    .summary = "restarted GMRES; needs no symmetry, so it serves gloss, mirrors and noisy transports",
    .vectors = CLT_GMRES_VECTORS + 1,
    .expect = expect,
    .run = run_gmres,
};
