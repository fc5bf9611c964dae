/* Which method serves a transport, and which one takes over where it breaks. */
#include "solve/choose.h"

#include <stdio.h>
#include <string.h>

#include "solve/forecast.h"

static const double WORTH = 0.9; /* of the time of a method that is sure */

const clt_method *clt_method_linear(double reciprocity) {
  return reciprocity <= CLT_RECIPROCAL ? &clt_method_pcg : &clt_method_gmres;
}

/* Nearer to the tolerance; or reaching it as well, and clearly faster. */
static bool is_better(const clt_forecast *one, const clt_forecast *other, double tolerance) {
  bool reaches = one->residual <= tolerance, other_reaches = other->residual <= tolerance;
  if (reaches != other_reaches) {
    return reaches;
  }
  return reaches ? one->seconds < WORTH * other->seconds : one->residual < WORTH * other->residual;
}

/* The fixed-point methods serve `auto` only where their bound is proved. */
static bool is_certain(const clt_method *method, const clt_certificate *certificate) {
  return method != &clt_method_jacobi || clt_certificate_worst(certificate).radius_high < 1;
}

void clt_choose_first(const clt_certificate *certificate, const clt_transport_info *info,
                      const clt_solve_options *options, clt_choice *out) {
  static const clt_method *const others[] = {&clt_method_jacobi, &clt_method_damped, &clt_method_chebyshev,
                                             &clt_method_gmres};
  *out = (clt_choice){.method = &clt_method_bounded};
  if (info->rows == info->cols) {
    out->method = clt_method_linear(clt_certificate_worst(certificate).reciprocity);
  }
  clt_forecast_method(out->method, certificate, info, options, &out->expected);
  for (size_t i = 0; i < sizeof others / sizeof others[0] && info->rows == info->cols; i++) {
    clt_forecast expected;
    clt_forecast_method(others[i], certificate, info, options, &expected);
    if (others[i] == out->method || !expected.possible || !is_certain(others[i], certificate)) {
      continue;
    }
    if (is_better(&expected, &out->expected, options->tolerance)) {
      out->next = out->method;
      out->next_expected = out->expected;
      out->method = others[i];
      out->expected = expected;
    } else if (out->next == NULL || is_better(&expected, &out->next_expected, options->tolerance)) {
      out->next = others[i];
      out->next_expected = expected;
    }
  }
}

const clt_method *clt_choose_last(const clt_system *system) {
  return system->square ? &clt_method_gmres : &clt_method_bounded;
}

const clt_method *clt_choose_next(const clt_method *broken, const clt_system *system) {
  const clt_method *linear = clt_method_linear(system->reciprocity);
  return broken == linear || !system->square ? clt_choose_last(system) : linear;
}

clt_status clt_choose_named(const char *name, const clt_method **out, clt_error *error) {
  *out = clt_method_find(name);
  if (*out != NULL) {
    return CLT_OK;
  }
  char known[CLT_MESSAGE_MAX / 2] = "auto";
  for (size_t i = 0; clt_methods[i] != NULL; i++) {
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, ", %s", clt_methods[i]->name);
  }
  return clt_fail(error, CLT_BAD_INPUT, "there is no method \"%.40s\"; use one of: %s", name, known);
}

clt_status clt_choose_check(const clt_method *method, const clt_certificate *certificate,
                            const clt_transport_info *info, clt_error *error) {
  if (!method->rectangular && info->rows != info->cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s needs as many observed cells as drive cells, but this transport has %zu rows and %zu columns; "
                    "use bounded",
                    method->name, info->rows, info->cols);
  }
  for (int c = 0; method->check != NULL && c < info->channels; c++) {
    clt_status status = method->check(clt_certificate_channel(certificate, c), error);
    if (status != CLT_OK) {
      return status;
    }
  }
  return CLT_OK;
}
