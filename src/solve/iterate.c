#include "solve/iterate.h"

#include <math.h>

/* A certified iteration may grow for a while (non-normal R); one without a certificate is stopped
 * earlier. */
static const double GROWTH_CERTIFIED = 1e6, GROWTH = 1e3;
static const double ROUNDING = 1e-10; /* of b: below this a residual that no longer falls is held up by rounding */
enum { GROWING_STEPS = 16, GROWING_STEPS_CERTIFIED = 64, HELD_UP_STEPS = 20 };

clt_watch clt_watch_open(clt_system *system, clt_run *run, const double *l, double norm, bool certified) {
  clt_run_open(run, norm);
  return (clt_watch){.system = system,
                     .run = run,
                     .l = l,
                     .certified = certified,
                     .start = norm,
                     .norm = norm,
                     .least = norm,
                     .real = norm,
                     .outcome = CLT_RUN_CONVERGED};
}

void clt_watch_count(clt_watch *watch, double norm) {
  clt_run_count(watch->run, norm);
  watch->growing = norm > watch->norm ? watch->growing + 1 : 0;
  watch->since_least++;
  watch->norm = norm;
  if (norm < watch->least) {
    watch->least = norm;
    watch->since_least = 0;
    clt_copy(watch->system->cols, watch->l, watch->system->light);
  }
}

static bool diverges(const clt_watch *watch) {
  double most = watch->certified ? GROWTH_CERTIFIED : GROWTH;
  int steps = watch->certified ? GROWING_STEPS_CERTIFIED : GROWING_STEPS;
  return !isfinite(watch->norm) || watch->norm > most * watch->start ||
         (watch->growing >= steps && watch->norm > watch->start);
}

static bool ends(clt_watch *watch, clt_outcome outcome) {
  watch->outcome = outcome;
  return false;
}

bool clt_watch_goes_on(clt_watch *watch) {
  double wanted = watch->system->wanted_norm;
  if (watch->norm <= clt_run_target(watch->run, watch->system)) {
    return ends(watch, CLT_RUN_CONVERGED);
  }
  if (diverges(watch)) {
    clt_run_note(watch->run, "its residual grew from %.2g to %.2g of the target", watch->start / wanted,
                 watch->norm / wanted);
    return ends(watch, CLT_RUN_BROKE);
  }
  bool held_up = watch->since_least >= HELD_UP_STEPS && watch->least <= ROUNDING * wanted;
  return !held_up && clt_run_may_go_on(watch->run) ? true : ends(watch, CLT_RUN_STOPPED);
}

bool clt_watch_resumes(clt_watch *watch, double norm) {
  if (watch->outcome != CLT_RUN_CONVERGED) {
    return false;
  }
  bool falls = norm < 0.5 * watch->real;
  watch->norm = watch->least = watch->real = norm;
  watch->since_least = watch->growing = 0;
  clt_copy(watch->system->cols, watch->l, watch->system->light);
  if (norm <= clt_run_target(watch->run, watch->system)) {
    return false;
  }
  watch->outcome = CLT_RUN_STOPPED;
  return falls;
}

clt_outcome clt_richardson(clt_system *system, clt_run *run, double omega, bool certified) {
  double *r = clt_system_vector(system, 0), *l = clt_system_vector(system, 1);
  clt_copy(system->cols, system->light, l);
  clt_watch watch = clt_watch_open(system, run, l, clt_system_residual(system, l, r), certified);
  while (clt_watch_goes_on(&watch)) {
    clt_add(system->cols, omega, r, l);
    clt_watch_count(&watch, clt_system_residual(system, l, r));
  }
  return watch.outcome;
}

clt_status clt_check_series(const char *method, const clt_channel_certificate *channel, clt_error *error) {
  if (channel->lit > 0 && channel->radius_low >= 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s diverges here: rho(R) is in [%.3g, %.3g] and must be below 1; use %s or auto", method,
                    channel->radius_low, channel->radius_high, clt_method_linear(channel->reciprocity)->name);
  }
  return CLT_OK;
}
