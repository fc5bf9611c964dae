#include "counterlight/loop.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "solve/method.h"

static const double DEFAULT_TOLERANCE = 1e-3, PI = 3.14159265358979323846;

struct clt_loop {
  const clt_transport *transport;
  const clt_certificate *certificate;
  clt_transport_info info;
  clt_loop_options options; /* with the defaults put in */
  double limit;
  clt_solver *solver;               /* NULL where F^-1 corrects */
  double *rest, *change, *expected; /* channels x cells */
  double *shown;                    /* the last `delay` + 1 drives, step k at k modulo that; channels x cells each */
  long steps;
};

double clt_loop_limit(int delay) {
  double d = delay < 0 ? 0 : delay > CLT_LOOP_DELAY_MAX ? CLT_LOOP_DELAY_MAX : delay;
  return 2 * cos(d * PI / (2 * d + 1));
}

static clt_status check_options(clt_loop *loop, clt_error *error) {
  clt_loop_options *options = &loop->options;
  if (loop->info.rows != loop->info.cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "a closed loop needs as many observed cells as drive cells, but this transport has %zu rows and "
                    "%zu columns",
                    loop->info.rows, loop->info.cols);
  }
  if (options->delay < 0 || options->delay > CLT_LOOP_DELAY_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "a delay of %d steps is out of range; use 0..%d", options->delay,
                    (int)CLT_LOOP_DELAY_MAX);
  }
  double greatest = options->inverse ? 1 : 1 + clt_certificate_worst(loop->certificate).radius_high;
  loop->limit = clt_loop_limit(options->predict ? 0 : options->delay) / greatest;
  options->gain = options->gain == 0 ? loop->limit / 2 : options->gain;
  if (!(options->gain > 0 && options->gain < loop->limit)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "a gain of %g does not settle with a delay of %d steps; use one above 0 and below %.3g",
                    options->gain, options->delay, loop->limit);
  }
  return CLT_OK;
}

static clt_status reserve(clt_loop *loop, clt_error *error) {
  size_t values = (size_t)loop->info.channels * loop->info.cols;
  loop->rest = clt_alloc(values, sizeof(double));
  loop->change = clt_alloc(values, sizeof(double));
  loop->expected = clt_alloc(values, sizeof(double));
  loop->shown = clt_alloc(values, ((size_t)loop->options.delay + 1) * sizeof(double));
  if (loop->rest == NULL || loop->change == NULL || loop->expected == NULL || loop->shown == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a closed loop over %zu cells", loop->info.cols);
  }
  if (!loop->options.inverse) {
    return CLT_OK;
  }
  clt_solve_options solve = {.method = clt_method_linear(clt_certificate_worst(loop->certificate).reciprocity)->name,
                             .tolerance = loop->options.tolerance > 0 ? loop->options.tolerance : DEFAULT_TOLERANCE};
  return clt_solver_create(loop->transport, loop->certificate, &solve, &loop->solver, error);
}

clt_status clt_loop_create(const clt_transport *transport, const clt_certificate *certificate,
                           const clt_loop_options *options, clt_loop **out, clt_error *error) {
  clt_loop *loop = clt_alloc(1, sizeof *loop);
  if (loop == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a closed loop");
  }
  loop->transport = transport;
  loop->certificate = certificate;
  loop->info = clt_transport_describe(transport);
  loop->options = options != NULL ? *options : (clt_loop_options){0};
  clt_status status = check_options(loop, error);
  status = status == CLT_OK ? reserve(loop, error) : status;
  if (status != CLT_OK) {
    clt_loop_destroy(loop);
    return status;
  }
  *out = loop;
  return CLT_OK;
}

void clt_loop_destroy(clt_loop *loop) {
  if (loop == NULL) {
    return;
  }
  clt_solver_destroy(loop->solver);
  free(loop->rest);
  free(loop->change);
  free(loop->expected);
  free(loop->shown);
  free(loop);
}

clt_loop_info clt_loop_describe(const clt_loop *loop) {
  return (clt_loop_info){.gain = loop->options.gain, .limit = loop->limit, .delay = loop->options.delay};
}

/* Keeps the drive of this step and gives that of `delay` steps before. */
static const double *remember(clt_loop *loop, const double *drive) {
  size_t values = (size_t)loop->info.channels * loop->info.cols;
  long kept = loop->options.delay + 1, first = loop->steps < kept ? 0 : loop->steps - kept + 1;
  memcpy(loop->shown + (size_t)(loop->steps % kept) * values, drive, values * sizeof *drive);
  loop->steps++;
  return loop->shown + (size_t)(first % kept) * values;
}

/* rest = wanted - seen, with Smith's predictor less T (x_k - x_(k - d)): what is on its way already. 0 where nothing
 * was seen. */
static void find_rest(clt_loop *loop, const double *wanted, const double *seen, const double *drive) {
  size_t values = (size_t)loop->info.channels * loop->info.cols;
  const double *before = remember(loop, drive);
  for (size_t i = 0; i < values; i++) {
    loop->change[i] = drive[i] - before[i];
    loop->expected[i] = 0;
  }
  if (loop->options.predict && loop->options.delay > 0) {
    clt_transport_apply_all(loop->transport, loop->change, loop->expected);
  }
  for (size_t i = 0; i < values; i++) {
    double rest = wanted[i] - seen[i] - loop->expected[i];
    loop->rest[i] = isfinite(rest) ? rest : 0;
  }
}

clt_status clt_loop_step(clt_loop *loop, const double *wanted, const double *seen, double *drive, clt_error *error) {
  size_t cells = loop->info.cols, values = (size_t)loop->info.channels * cells;
  find_rest(loop, wanted, seen, drive);
  if (loop->solver != NULL) {
    clt_solve_result result;
    clt_status status = clt_solver_run(loop->solver, loop->rest, NULL, loop->change, &result, error);
    if (status != CLT_OK) {
      return status;
    }
  }
  for (size_t i = 0; i < values; i++) {
    int c = (int)(i / cells);
    double step = loop->solver != NULL ? loop->change[i]
                                       : loop->rest[i] / clt_certificate_first_bounce(loop->certificate, c)[i % cells];
    bool lit = clt_certificate_lit(loop->certificate, c)[i % cells];
    drive[i] = lit ? fmin(fmax(drive[i] + loop->options.gain * step, 0), 1) : 0;
  }
  return CLT_OK;
}
