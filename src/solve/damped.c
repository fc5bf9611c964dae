#include <math.h>

#include "solve/iterate.h"

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  if (channel->lit > 0 && !isfinite(channel->radius_high)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "damped needs an upper bound of rho(R) and the certificate has none; use %s or auto",
                    clt_method_linear(channel->reciprocity)->name);
  }
  return CLT_OK;
}

/* l <- l + omega (b - S l) with omega = 1 - m^2, m = rho / (1 + rho). For ||A|| <= m < 1
 *
 *   I - omega S = (I - A - (1 - m^2) I) (I - A)^-1 = -m phi(A / m),  phi(z) = (z - m) / (1 - m z)
 *
 * and phi maps the unit disc on itself, so ||I - omega S|| <= m for every such A, normal or not (von Neumann 1951).
 * Where only the spectral radius of A is known to be m, the same map says that the iteration converges with rate m.
 * Jacobi (omega = 1) has rate m / (1 - m). */
static clt_outcome run_damped(clt_system *system, clt_run *run) {
  double m = clt_albedo_of_radius(run->radius_high);
  return clt_richardson(system, run, 1 - m * m, true);
}

static void expect(clt_effort *effort) {
  double m = clt_albedo_of_radius(effort->channel->radius_high);
  clt_effort_richardson(effort, 1 - m * m);
  clt_effort_take(effort, 2, 1, 2);
}

const clt_method clt_method_damped = {
    .name = "damped",
    .summary = "jacobi with steps damped by 1 - m^2, m the bound of the albedo: converges at every albedo, by the "
               "factor m an iteration, for transports that are not reciprocal too",
    .vectors = CLT_RICHARDSON_VECTORS,
    .check = check,
    .expect = expect,
    .run = run_damped,
};
