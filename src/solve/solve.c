/* Which method runs, in what order, and what is told of it. */
#include "counterlight/solve.h"

#include <math.h>
#include <stdio.h>

#include "base/clock.h"
#include "solve/job.h"

/* Ordered so that a later one takes over where an earlier one does not serve. */
static const clt_method *const METHODS[] = {&clt_method_jacobi, &clt_method_pcg, &clt_method_gmres,
                                            &clt_method_bounded};
enum { METHOD_COUNT = sizeof METHODS / sizeof METHODS[0] };

static const double DEFAULT_TOLERANCE = 1e-4;
enum { DEFAULT_ITERATION_LIMIT = 1000 };
static const double CLIP_SLACK = 1e-9; /* a drive this far outside 0..1 counts as inside */

const char *clt_method_name(size_t index) {
  return index < METHOD_COUNT ? METHODS[index]->name : NULL;
}

const char *clt_method_summary(size_t index) {
  return index < METHOD_COUNT ? METHODS[index]->summary : NULL;
}

const clt_method *clt_method_linear(double reciprocity) {
  return reciprocity <= CLT_RECIPROCAL ? &clt_method_pcg : &clt_method_gmres;
}

static int method_index(const clt_method *method) {
  int index = 0;
  while (METHODS[index] != method) {
    index++;
  }
  return index;
}

static clt_status find_method(clt_job *job, clt_error *error) {
  const char *name = job->options.method;
  job->automatic = name == NULL || strcmp(name, "auto") == 0;
  if (job->automatic) {
    job->method = job->info.rows == job->info.cols
                      ? clt_method_linear(clt_certificate_worst(job->certificate).reciprocity)
                      : &clt_method_bounded;
    return CLT_OK;
  }
  char known[CLT_MESSAGE_MAX / 2] = "auto";
  for (size_t i = 0; i < METHOD_COUNT; i++) {
    if (strcmp(METHODS[i]->name, name) == 0) {
      job->method = METHODS[i];
      return CLT_OK;
    }
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, ", %s", METHODS[i]->name);
  }
  return clt_fail(error, CLT_BAD_INPUT, "there is no method \"%.40s\"; use one of: %s", name, known);
}

static clt_status check_method(const clt_job *job, clt_error *error) {
  if (!job->method->bounded && job->info.rows != job->info.cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s needs as many observed cells as drive cells, but this transport has %zu rows and %zu columns; "
                    "use bounded",
                    job->method->name, job->info.rows, job->info.cols);
  }
  for (int c = 0; job->method->check != NULL && c < job->info.channels; c++) {
    clt_status status = job->method->check(clt_certificate_channel(job->certificate, c), error);
    if (status != CLT_OK) {
      return status;
    }
  }
  return CLT_OK;
}

/* Checks the options and puts the defaults in. */
static clt_status check_options(clt_job *job, clt_error *error) {
  clt_solve_options *options = &job->options;
  if (!(options->tolerance >= 0) || !isfinite(options->tolerance)) {
    return clt_fail(error, CLT_BAD_INPUT, "the tolerance %g is not a positive number; use one like 1e-4",
                    options->tolerance);
  }
  if (options->iteration_limit < 0) {
    return clt_fail(error, CLT_BAD_INPUT, "the iteration limit %d is negative; use one like %d, or 0 for that",
                    options->iteration_limit, DEFAULT_ITERATION_LIMIT);
  }
  if (isnan(options->deadline_s)) {
    return clt_fail(error, CLT_BAD_INPUT, "the deadline is not a number; use seconds, or 0 for none");
  }
  options->tolerance = options->tolerance > 0 ? options->tolerance : DEFAULT_TOLERANCE;
  options->iteration_limit = options->iteration_limit > 0 ? options->iteration_limit : DEFAULT_ITERATION_LIMIT;
  return CLT_OK;
}

static clt_status check_finite(const double *values, size_t count, const char *what, clt_error *error) {
  static const double GREATEST = 1e150; /* squares stay finite */
  for (size_t i = 0; i < count; i++) {
    if (!(fabs(values[i]) <= GREATEST)) {
      return clt_fail(error, CLT_BAD_INPUT, "value %zu of the %s is %g; every value must be a finite number", i, what,
                      values[i]);
    }
  }
  return CLT_OK;
}

static clt_status check_job(clt_job *job, const clt_transport *transport, const double *wanted, clt_error *error) {
  if (!clt_certificate_fits(job->certificate, transport)) {
    return clt_fail(error, CLT_BAD_INPUT, "the certificate was made for another transport; certify this one first");
  }
  size_t channels = (size_t)job->info.channels;
  clt_status status = check_options(job, error);
  if (status == CLT_OK) {
    status = find_method(job, error);
  }
  if (status == CLT_OK) {
    status = check_method(job, error);
  }
  if (status == CLT_OK) {
    status = check_finite(wanted, channels * job->info.rows, "target", error);
  }
  if (status == CLT_OK && job->options.start != NULL) {
    status = check_finite(job->options.start, channels * job->info.cols, "start drive", error);
  }
  return status;
}

static void select_channel(clt_job *job, int c, const double *wanted) {
  clt_system *system = &job->system;
  size_t cols = job->info.cols;
  clt_system_select(system, c, clt_certificate_first_bounce(job->certificate, c),
                    clt_certificate_lit(job->certificate, c));
  system->flux = clt_certificate_flux(job->certificate, c);
  system->reciprocity = clt_certificate_channel(job->certificate, c)->reciprocity;
  clt_system_want(system, wanted + (size_t)c * job->info.rows);
  for (size_t j = 0; job->options.start != NULL && j < cols; j++) {
    system->light[j] = system->lit[j] ? job->options.start[(size_t)c * cols + j] * system->first_bounce[j] : 0;
  }
}

/* Runs a method on the selected channel, and what replaces it where it breaks. */
static clt_outcome run_method(clt_job *job, const clt_method *method, clt_run *run, clt_error *error,
                              clt_status *status) {
  for (;;) {
    *status = clt_system_reserve(&job->system, method->vectors, error);
    if (*status != CLT_OK) {
      return CLT_RUN_STOPPED;
    }
    clt_outcome outcome = method->run(&job->system, run);
    if (method_index(method) > method_index(job->answer)) {
      job->answer = method;
    }
    if (outcome != CLT_RUN_BROKE) {
      return outcome;
    }
    const clt_method *next =
        method == &clt_method_jacobi ? clt_method_linear(job->system.reciprocity) : &clt_method_gmres;
    if (job->broken == NULL) {
      job->broken = method;
      memcpy(job->why, run->note, sizeof job->why);
    }
    job->replacement = next;
    method = next;
  }
}

static size_t count_outside(const clt_system *system) {
  size_t outside = 0;
  for (size_t j = 0; j < system->cols; j++) {
    double x = system->light[j] * system->scale[j];
    outside += x < -CLIP_SLACK || x > 1 + CLIP_SLACK;
  }
  return outside;
}

/* l to x; the methods that keep 0..1, and auto, end exactly inside. */
static void write_drive(const clt_job *job, double *drive) {
  const clt_system *system = &job->system;
  bool keep = job->automatic || job->method->bounded;
  for (size_t j = 0; j < system->cols; j++) {
    double x = system->lit[j] ? system->light[j] / system->first_bounce[j] : 0;
    drive[j] = keep ? fmin(fmax(x, 0), 1) : x;
  }
}

/* ||T x - b|| over lit rows. */
static double drive_residual(clt_system *system, const double *drive) {
  clt_transport_apply(system->transport, system->channel, drive, system->seen);
  double sum = 0;
  for (size_t i = 0; i < system->rows; i++) {
    double rest = clt_system_row_is_lit(system, i) ? system->seen[i] - system->wanted[i] : 0;
    sum += rest * rest;
  }
  return sqrt(sum);
}

/* The channels share the time that is left evenly. */
static double channel_deadline(const clt_job *job, int c) {
  if (job->options.deadline_s <= 0) {
    return 0;
  }
  double gone = clt_clock_since(job->start_ns);
  return gone + fmax(job->options.deadline_s - gone, 0) / (job->info.channels - c);
}

/* The second step of auto: an answer outside 0..1, or none to the tolerance, is the start of the bounded solve. */
static clt_outcome bound(clt_job *job, clt_run *run, clt_outcome outcome, clt_error *error, clt_status *status) {
  size_t outside = count_outside(&job->system);
  job->outside += outside;
  if (outside == 0 && outcome == CLT_RUN_CONVERGED) {
    return outcome;
  }
  if (!clt_run_may_go_on(run)) {
    return CLT_RUN_STOPPED;
  }
  job->stalled = job->stalled || outcome != CLT_RUN_CONVERGED;
  return run_method(job, &clt_method_bounded, run, error, status);
}

static clt_status solve_channel(clt_job *job, int c, const double *wanted, double *drive, bool *converged,
                                clt_error *error) {
  clt_system *system = &job->system;
  clt_run *run = &job->run[c];
  clt_status status = CLT_OK;
  clt_outcome outcome = CLT_RUN_CONVERGED;
  select_channel(job, c, wanted);
  *run = (clt_run){.tolerance = job->options.tolerance,
                   .iteration_limit = job->options.iteration_limit,
                   .start_ns = job->start_ns,
                   .deadline_s = channel_deadline(job, c),
                   .radius_high = clt_certificate_channel(job->certificate, c)->radius_high};
  if (system->wanted_norm > 0) {
    outcome = run_method(job, job->method, run, error, &status);
    if (status == CLT_OK && job->automatic && !job->method->bounded) {
      outcome = bound(job, run, outcome, error, &status);
    }
  } else {
    memset(system->light, 0, system->cols * sizeof(double));
    clt_run_open(run, 0);
  }
  job->lit += clt_certificate_channel(job->certificate, c)->lit;
  job->wanted_norm[c] = system->wanted_norm;
  write_drive(job, drive + (size_t)c * system->cols);
  job->residual[c] = drive_residual(system, drive + (size_t)c * system->cols);
  *converged = outcome == CLT_RUN_CONVERGED;
  return status;
}

clt_status clt_solve(const clt_transport *transport, const clt_certificate *certificate, const double *wanted,
                     const clt_solve_options *options, double *drive, clt_solve_result *result, clt_error *error) {
  clt_job job = {.certificate = certificate, .info = clt_transport_describe(transport), .start_ns = clt_clock_ns()};
  if (options != NULL) {
    job.options = *options;
  }
  clt_status status = check_job(&job, transport, wanted, error);
  if (status != CLT_OK) {
    return status;
  }
  job.answer = job.method;
  status = clt_system_init(&job.system, transport, error);
  bool converged = true;
  for (int c = 0; status == CLT_OK && c < job.info.channels; c++) {
    bool channel_converged = false;
    status = solve_channel(&job, c, wanted, drive, &channel_converged, error);
    converged = converged && channel_converged;
  }
  if (status == CLT_OK) {
    clt_job_tell(&job, converged, result);
  }
  clt_system_finish(&job.system);
  return status;
}
