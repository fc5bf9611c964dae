/* Products with A: one solve with T, and what it leaves at the cells that the projector does not light. */
#include "analysis/interreflection.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const double DEFAULT_TOLERANCE = 1e-9;
static const double RECIPROCAL = 0.02; /* defect up to which conjugate gradients go as far as these solves need */
static const double WORST_RESIDUAL = 1e-2;

size_t clt_interreflection_values(const clt_interreflection *interreflection) {
  return (size_t)interreflection->info.channels * interreflection->info.cells;
}

clt_status clt_interreflection_check(const clt_interreflection *interreflection, const double *values, const char *what,
                                     clt_error *error) {
  size_t count = clt_interreflection_values(interreflection);
  for (size_t i = 0; i < count; i++) {
    if (!isfinite(values[i])) {
      return clt_fail(error, CLT_BAD_INPUT, "value %zu of the %s is %g; every value must be a finite number", i, what,
                      values[i]);
    }
  }
  return CLT_OK;
}

static clt_status take_first_bounce(clt_interreflection *op, clt_error *error) {
  size_t cells = op->info.cells;
  clt_status status = CLT_OK;
  for (int c = 0; c < op->info.channels && status == CLT_OK; c++) {
    const unsigned char *lit = clt_certificate_lit(op->certificate, c);
    const double *diagonal = clt_certificate_first_bounce(op->certificate, c);
    double *first_bounce = op->first_bounce + (size_t)c * cells;
    for (size_t i = 0; i < cells; i++) {
      first_bounce[i] = lit[i] ? diagonal[i] : 0;
    }
    if (op->info.exact_first_bounce) {
      status = clt_exact_first_bounce(op->transport, c, lit, first_bounce, error);
    }
  }
  return status;
}

static clt_status make_solver(const clt_interreflection *op, const char *method, clt_solver **out, clt_error *error) {
  clt_solve_options options = {.method = method, .tolerance = op->tolerance};
  return clt_solver_create(op->transport, op->certificate, &options, out, error);
}

/* The method that was asked for, or the one that the reciprocity defect allows. */
static clt_status choose_method(clt_interreflection *op, const char *asked, clt_error *error) {
  for (int c = 0; c < op->info.channels; c++) {
    op->info.reciprocity = fmax(op->info.reciprocity, clt_certificate_channel(op->certificate, c)->reciprocity);
  }
  const char *method = asked != NULL ? asked : op->info.reciprocity <= RECIPROCAL ? "pcg" : "gmres";
  if (strcmp(method, "bounded") == 0 || strcmp(method, "auto") == 0) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s keeps the drive in 0..1, and T^-1 of a picture need not be; take pcg or gmres", method);
  }
  snprintf(op->info.method, sizeof op->info.method, "%s", method);
  return make_solver(op, method, &op->solver, error);
}

static clt_status prepare(clt_interreflection *op, clt_error *error) {
  size_t values = clt_interreflection_values(op);
  op->first_bounce = clt_alloc(values, sizeof(double));
  op->drive = clt_alloc(values, sizeof(double));
  op->seen = clt_alloc(values, sizeof(double));
  if (op->first_bounce == NULL || op->drive == NULL || op->seen == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to analyse %zu cells", op->info.cells);
  }
  clt_status status = take_first_bounce(op, error);
  if (status == CLT_OK) {
    clt_judge_exactness(op);
  }
  return status;
}

clt_status clt_interreflection_create(const clt_transport *transport, const clt_certificate *certificate,
                                      const clt_interreflection_options *options, clt_interreflection **out,
                                      clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  double tolerance = options != NULL ? options->tolerance : 0;
  if (info.rows != info.cols) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "the transport observes %zu cells but drives %zu; bounces need a camera that shares the projector's "
        "grid",
        info.rows, info.cols);
  }
  if (!(tolerance >= 0) || !(tolerance < 1)) {
    return clt_fail(error, CLT_BAD_INPUT, "the tolerance %g is not above 0 and below 1; use one like 1e-9", tolerance);
  }
  clt_interreflection *op = calloc(1, sizeof *op);
  if (op == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to analyse %zu cells", info.cols);
  }
  *op = (clt_interreflection){.transport = transport,
                              .certificate = certificate,
                              .tolerance = tolerance > 0 ? tolerance : DEFAULT_TOLERANCE,
                              .info = {.width = info.width,
                                       .height = info.height,
                                       .channels = info.channels,
                                       .cells = info.cols,
                                       .exact_first_bounce = options != NULL && options->exact_first_bounce}};
  clt_status status = choose_method(op, options != NULL ? options->method : NULL, error);
  if (status == CLT_OK) {
    status = prepare(op, error);
  }
  if (status != CLT_OK) {
    clt_interreflection_destroy(op);
    return status;
  }
  *out = op;
  return CLT_OK;
}

void clt_interreflection_destroy(clt_interreflection *interreflection) {
  if (interreflection == NULL) {
    return;
  }
  clt_solver_destroy(interreflection->solver);
  clt_solver_destroy(interreflection->fallback);
  free(interreflection->first_bounce);
  free(interreflection->drive);
  free(interreflection->seen);
  free(interreflection);
}

clt_interreflection_info clt_interreflection_describe(const clt_interreflection *interreflection) {
  return interreflection->info;
}

const double *clt_interreflection_first_bounce(const clt_interreflection *interreflection, int channel) {
  return interreflection->first_bounce + (size_t)channel * interreflection->info.cells;
}

/* ||T y - light|| / ||light|| over lit cells. */
static double measure_residual(const clt_interreflection *op, const double *light) {
  double rest = 0, whole = 0;
  for (int c = 0; c < op->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(op->certificate, c);
    for (size_t i = 0; i < op->info.cells; i++) {
      size_t at = (size_t)c * op->info.cells + i;
      double difference = lit[i] ? op->seen[at] - light[at] : 0;
      rest += difference * difference;
      whole += lit[i] ? light[at] * light[at] : 0;
    }
  }
  return whole > 0 ? sqrt(rest / whole) : 0;
}

clt_status clt_interreflection_solve(clt_interreflection *op, const double *light, double *residual, clt_error *error) {
  clt_solve_result result;
  clt_status status = clt_solver_run(op->solver, light, NULL, op->drive, &result, error);
  if (status == CLT_OK && !result.converged && strcmp(op->info.method, "gmres") != 0) {
    status = op->fallback != NULL ? CLT_OK : make_solver(op, "gmres", &op->fallback, error);
    if (status == CLT_OK) {
      status = clt_solver_run(op->fallback, light, op->drive, op->drive, &result, error);
    }
  }
  if (status != CLT_OK) {
    return status;
  }
  clt_transport_apply_all(op->transport, op->drive, op->seen);
  double left = measure_residual(op, light);
  if (!(left <= fmax(WORST_RESIDUAL, 2 * op->tolerance))) {
    return clt_fail(error, CLT_FAILED,
                    "T could not be inverted: %.1f %% of the light is left after %d iterations of %s; T is singular or "
                    "too noisy, so its bounces cannot be told apart",
                    100 * left, result.iterations, result.method);
  }
  if (residual != NULL) {
    *residual = left;
  }
  return CLT_OK;
}

/* A l = l - F y with T y = l. T y - F y is the same up to the solve's residual r, of which it keeps A r in place of
 * S^-1 r: less, as A smooths. At dark cells F = 0 and T y = C l. */
clt_status clt_interreflection_apply(clt_interreflection *op, const double *light, double *next, double *residual,
                                     clt_error *error) {
  clt_status status = clt_interreflection_check(op, light, "light", error);
  if (status == CLT_OK) {
    status = clt_interreflection_solve(op, light, residual, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  size_t values = clt_interreflection_values(op);
  for (size_t i = 0; i < values; i++) {
    next[i] = op->seen[i] - op->first_bounce[i] * op->drive[i];
  }
  return CLT_OK;
}
