/* A live solver over the bounded method of the table. */
#include "counterlight/live.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"

struct clt_live {
  const clt_transport *transport;
  const clt_certificate *certificate;
  clt_transport_info info;
  clt_solve_options options;
  clt_solver *solver;
  size_t values; /* channels * cols */
  double *wanted, *start, *drive;
};

static clt_status check_options(const clt_live_options *options, const clt_transport_info *info, clt_error *error) {
  if (options != NULL && !(options->target_error >= 0 && options->target_error < 1)) {
    return clt_fail(error, CLT_BAD_INPUT, "target_error is %g; it is a relative error, 0..1 (0: the default)",
                    options->target_error);
  }
  if (options != NULL && !(options->budget_ms >= 0 && isfinite(options->budget_ms))) {
    return clt_fail(error, CLT_BAD_INPUT, "budget_ms is %g; it is a time, 0 or more (0: no limit)", options->budget_ms);
  }
  if (info->rows != info->cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the transport observes %zu cells but drives %zu; moving pictures need a camera that shares the "
                    "projector's grid",
                    info->rows, info->cols);
  }
  return CLT_OK;
}

clt_status clt_live_create(const clt_transport *transport, const clt_certificate *certificate,
                           const clt_live_options *options, clt_live **out, clt_error *error) {
  static const double DEFAULT_ERROR = 1e-3;
  const clt_transport_info info = clt_transport_describe(transport);
  *out = NULL;
  clt_status status = check_options(options, &info, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_live *live = clt_alloc(1, sizeof *live);
  const size_t values = (size_t)info.channels * info.cols;
  double *vectors = live != NULL ? clt_alloc(values, 3 * sizeof *vectors) : NULL;
  if (vectors == NULL) {
    free(live);
    return clt_fail(error, CLT_FAILED, "no memory for moving pictures of %zu cells", info.cols);
  }
  const bool chosen = options != NULL && options->target_error > 0;
  *live = (clt_live){.transport = transport,
                     .certificate = certificate,
                     .info = info,
                     .options = {.method = "bounded",
                                 .tolerance = chosen ? options->target_error : DEFAULT_ERROR,
                                 .deadline_s = options != NULL ? 1e-3 * options->budget_ms : 0,
                                 .together = true},
                     .values = values,
                     .wanted = vectors,
                     .start = vectors + values,
                     .drive = vectors + 2 * values};
  status = clt_solver_create(transport, certificate, &live->options, &live->solver, error);
  if (status != CLT_OK) {
    clt_live_destroy(live);
    return status;
  }
  *out = live;
  return CLT_OK;
}

void clt_live_destroy(clt_live *live) {
  if (live != NULL) {
    clt_solver_destroy(live->solver);
    free(live->wanted);
    free(live);
  }
}

static void tell(const clt_live *live, const clt_solve_result *solve, clt_live_result *result) {
  size_t lit = 0, clipped = 0;
  for (int c = 0; c < live->info.channels; c++) {
    const unsigned char *takes_part = clt_certificate_lit(live->certificate, c);
    const double *drive = live->drive + (size_t)c * live->info.cols;
    for (size_t j = 0; j < live->info.cols; j++) {
      lit += takes_part[j];
      clipped += takes_part[j] && (drive[j] <= 0 || drive[j] >= 1);
    }
  }
  const double known = fmax(clt_transport_origin(live->transport)->error, 0);
  *result = (clt_live_result){.error = hypot(solve->residual, known),
                              .residual = solve->residual,
                              .clipped_fraction = lit > 0 ? (double)clipped / (double)lit : 0,
                              .steps = solve->iterations,
                              .converged = solve->converged};
  result->ms[CLT_LIVE_SOLVE] = 1e3 * solve->method_seconds;
  result->ms[CLT_LIVE_ESTIMATE] = 1e3 * (solve->seconds - solve->method_seconds);
}

clt_status clt_live_solve(clt_live *live, const float *target, float *drive, clt_live_result *result,
                          clt_error *error) {
  const int64_t start_ns = clt_clock_ns();
  for (int c = 0; c < live->info.channels; c++) {
    const float *black = clt_transport_black(live->transport, c);
    for (size_t i = 0; i < live->info.cols; i++) {
      const size_t at = (size_t)c * live->info.cols + i;
      live->wanted[at] = (double)(target[at] - black[i]);
    }
  }
  clt_solve_result solve = {0};
  const double prepare_ms = 1e3 * clt_clock_since(start_ns);
  clt_status status = clt_solver_run(live->solver, live->wanted, live->start, live->drive, &solve, error);
  if (status == CLT_OK) {
    memcpy(live->start, live->drive, live->values * sizeof *live->drive);
    tell(live, &solve, result);
    result->ms[CLT_LIVE_PREPARE] = prepare_ms;
    result->total_ms = 1e3 * clt_clock_since(start_ns);
  }
  for (size_t at = 0; at < live->values; at++) {
    drive[at] = (float)live->start[at];
  }
  return status;
}

void clt_live_reset(clt_live *live) {
  memset(live->start, 0, live->values * sizeof *live->start);
}

void clt_live_set_budget(clt_live *live, double budget_ms) {
  live->options.deadline_s = 1e-3 * budget_ms;
}
