#include "solve/relax.h"

static const double TWO_PI = 6.283185307179586;

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  return clt_relax_check("sor", channel, error);
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  return clt_relax_prepare(system, "sor", prepared, error);
}

/* Young's omega is for matrices with property A, whose Jacobi eigenvalues come in pairs +-mu < 1. Interreflection is
 * another kind: R has one great eigenvalue rho, the flat mode, and small ones. Take R as rho times the mean over cells,
 * number the cells by t in 0..1, and let s(t) be the mean of the error e at the moment when the sweep is at t. A mode
 * that a sweep multiplies by lambda has, between its visits,
 *
 *   lambda e = (1 - omega) e - omega rho s,   s' = (lambda - 1) e,   s(1) = lambda s(0)
 *
 *   =>  lambda = exp(k),  k (lambda - 1 + omega) = (1 - lambda) omega rho .
 *
 * For a great rho the slowest has k near 2 pi i, |lambda| near 1 - (2 pi^2 / rho^2) (2 / omega - 1): Gauss-Seidel
 * sweeps a wave through the cells that hardly fades, and *under*-relaxation stops it. All other modes fade by 1 -
 * omega. Both are equal near omega = 2 pi / rho; for a small rho the best omega is 1. In between
 *
 *   omega = 1 / (1 + rho / 2 pi)
 *
 * is within 0.04 of the best omega of the equation above. The rate is then near 1 - 2 pi / rho, where damped has 1 - 2
 * / rho and Gauss-Seidel 1 - 2 pi^2 / rho^2. */
static clt_outcome run_sor(clt_system *system, clt_run *run) {
  return clt_relax_run(system, run, clt_relax_in_order, TWO_PI / (TWO_PI + run->radius_high));
}

static void expect(clt_effort *effort) {
  clt_effort_sweeps(effort, TWO_PI / (TWO_PI + effort->channel->radius_high), false);
  clt_relax_expect(effort);
}

const clt_method clt_method_sor = {
    .name = "sor",
    .summary = "gauss-seidel with successive under-relaxation, omega from the bound of rho(R): three times as fast as "
               "damped near albedo 1; needs the entries of T",
    .apart = true,
    .vectors = CLT_RELAX_VECTORS,
    .check = check,
    .prepare = prepare,
    .release = clt_relax_release,
    .expect = expect,
    .run = run_sor,
};
