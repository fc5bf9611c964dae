#include "solve/forecast.h"

#include <math.h>
#include <stdio.h>

#include "solve/job.h"
#include "solve/matrix.h"

/* False, with the reason, where the method is refused or cannot hold the entries. */
static bool is_possible(const clt_method *method, const clt_certificate *certificate, const clt_transport_info *info,
                        clt_forecast *out) {
  clt_error why = {0};
  out->possible = clt_choose_check(method, certificate, info, &why) == CLT_OK;
  for (int c = 0; out->possible && method->apart && c < info->channels; c++) {
    size_t lit = clt_certificate_channel(certificate, c)->lit;
    if (lit > CLT_MATRIX_CELLS_MAX) {
      out->possible = false;
      clt_fail(&why, CLT_BAD_INPUT, "%s keeps the entries of up to %d cells and %zu are lit; use pcg or gmres",
               method->name, CLT_MATRIX_CELLS_MAX, lit);
    }
  }
  snprintf(out->why_not, sizeof out->why_not, "%s", why.message);
  return out->possible;
}

static double duration(const clt_effort *effort) {
  return effort->start_s + effort->iterations * effort->iteration_s;
}

/* One channel; `deadline_s` is its share of the time, <= 0: none. */
static clt_effort expect(const clt_method *method, const clt_certificate *certificate, int c,
                         const clt_solve_options *options, double deadline_s) {
  clt_effort effort = {.model = clt_certificate_model(certificate, c),
                       .channel = clt_certificate_channel(certificate, c),
                       .tolerance = options->tolerance,
                       .limit = options->iteration_limit};
  if (effort.model->cells == 0) {
    return effort;
  }
  method->expect(&effort);
  if (deadline_s > 0 && duration(&effort) > deadline_s) {
    double prepare_s = effort.prepare_s;
    effort.limit = (int)fmin(fmax((deadline_s - effort.start_s) / effort.iteration_s, 0), options->iteration_limit);
    method->expect(&effort);
    effort.prepare_s = prepare_s;
  }
  return effort;
}

void clt_forecast_method(const clt_method *method, const clt_certificate *certificate, const clt_transport_info *info,
                         const clt_solve_options *options, clt_forecast *out) {
  *out = (clt_forecast){.iterations = -1, .seconds = -1};
  if (!is_possible(method, certificate, info, out) || info->rows != info->cols) {
    return;
  }
  out->iterations = 0;
  out->seconds = 0;
  for (int c = 0; c < info->channels; c++) {
    double left = options->deadline_s - out->seconds;
    double share = options->deadline_s > 0 ? fmax(left, 1e-9) / (info->channels - c) : 0;
    clt_effort effort = expect(method, certificate, c, options, share);
    out->iterations = effort.iterations > out->iterations ? effort.iterations : out->iterations;
    out->residual = fmax(out->residual, effort.residual);
    out->seconds += duration(&effort);
    out->prepare_seconds += effort.prepare_s;
  }
}

clt_status clt_forecast_solve(const clt_transport *transport, const clt_certificate *certificate,
                              const clt_solve_options *options, clt_forecast *out, clt_error *error) {
  clt_solve_options asked = options != NULL ? *options : (clt_solve_options){0};
  clt_transport_info info = clt_transport_describe(transport);
  const clt_method *method = NULL;
  clt_choice choice;
  if (!clt_certificate_fits(certificate, transport)) {
    return clt_fail(error, CLT_BAD_INPUT, "the certificate was made for another transport; certify this one first");
  }
  clt_status status = clt_solver_check_options(&asked, error);
  if (status == CLT_OK && (asked.method == NULL || strcmp(asked.method, "auto") == 0)) {
    clt_choose_first(certificate, &info, &asked, &choice);
    *out = choice.expected;
    return CLT_OK;
  }
  status = status == CLT_OK ? clt_choose_named(asked.method, &method, error) : status;
  if (status == CLT_OK) {
    clt_forecast_method(method, certificate, &info, &asked, out);
  }
  return status;
}
