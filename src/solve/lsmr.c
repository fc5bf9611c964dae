/* LSMR (Fong & Saunders 2011): min ||b - T x|| by Golub-Kahan bidiagonalisation, equal to MINRES on T'T x = T'b.
 *
 *   beta u = T v - alpha u,  alpha v = T' u - beta v
 *
 * and two plane rotations a step; ||T' r|| falls in every step and is |zeta_bar|. The unknown is the drive x and not l
 * = F x, so that from x = 0 the answer of least ||x|| is found where there are many: duplicate columns share evenly.
 * The names are the paper's; the residual is carried as a vector by the products T v that are there anyway. */
#include <math.h>

#include "solve/iterate.h"

static const double LEAST_SQUARES = 1e-2; /* times the tolerance: ||T' r|| / (||T|| ||r||) of an optimum */
static const double LEAST_FLOOR = 1e-14;  /* that double reaches */

typedef struct lsmr {
  clt_system *system;
  double *u, *v, *h, *h_bar;    /* as in the paper */
  double *tv, *th, *th_bar, *r; /* T v, T h, T h_bar, and b - T x */
  double *tu, *x, *l;           /* T' u; the drive; what a product is taken of, in light */
  double alpha, beta, alpha_bar, zeta_bar, rho, rho_bar, c_bar, s_bar;
  double turn;    /* the factor that h was made with */
  double squares; /* sum of alpha^2 + beta^2: an estimate of ||T||_F^2 */
} lsmr;

enum { LSMR_VECTORS = 11 };

/* out = T in, of a drive */
static void apply(const lsmr *state, const double *in, double *out) {
  clt_system *system = state->system;
  for (size_t j = 0; j < system->cols; j++) {
    state->l[j] = system->lit[j] ? system->first_bounce[j] * in[j] : 0;
  }
  clt_system_apply(system, state->l, out);
}

/* out = T' in */
static void apply_transposed(const lsmr *state, const double *in, double *out) {
  clt_system *system = state->system;
  clt_system_apply_transposed(system, in, out);
  for (size_t j = 0; j < system->cols; j++) {
    out[j] = system->lit[j] ? system->first_bounce[j] * out[j] : 0;
  }
}

static double normalise(size_t count, double *values) {
  double norm = clt_norm(count, values);
  if (norm > 0) {
    cblas_dscal((blasint)count, 1 / norm, values, 1);
  }
  return norm;
}

/* The first vectors, from the residual of x. */
static void begin(lsmr *state) {
  size_t rows = state->system->rows, cols = state->system->cols;
  clt_copy(rows, state->r, state->u);
  state->beta = normalise(rows, state->u);
  apply_transposed(state, state->u, state->v);
  state->alpha = normalise(cols, state->v);
  state->alpha_bar = state->alpha;
  state->zeta_bar = state->alpha * state->beta;
  state->rho = state->rho_bar = state->c_bar = 1;
  state->s_bar = state->turn = 0;
  state->squares = state->alpha * state->alpha;
  clt_copy(cols, state->v, state->h);
  memset(state->h_bar, 0, cols * sizeof(double));
  memset(state->th, 0, rows * sizeof(double));
  memset(state->th_bar, 0, rows * sizeof(double));
}

/* vector <- add + factor vector */
static void fade_and_add(size_t count, double factor, const double *add, double *vector) {
  for (size_t i = 0; i < count; i++) {
    vector[i] = add[i] + factor * vector[i];
  }
}

/* The next beta, u, alpha and v. */
static void bidiagonalise(lsmr *state) {
  size_t rows = state->system->rows, cols = state->system->cols;
  apply(state, state->v, state->tv);
  fade_and_add(rows, -state->alpha, state->tv, state->u);
  state->beta = normalise(rows, state->u);
  apply_transposed(state, state->u, state->tu);
  fade_and_add(cols, -state->beta, state->tu, state->v);
  state->alpha = normalise(cols, state->v);
  state->squares += state->alpha * state->alpha + state->beta * state->beta;
}

/* One step of both rotations; false where the Krylov space holds no better answer. */
static bool iterate(lsmr *state) {
  size_t rows = state->system->rows, cols = state->system->cols;
  double rho_before = state->rho, rho_bar_before = state->rho_bar;
  bidiagonalise(state);
  fade_and_add(rows, state->turn, state->tv, state->th);
  state->rho = hypot(state->alpha_bar, state->beta);
  if (!(state->rho > 0)) {
    return false;
  }
  double theta = state->beta / state->rho * state->alpha, theta_bar = state->s_bar * state->rho;
  state->alpha_bar *= state->alpha / state->rho;
  state->rho_bar = hypot(state->c_bar * state->rho, theta);
  if (!(state->rho_bar > 0)) {
    return false;
  }
  state->c_bar *= state->rho / state->rho_bar;
  state->s_bar = theta / state->rho_bar;
  double zeta = state->c_bar * state->zeta_bar;
  state->zeta_bar *= -state->s_bar;
  double factor = -theta_bar * state->rho / (rho_before * rho_bar_before);
  fade_and_add(cols, factor, state->h, state->h_bar);
  fade_and_add(rows, factor, state->th, state->th_bar);
  double length = zeta / (state->rho * state->rho_bar);
  clt_add(cols, length, state->h_bar, state->x);
  clt_add(rows, -length, state->th_bar, state->r);
  state->turn = -theta / state->rho;
  fade_and_add(cols, state->turn, state->v, state->h);
  return true;
}

/* system->light = F x */
static void tell_light(const lsmr *state) {
  clt_system *system = state->system;
  for (size_t j = 0; j < system->cols; j++) {
    system->light[j] = system->lit[j] ? system->first_bounce[j] * state->x[j] : 0;
  }
}

/* True where x is as good as least squares can make it, to the tolerance. */
static bool is_optimum(const lsmr *state, const clt_run *run, double norm) {
  double least = fmax(LEAST_SQUARES * run->tolerance, LEAST_FLOOR);
  return fabs(state->zeta_bar) <= least * sqrt(state->squares) * norm;
}

/* Steps from the residual of x until the recurrence tells the target or an optimum. */
static clt_outcome run_from(lsmr *state, clt_run *run, double norm, bool *optimum) {
  clt_system *system = state->system;
  begin(state);
  *optimum = is_optimum(state, run, norm);
  while (norm > clt_run_target(run, system) && !*optimum) {
    if (!clt_run_may_go_on(run)) {
      return CLT_RUN_STOPPED;
    }
    *optimum = !iterate(state);
    norm = clt_norm(system->rows, state->r);
    tell_light(state);
    clt_run_count(run, norm);
    *optimum = *optimum || is_optimum(state, run, norm);
  }
  return CLT_RUN_CONVERGED;
}

static lsmr take_vectors(clt_system *system) {
  return (lsmr){.system = system,
                .u = clt_system_vector(system, 0),
                .tu = clt_system_vector(system, 1),
                .v = clt_system_vector(system, 2),
                .h = clt_system_vector(system, 3),
                .h_bar = clt_system_vector(system, 4),
                .tv = clt_system_vector(system, 5),
                .th = clt_system_vector(system, 6),
                .th_bar = clt_system_vector(system, 7),
                .x = clt_system_vector(system, 8),
                .l = clt_system_vector(system, 9),
                .r = clt_system_vector(system, 10)};
}

static clt_outcome run_lsmr(clt_system *system, clt_run *run) {
  lsmr state = take_vectors(system);
  for (size_t j = 0; j < system->cols; j++) {
    state.x[j] = system->light[j] * system->scale[j];
  }
  double norm = clt_system_residual(system, system->light, state.r), before = INFINITY;
  clt_run_open(run, norm);
  while (norm > clt_run_target(run, system)) {
    bool optimum = false;
    clt_outcome outcome = norm < 0.5 * before ? run_from(&state, run, norm, &optimum) : CLT_RUN_STOPPED;
    if (optimum || outcome != CLT_RUN_CONVERGED) {
      return outcome;
    }
    before = norm; /* where the recurrence was wrong, it starts again while that halves the residual */
    norm = clt_system_residual(system, system->light, state.r);
  }
  return CLT_RUN_CONVERGED;
}

/* The iteration is for the drive x, and F, which the model knows nothing of, spreads the singular values. */
static void expect(clt_effort *effort) {
  static const double SPREAD = 2;
  clt_effort_normal(effort);
  effort->iterations = (int)ceil(SPREAD * effort->iterations);
  clt_effort_take(effort, 3, 2, 12);
}

const clt_method clt_method_lsmr = {
    .name = "lsmr",
    .summary = "least squares by Golub-Kahan bidiagonalisation: any shape of T, and the drive of least norm where "
               "many serve; two products an iteration",
    .rectangular = true,
    .vectors = LSMR_VECTORS,
    .expect = expect,
    .run = run_lsmr,
};
