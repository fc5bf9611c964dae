#include <math.h>

#include "solve/iterate.h"

/* The eigenvalues of S = (I - A)^-1 lie in [1 / (1 + m), 1 / (1 - m)] where those of A lie in [-m, m]: centre theta and
 * half width delta are
 *
 *   theta = 1 / (1 - m^2),  delta = m / (1 - m^2),  sigma = theta / delta = 1 / m
 *
 * and the iteration (Saad 2003, algorithm 12.1) makes the residual q^k 2 / (1 + q^2k) times smaller in k steps, q = m /
 * (1 + sqrt(1 - m^2)). An eigenvalue beyond the upper end lets its part of the residual fall more slowly than that, or
 * grow. So a residual far behind the law is looked at: its Rayleigh quotient is by then nearly that eigenvalue, and the
 * iteration starts again from the best answer with an interval that holds it. */
static const double BEHIND = 30;     /* times the residual that the law allows */
static const double GROWN = 10;      /* times the least residual: a sign without the law, too */
static const double ABOVE = 1.001;   /* times the upper end: a Rayleigh quotient there disproves it */
static const double HEADROOM = 1.05; /* the new end over the Rayleigh quotient, which is a lower bound */
static const double RAISE = 1.25;    /* of the upper end where nothing better is known */
/* Complex eigenvalues fill the disc of centre theta and radius delta at worst; the residual falls there too where
 * 1 + sqrt(2) < (1 + sqrt(1 - m^2)) / m, that is m < 1 / sqrt(2) or rho(R) below this. */
static const double RADIUS_ANY = 2.414;
enum { RESTARTS_MAX = 12 };

typedef struct chebyshev {
  clt_system *system;
  double *r, *d, *l, *s;
  double upper; /* end of the interval, 1 / (1 - m) = 1 + rho */
  double m, rho, fade;
  double first;  /* residual norm at the (re)start */
  double behind; /* how far behind the law the residual may be until it is looked at */
  int steps, restarts;
} chebyshev;

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  if (channel->lit == 0) {
    return CLT_OK;
  }
  if (!isfinite(channel->radius_high)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "chebyshev needs an upper bound of rho(R) and the certificate has none; use %s or auto",
                    clt_method_linear(channel->reciprocity)->name);
  }
  if (channel->reciprocity > CLT_RECIPROCAL && channel->radius_high >= RADIUS_ANY) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "chebyshev needs real eigenvalues where rho(R) may reach %.3g, but the reciprocity defect %.2g does "
        "not promise them; use damped, gmres or auto",
        channel->radius_high, channel->reciprocity);
  }
  return CLT_OK;
}

/* The interval that ends at `upper`, and the first step d = r / theta from r = b - S l. */
static void start(chebyshev *state, double upper, double norm) {
  state->upper = upper;
  state->m = 1 - 1 / upper;
  state->rho = state->m;
  state->fade = state->m / (1 + sqrt(1 - state->m * state->m));
  state->first = norm;
  state->behind = BEHIND;
  state->steps = 0;
  for (size_t i = 0; i < state->system->cols; i++) {
    state->d[i] = (1 - state->m * state->m) * state->r[i];
  }
}

/* l += d, r -= S d, and the next d = rho' rho d + 2 rho' / delta r with rho' = 1 / (2 sigma - rho). */
static double step(chebyshev *state) {
  clt_system *system = state->system;
  double m = state->m, next = m / (2 - m * state->rho);
  double keep = next * state->rho, take = m > 0 ? 2 * next * (1 - m * m) / m : 1;
  clt_add(system->cols, 1, state->d, state->l);
  clt_system_apply(system, state->d, state->s);
  for (size_t i = 0; i < system->cols; i++) {
    state->r[i] -= state->s[i];
    state->d[i] = keep * state->d[i] + take * state->r[i];
  }
  state->rho = next;
  state->steps++;
  return clt_norm(system->cols, state->r);
}

/* True where the residual is far from what the interval promises. */
static bool is_suspect(const chebyshev *state, const clt_watch *watch) {
  double power = pow(state->fade, state->steps), law = 2 * power / (1 + power * power);
  return watch->norm > state->behind * law * state->first || watch->norm > GROWN * watch->least;
}

/* <r, S r> / <r, r> in the inner product in which S is self-adjoint: no more than its greatest eigenvalue. */
static double rayleigh_quotient(chebyshev *state) {
  clt_system *system = state->system;
  double above = 0, below = 0;
  clt_system_apply(system, state->r, state->s);
  for (size_t i = 0; i < system->cols; i++) {
    double weight = system->lit[i] ? 1 / system->flux[i] : 0;
    above += weight * state->r[i] * state->s[i];
    below += weight * state->r[i] * state->r[i];
  }
  return above / below;
}

/* Puts the interval right and starts again from the best answer; false where that has been tried too often. An
 * interval that the residual does not disprove stays, and is looked at again much later. */
static bool look(chebyshev *state, clt_watch *watch) {
  clt_system *system = state->system;
  double quotient = rayleigh_quotient(state);
  bool grown = watch->norm > GROWN * watch->least, above = quotient > ABOVE * state->upper;
  if (!grown && !above) {
    state->behind *= BEHIND;
    return true;
  }
  if (++state->restarts > RESTARTS_MAX) {
    clt_run_note(watch->run, "its residual kept growing with rho(R) taken as %.3g", state->upper - 1);
    watch->outcome = CLT_RUN_BROKE;
    return false;
  }
  double upper = above ? HEADROOM * quotient : RAISE * state->upper;
  clt_copy(system->cols, system->light, state->l);
  watch->norm = clt_system_residual(system, state->l, state->r);
  start(state, upper, watch->norm);
  return true;
}

static clt_outcome run_chebyshev(clt_system *system, clt_run *run) {
  chebyshev state = {.system = system,
                     .r = clt_system_vector(system, 0),
                     .d = clt_system_vector(system, 1),
                     .l = clt_system_vector(system, 2),
                     .s = clt_system_vector(system, 3)};
  clt_copy(system->cols, system->light, state.l);
  double norm = clt_system_residual(system, state.l, state.r);
  clt_watch watch = clt_watch_open(system, run, state.l, norm, true);
  do {
    start(&state, state.upper > 0 ? state.upper : 1 + run->radius_high, watch.norm);
    while (clt_watch_goes_on(&watch)) {
      clt_watch_count(&watch, step(&state));
      if (is_suspect(&state, &watch) && isfinite(watch.norm) && !look(&state, &watch)) {
        return watch.outcome;
      }
    }
  } while (clt_watch_resumes(&watch, clt_system_residual(system, state.l, state.r)));
  return watch.outcome;
}

static void expect(clt_effort *effort) {
  clt_effort_chebyshev(effort, clt_albedo_of_radius(effort->channel->radius_high));
  clt_effort_take(effort, 3, 1, 4);
}

const clt_method clt_method_chebyshev = {
    .name = "chebyshev",
    .summary = "Chebyshev's iteration between the bounds of the spectrum: near conjugate gradients where many modes "
               "matter, without inner products; raises an upper bound that proves too low",
    .vectors = 4,
    .check = check,
    .expect = expect,
    .run = run_chebyshev,
};
