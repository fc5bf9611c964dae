#include "solve/iterate.h"

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  return clt_check_series("jacobi", channel, error);
}

/* l <- l_out - R l = l + (b - S l)   (Bai et al. 2010, eq. 43) */
static clt_outcome run_jacobi(clt_system *system, clt_run *run) {
  return clt_richardson(system, run, 1, run->radius_high < 1);
}

static void expect(clt_effort *effort) {
  clt_effort_richardson(effort, 1);
  clt_effort_take(effort, 2, 1, 2);
}

const clt_method clt_method_jacobi = {
    .name = "jacobi",
    .summary =
        "the report's iteration l = l_out - R l (eq. 43); converges where rho(R) < 1, that is below albedo 1/2 in "
        "a closed room",
    .vectors = CLT_RICHARDSON_VECTORS,
    .check = check,
    .expect = expect,
    .run = run_jacobi,
};
