#include "solve/relax.h"

#include <stdlib.h>

#include "base/memory.h"

enum { CELLS_BETWEEN_CLOCKS = 64 };

void clt_relax_expect(clt_effort *effort) {
  clt_effort_take(effort, 3, 0, (double)effort->model->cells);
  clt_effort_prepare(effort, 0);
}

static void transpose(clt_matrix *matrix) {
  size_t n = matrix->count;
  for (size_t i = 0; i < n; i++) {
    for (size_t j = 0; j < i; j++) {
      double entry = matrix->entries[i * n + j];
      matrix->entries[i * n + j] = matrix->entries[j * n + i];
      matrix->entries[j * n + i] = entry;
    }
  }
}

clt_status clt_relax_prepare(clt_system *system, const char *method, void **prepared, clt_error *error) {
  clt_relaxation *kept = clt_alloc(1, sizeof *kept);
  if (kept == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to make %s ready", method);
  }
  *prepared = kept;
  clt_status status = clt_matrix_init(&kept->matrix, system, method, error);
  if (status == CLT_OK) {
    transpose(&kept->matrix);
  }
  return status;
}

void clt_relax_release(void *prepared) {
  clt_relaxation *kept = prepared;
  if (kept != NULL) {
    clt_matrix_finish(&kept->matrix);
    free(kept);
  }
}

clt_status clt_relax_check(const char *method, const clt_channel_certificate *channel, clt_error *error) {
  if (channel->lit > 0 && channel->reciprocity > CLT_RECIPROCAL && channel->radius_low >= 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "nothing promises that %s converges here: the reciprocity defect is %.2g and rho(R) in [%.3g, "
                    "%.3g]; it needs a defect up to %g or rho(R) < 1; use gmres or auto",
                    method, channel->reciprocity, channel->radius_low, channel->radius_high, CLT_RECIPROCAL);
  }
  return CLT_OK;
}

void clt_relax_cell(clt_relax_state *state, size_t k, double omega) {
  const clt_matrix *matrix = &state->kept->matrix;
  const double *column = matrix->entries + k * matrix->count;
  double delta = omega * state->r[k] / column[k];
  state->l[matrix->cell[k]] += delta;
  clt_add(matrix->count, -delta, column, state->r);
}

void clt_relax_in_order(clt_relax_state *state, clt_run *run, double omega) {
  size_t count = state->kept->matrix.count;
  for (size_t k = 0; k < count; k++) {
    if (k % CELLS_BETWEEN_CLOCKS == 0 && !clt_run_may_go_on(run)) {
      return;
    }
    clt_relax_cell(state, k, omega);
  }
}

/* r = b - S l over lit cells, by a product. */
static double take_residual(clt_relax_state *state) {
  double norm = clt_system_residual(state->system, state->l, state->full);
  clt_matrix_gather(&state->kept->matrix, state->full, state->r);
  return norm;
}

clt_outcome clt_relax_run(clt_system *system, clt_run *run, clt_relax_sweep *sweep, double omega) {
  clt_relax_state state = {.system = system,
                           .kept = system->prepared,
                           .l = clt_system_vector(system, 0),
                           .full = clt_system_vector(system, 1),
                           .r = clt_system_vector(system, 2)};
  clt_copy(system->cols, system->light, state.l);
  clt_watch watch = clt_watch_open(system, run, state.l, take_residual(&state), true);
  do {
    while (clt_watch_goes_on(&watch)) {
      sweep(&state, run, omega);
      clt_watch_count(&watch, clt_norm(state.kept->matrix.count, state.r));
    }
  } while (clt_watch_resumes(&watch, take_residual(&state)));
  return watch.outcome;
}
