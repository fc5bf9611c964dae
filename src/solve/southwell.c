#include "solve/relax.h"

enum { CELLS_BETWEEN_CHECKS = 64 };

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  return clt_relax_check("southwell", channel, error);
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  return clt_relax_prepare(system, "southwell", prepared, error);
}

/* The cell with the largest residual next, as often as there are cells; ends early where the target is reached. */
static void largest_first(clt_relax_state *state, clt_run *run, double omega) {
  size_t count = state->kept->matrix.count;
  for (size_t k = 0; k < count; k++) {
    if (k % CELLS_BETWEEN_CHECKS == 0 &&
        (!clt_run_may_go_on(run) || clt_norm(count, state->r) <= run->tolerance * state->system->wanted_norm)) {
      return;
    }
    clt_relax_cell(state, cblas_idamax((blasint)count, state->r, 1), omega);
  }
}

static clt_outcome run_southwell(clt_system *system, clt_run *run) {
  return clt_relax_run(system, run, largest_first, 1);
}

static void expect(clt_effort *effort) {
  clt_effort_sweeps(effort, 1, true);
  clt_relax_expect(effort);
}

const clt_method clt_method_southwell = {
    .name = "southwell",
    .summary = "relaxes the cell with the largest residual first; cheap where little of the picture is lit or has "
               "changed; an iteration is as many relaxations as there are cells; needs the entries of T",
    .apart = true,
    .vectors = CLT_RELAX_VECTORS,
    .check = check,
    .prepare = prepare,
    .release = clt_relax_release,
    .expect = expect,
    .run = run_southwell,
};
