#include "solve/refine.h"

#include <math.h>

static const double STALE_FACTOR = 0.9; /* a step that leaves more than this of the least residual gains nothing */
static const double GROWTH = 10;        /* a residual this much above the start has diverged */
static const double ROUNDING = 1e-12;   /* a stop this low, relative to b, is for lack of digits */
enum { STALE_STEPS = 4 };

typedef struct refinement {
  clt_system *system;
  clt_run *run;
  double *r, *l, *d, *best;
  double norm, least, start;
  int stale;
} refinement;

static void begin(refinement *state) {
  clt_system *system = state->system;
  state->r = clt_system_vector(system, 0);
  state->l = clt_system_vector(system, 1);
  state->d = clt_system_vector(system, 2);
  state->best = clt_system_vector(system, 3);
  clt_copy(system->cols, system->light, state->l);
  clt_copy(system->cols, system->light, state->best);
  state->norm = clt_system_residual(system, state->l, state->r);
  state->least = state->start = state->norm;
  clt_run_open(state->run, state->norm);
}

/* True where the bound shows that l, now in system->light, is good enough. */
static bool is_bounded(refinement *state, const clt_inverse *inverse) {
  clt_system *system = state->system;
  clt_copy(system->cols, state->l, system->light);
  if (inverse->bound == NULL) {
    return false;
  }
  double bound = inverse->bound(inverse->context, state->l, state->norm);
  if (!(bound <= clt_run_target(state->run, system))) {
    return false;
  }
  clt_run_count(state->run, bound);
  return true;
}

/* Measures l; false where the steps no longer help. */
static bool makes_progress(refinement *state) {
  clt_system *system = state->system;
  state->norm = clt_system_residual(system, state->l, state->r);
  clt_run_count(state->run, state->norm);
  state->stale = state->norm <= STALE_FACTOR * state->least ? 0 : state->stale + 1;
  if (state->norm < state->least) {
    state->least = state->norm;
    clt_copy(system->cols, state->l, state->best);
  }
  return isfinite(state->norm) && state->norm <= GROWTH * state->start && state->stale < STALE_STEPS;
}

static clt_outcome give_up(refinement *state) {
  double size = state->system->wanted_norm;
  if (state->least <= ROUNDING * size) {
    return CLT_RUN_STOPPED;
  }
  clt_run_note(state->run, "its residual went from %.2g to %.2g of the target, at best %.2g", state->start / size,
               state->norm / size, state->least / size);
  return CLT_RUN_BROKE;
}

clt_outcome clt_refine(const clt_inverse *inverse, clt_system *system, clt_run *run) {
  refinement state = {.system = system, .run = run};
  clt_outcome outcome = CLT_RUN_CONVERGED;
  begin(&state);
  while (state.norm > clt_run_target(run, system)) {
    if (!clt_run_may_go_on(run)) {
      outcome = CLT_RUN_STOPPED;
      break;
    }
    inverse->apply(inverse->context, state.r, state.d);
    clt_add(system->cols, 1, state.d, state.l);
    if (is_bounded(&state, inverse)) {
      return CLT_RUN_CONVERGED;
    }
    if (!makes_progress(&state)) {
      outcome = give_up(&state);
      break;
    }
  }
  if (outcome != CLT_RUN_CONVERGED) {
    clt_copy(system->cols, state.best, system->light);
  }
  return outcome;
}
