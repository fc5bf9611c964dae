/* Live solvers: which form serves, and what is told of a frame. */
#include "solve/live.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"

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

static void measure_white(clt_live *live) {
  double sum = 0;
  for (int c = 0; c < live->info.channels; c++) {
    const clt_channel_certificate *known = clt_certificate_channel(live->certificate, c);
    sum += known->white * known->white * (double)known->lit;
  }
  live->white_norm = sqrt(sum);
}

/* A hierarchy by rows is worth it from so many cells on, where it is so much smaller; its time grows with their square.
 */
clt_status clt_live_convert(const clt_transport *transport, clt_transport **out, clt_error *error) {
  static const double LEFT_OUT = 5e-3; /* by a leaf, of a cell's light */
  enum { CELLS_LEAST = 768, CELLS_MOST = 8192, SMALLER = 3 };
  const clt_transport_info info = clt_transport_describe(transport);
  *out = NULL;
  if (strcmp(info.storage, "blocks") == 0) {
    return clt_transport_create_hierarchy(transport, LEFT_OUT, out, error);
  }
  if (strcmp(info.storage, "hierarchy") == 0 || info.cols < CELLS_LEAST || info.cols > CELLS_MOST) {
    return CLT_OK;
  }
  const clt_status status = clt_transport_create_hierarchy(transport, LEFT_OUT, out, error);
  if (status == CLT_OK && SMALLER * clt_transport_describe(*out).bytes > info.bytes) {
    clt_transport_destroy(*out);
    *out = NULL;
  }
  return status == CLT_BAD_INPUT ? CLT_OK : status; /* light without order: by products */
}

static clt_status choose_form(clt_live *live, clt_error *error) {
  const clt_status status = clt_live_convert(live->transport, &live->made, error);
  live->transport = live->made != NULL ? live->made : live->transport;
  live->form = strcmp(clt_transport_describe(live->transport).storage, "hierarchy") == 0 ? &clt_live_hierarchic
                                                                                         : &clt_live_general;
  return status;
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
  if (live == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for moving pictures");
  }
  *live = (clt_live){.transport = transport, .certificate = certificate, .info = info};
  live->options = options != NULL ? *options : (clt_live_options){0};
  live->options.target_error = live->options.target_error > 0 ? live->options.target_error : DEFAULT_ERROR;
  measure_white(live);
  status = choose_form(live, error);
  if (status == CLT_OK) {
    status = live->form->create(live, error);
  }
  if (status != CLT_OK) {
    clt_live_destroy(live);
    return status;
  }
  *out = live;
  return CLT_OK;
}

void clt_live_destroy(clt_live *live) {
  if (live != NULL) {
    if (live->form != NULL) {
      live->form->destroy(live);
    }
    clt_transport_destroy(live->made);
    free(live);
  }
}

clt_status clt_live_measure(clt_live *live, double squares, clt_error *error) {
  if (!isfinite(squares)) {
    return clt_fail(error, CLT_BAD_INPUT, "a target of moving pictures has values that are not finite");
  }
  live->size = squares > 0 ? sqrt(squares) : live->white_norm > 0 ? live->white_norm : 1;
  return CLT_OK;
}

/* What the operator may be off by of what is seen: as its check patterns found it, and what the hierarchy left out. The
 * checks are random patterns, in which much averages out that a smooth picture shows (docs/live.md). */
static double operator_error(const clt_live *live) {
  static const double SMOOTH_SHARE = 2.5;
  const double checked = clt_transport_origin(live->transport)->error;
  return hypot(checked > 0 ? SMOOTH_SHARE * checked : 0, clt_transport_simplified(live->transport));
}

clt_status clt_live_solve(clt_live *live, const float *target, float *drive, clt_live_result *result,
                          clt_error *error) {
  live->start_ns = clt_clock_ns();
  *result = (clt_live_result){0};
  const clt_status status = live->form->solve(live, target, drive, result, error);
  if (status == CLT_OK) {
    result->error = hypot(result->residual, live->seen * operator_error(live));
    result->total_ms = 1e3 * clt_clock_since(live->start_ns);
  }
  return status;
}

void clt_live_reset(clt_live *live) {
  live->form->reset(live);
}

void clt_live_set_budget(clt_live *live, double budget_ms) {
  live->options.budget_ms = budget_ms;
}
