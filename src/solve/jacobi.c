#include <math.h>

#include "solve/method.h"

/* A certified iteration may grow for a while (non-normal R); one without a certificate is stopped early. */
static const double GROWTH_CERTIFIED = 1e6, GROWTH = 10;
enum { GROWING_STEPS = 8 };

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  if (channel->lit > 0 && channel->radius_low >= 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "jacobi diverges here: rho(R) is in [%.3g, %.3g] and must be below 1; use %s or auto",
                    channel->radius_low, channel->radius_high, clt_method_linear(channel->reciprocity)->name);
  }
  return CLT_OK;
}

/* l <- l_out - R l = l + (b - S l)   (Bai et al. 2010, eq. 43) */
static clt_outcome run_jacobi(clt_system *system, clt_run *run) {
  double *r = clt_system_vector(system, 0), *l = clt_system_vector(system, 1);
  clt_copy(system->cols, system->light, l);
  double norm = clt_system_residual(system, l, r);
  double start = norm, least = norm, growth = run->radius_high < 1 ? GROWTH_CERTIFIED : GROWTH;
  int growing = 0;
  clt_run_open(run, norm);
  while (norm > clt_run_target(run, system)) {
    if (!clt_run_may_go_on(run)) {
      return CLT_RUN_STOPPED;
    }
    double before = norm;
    clt_add(system->cols, 1, r, l);
    norm = clt_system_residual(system, l, r);
    clt_run_count(run, norm);
    growing = norm > before ? growing + 1 : 0;
    if (!isfinite(norm) || norm > growth * start || (growing >= GROWING_STEPS && run->radius_high >= 1)) {
      clt_run_note(run, "its residual grew from %.2g to %.2g of the target", start / system->wanted_norm,
                   norm / system->wanted_norm);
      return CLT_RUN_BROKE;
    }
    if (norm < least) {
      least = norm;
      clt_copy(system->cols, l, system->light);
    }
  }
  return CLT_RUN_CONVERGED;
}

const clt_method clt_method_jacobi = {
    .name = "jacobi",
    .summary =
        "the report's iteration l = l_out - R l (eq. 43); converges where rho(R) < 1, that is below albedo 1/2 in "
        "a closed room",
    .vectors = 2,
    .check = check,
    .run = run_jacobi,
};
