#include "solve/relax.h"

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  return clt_relax_check("gauss-seidel", channel, error);
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  return clt_relax_prepare(system, "gauss-seidel", prepared, error);
}

/* Eq. 43 with every l_i put in place as soon as it is known (Bai et al. 2010, section 7). */
static clt_outcome run_gauss_seidel(clt_system *system, clt_run *run) {
  return clt_relax_run(system, run, clt_relax_in_order, 1);
}

static void expect(clt_effort *effort) {
  clt_effort_sweeps(effort, 1, false);
  clt_relax_expect(effort);
}

const clt_method clt_method_gauss_seidel = {
    .name = "gauss-seidel",
    .summary = "jacobi in place: each cell sees what the cells before it have become; converges at every albedo where "
               "the scene is diffuse; needs the entries of T",
    .apart = true,
    .vectors = CLT_RELAX_VECTORS,
    .check = check,
    .prepare = prepare,
    .release = clt_relax_release,
    .expect = expect,
    .run = run_gauss_seidel,
};
