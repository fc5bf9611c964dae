#include <math.h>

#include "solve/pcg.h"

/* For a Lambertian scene S W = M with W = diag(w), w the flux weights and M symmetric positive definite, diag(M) = w.
 * Conjugate gradients for M z = b, l = W z, preconditioned by diag(M), read with z written back as l:
 *
 *   r = b - S l,  y = W^-1 r,  rho = r' y = <r, r>
 *   p_z = y + beta p_z    =>   p = W p_z = r + beta p
 *   q = M p_z = S p,  alpha = rho / p_z' q = rho / <p, q>
 *
 * with <a, b> = a' W^-1 b: plain conjugate gradients on S in the inner product in which S is self-adjoint. The
 * recurrence keeps r = b - S l for any S, so what tells a wrong S is a curvature <p, S p> <= 0 or a residual that stops
 * falling; what tells rounding is a recomputed r that differs. */
static const double ROUNDING = 1e-13; /* a residual this small, relative to b, is all that double gives */
enum { RECOMPUTE_EVERY = 10, STALE_STEPS = 20, RESTARTS_MAX = 3 };

typedef struct cg {
  clt_system *system;
  const clt_flat_mode *flat; /* NULL: none is deflated */
  double *r, *p, *q, *inverse_flux, *best;
  double rho, norm, least;
  int since_least, since_true, restarts;
} cg;

static double weighted_dot(size_t count, const double *weight, const double *a, const double *b) {
  double sum = 0;
  for (size_t i = 0; i < count; i++) {
    sum += weight[i] * a[i] * b[i];
  }
  return sum;
}

/* With flat modes z (pcg.h) l starts with their part solved, and p keeps <S z, p> = 0:
 *
 *   l += z <z, r> / <z, S z>,  r -= S z <z, r> / <z, S z>        p -= z <S z, r> / <z, S z>
 *
 * Where S is self-adjoint <z, r> then stays 0; where it nearly is, what has come back is solved again after a step. */
static void solve_flat(cg *state) {
  for (int c = 0; state->flat != NULL && c < state->flat->channels; c++) {
    size_t count = state->flat->count, at = (size_t)c * count;
    const double *z = state->flat->z + at, *sz = state->flat->sz + at;
    double share = state->flat->inverse[c] * weighted_dot(count, state->inverse_flux + at, z, state->r + at);
    clt_add(count, share, z, state->system->light + at);
    clt_add(count, -share, sz, state->r + at);
  }
}

static void deflate(const cg *state) {
  for (int c = 0; state->flat != NULL && c < state->flat->channels; c++) {
    size_t count = state->flat->count, at = (size_t)c * count;
    const double *sz = state->flat->sz + at;
    double share = state->flat->inverse[c] * weighted_dot(count, state->inverse_flux + at, sz, state->r + at);
    clt_add(count, -share, state->flat->z + at, state->p + at);
  }
}

/* Starts over from l: r = b - S l, p = r. */
static void restart(cg *state) {
  clt_system *system = state->system;
  clt_system_residual(system, system->light, state->r);
  solve_flat(state);
  state->norm = clt_norm(system->cols, state->r);
  state->rho = weighted_dot(system->cols, state->inverse_flux, state->r, state->r);
  state->since_true = 0;
  clt_copy(system->cols, state->r, state->p);
  deflate(state);
}

static void begin(cg *state) {
  clt_system *system = state->system;
  state->r = clt_system_vector(system, 0);
  state->p = clt_system_vector(system, 1);
  state->q = clt_system_vector(system, 2);
  state->inverse_flux = clt_system_vector(system, 3);
  state->best = clt_system_vector(system, 4);
  for (size_t i = 0; i < system->cols; i++) {
    state->inverse_flux[i] = system->lit[i] ? 1 / system->flux[i] : 0;
  }
  restart(state);
  state->least = state->norm;
  clt_copy(system->cols, system->light, state->best);
}

/* One iteration; false where the operator is not positive definite. */
static bool iterate(cg *state, clt_run *run) {
  clt_system *system = state->system;
  clt_system_apply(system, state->p, state->q);
  double curvature = weighted_dot(system->cols, state->inverse_flux, state->p, state->q);
  if (!(curvature > 0) || !isfinite(curvature)) {
    clt_run_note(run, "it met a direction of curvature %.2g, so S is not positive definite", curvature);
    return false;
  }
  double alpha = state->rho / curvature, before = state->rho;
  clt_add(system->cols, alpha, state->p, system->light);
  clt_add(system->cols, -alpha, state->q, state->r);
  solve_flat(state);
  state->rho = weighted_dot(system->cols, state->inverse_flux, state->r, state->r);
  state->norm = clt_norm(system->cols, state->r);
  double beta = state->rho / before;
  for (size_t i = 0; i < system->cols; i++) {
    state->p[i] = state->r[i] + beta * state->p[i];
  }
  deflate(state);
  state->since_true++;
  return true;
}

/* Follows the least residual; false where it has not fallen for long. */
static bool makes_progress(cg *state, clt_run *run) {
  if (state->norm < 0.95 * state->least) {
    state->least = state->norm;
    state->since_least = 0;
    clt_copy(state->system->cols, state->system->light, state->best);
    return true;
  }
  if (++state->since_least < STALE_STEPS) {
    return true;
  }
  clt_run_note(run, "its residual stayed at %.2g for %d iterations", state->least / state->system->wanted_norm,
               STALE_STEPS);
  return false;
}

/* Replaces a recurrence that has lost b - S l to rounding; false where that keeps happening. */
static bool recompute(cg *state, clt_run *run, double target) {
  double told = state->norm;
  double real = clt_system_residual(state->system, state->system->light, state->q);
  state->since_true = 0;
  if (real <= 1.1 * told + 0.1 * target && !(told <= target && real > target)) {
    state->norm = real;
    return true;
  }
  if (++state->restarts > RESTARTS_MAX) {
    clt_run_note(run, "its residual was %.2g where the recurrence told %.2g", real, told);
    return false;
  }
  restart(state);
  return true;
}

clt_outcome clt_cg_run(clt_system *system, clt_run *run, const clt_flat_mode *flat) {
  cg state = {.system = system, .flat = flat};
  double target = clt_run_target(run, system);
  clt_outcome outcome = CLT_RUN_CONVERGED;
  begin(&state);
  clt_run_open(run, state.norm);
  while (state.norm > target) {
    if (!clt_run_may_go_on(run)) {
      outcome = CLT_RUN_STOPPED;
      break;
    }
    if (!iterate(&state, run)) {
      outcome = CLT_RUN_BROKE;
      break;
    }
    clt_run_count(run, state.norm);
    target = clt_run_target(run, system);
    bool due = state.norm <= target || state.since_true >= RECOMPUTE_EVERY;
    if (!makes_progress(&state, run) || (due && !recompute(&state, run, target))) {
      outcome = CLT_RUN_BROKE;
      break;
    }
  }
  if (outcome == CLT_RUN_CONVERGED) {
    return outcome;
  }
  clt_copy(system->cols, state.best, system->light);
  bool rounding = clt_system_residual(system, system->light, state.q) <= ROUNDING * system->wanted_norm;
  return rounding ? CLT_RUN_STOPPED : outcome;
}

static void expect(clt_effort *effort) {
  clt_effort_krylov(effort, false);
  clt_effort_take(effort, 3, 1, 8);
}

static clt_outcome run_pcg(clt_system *system, clt_run *run) {
  return clt_cg_run(system, run, NULL);
}

const clt_method clt_method_pcg = {
    .name = "pcg",
    .summary = "conjugate gradients in the flux-weighted inner product; the fastest where the scene is diffuse "
               "(reciprocity defect up to 0.1), at any albedo",
    .vectors = CLT_CG_VECTORS,
    .expect = expect,
    .run = run_pcg,
};
