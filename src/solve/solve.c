/* A solver: a method made ready for a transport, and one solve with it, system by system. */
#include "counterlight/solve.h"

#include <math.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"
#include "solve/choose.h"
#include "solve/job.h"

/* A drive that leaves 0..1 by this part of its largest value counts as inside; relative, since that of a dim picture is
 * small all over. */
static const double CLIP_SLACK = 1e-9;

static clt_status choose_method(clt_solver *solver, clt_error *error) {
  const char *name = solver->options.method;
  solver->automatic = name == NULL || strcmp(name, "auto") == 0;
  if (solver->automatic) {
    clt_choose_first(solver->certificate, &solver->info, &solver->options, &solver->choice);
    solver->method = solver->choice.method;
    return CLT_OK;
  }
  clt_status status = clt_choose_named(name, &solver->method, error);
  return status != CLT_OK ? status : clt_choose_check(solver->method, solver->certificate, &solver->info, error);
}

/* Sums the variances over the lit rows of each system. */
static void measure_noise(clt_solver *solver) {
  double observed = solver->options.noise * solver->options.noise;
  size_t rows = solver->info.rows;
  for (int c = 0; c < solver->info.channels && solver->options.discrepancy; c++) {
    clt_noise *noise = &solver->noise[solver->systems > 1 ? c : 0];
    const float *sigma = clt_transport_sigma(solver->transport, c);
    const unsigned char *lit = clt_certificate_lit(solver->certificate, c);
    for (size_t i = 0; i < rows; i++) {
      bool counts = !solver->system.square || lit[i];
      double entry = sigma != NULL ? (double)sigma[i] : 0;
      noise->observed += counts ? observed : 0;
      noise->entries[solver->systems > 1 ? 0 : c] += counts && isfinite(entry) ? entry * entry : 0;
    }
  }
}

/* Turns to system number k: a channel, or all together. */
static void select_system(clt_solver *solver, int k) {
  clt_system *system = &solver->system;
  clt_system_select(system, k, clt_certificate_first_bounce(solver->certificate, k),
                    clt_certificate_lit(solver->certificate, k));
  system->flux = clt_certificate_flux(solver->certificate, k);
  system->flood = clt_certificate_flood(solver->certificate, k);
  system->reflood = clt_certificate_reflood(solver->certificate, k);
  system->reciprocity = solver->systems > 1 ? clt_certificate_channel(solver->certificate, k)->reciprocity
                                            : clt_certificate_worst(solver->certificate).reciprocity;
}

/* Makes the method ready for the selected system: at once where it already is. */
static clt_status prepare_method(clt_solver *solver, const clt_method *method, clt_error *error) {
  clt_system *system = &solver->system;
  clt_status status = clt_system_reserve(system, method->vectors, error);
  system->prepared = NULL;
  if (status != CLT_OK || method->prepare == NULL) {
    return status;
  }
  clt_preparation *preparation = solver->preparations;
  while (preparation != NULL && (preparation->method != method || preparation->channel != system->channel)) {
    preparation = preparation->next;
  }
  if (preparation == NULL) {
    int64_t start_ns = clt_clock_ns();
    preparation = clt_alloc(1, sizeof *preparation);
    if (preparation == NULL) {
      return clt_fail(error, CLT_FAILED, "not enough memory to make %s ready", method->name);
    }
    *preparation = (clt_preparation){.next = solver->preparations, .method = method, .channel = system->channel};
    solver->preparations = preparation;
    status = method->prepare(system, &preparation->kept, error);
    solver->prepare_s += clt_clock_since(start_ns);
  }
  system->prepared = preparation->kept;
  return status;
}

static clt_status prepare_all(clt_solver *solver, clt_error *error) {
  clt_status status = CLT_OK;
  for (int k = 0; k < solver->systems && status == CLT_OK; k++) {
    select_system(solver, k);
    status = prepare_method(solver, solver->method, error);
  }
  return status;
}

clt_status clt_solver_create(const clt_transport *transport, const clt_certificate *certificate,
                             const clt_solve_options *options, clt_solver **out, clt_error *error) {
  if (!clt_certificate_fits(certificate, transport)) {
    return clt_fail(error, CLT_BAD_INPUT, "the certificate was made for another transport; certify this one first");
  }
  clt_solver *solver = clt_alloc(1, sizeof *solver);
  if (solver == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a solver");
  }
  solver->transport = transport;
  solver->certificate = certificate;
  solver->info = clt_transport_describe(transport);
  solver->options = options != NULL ? *options : (clt_solve_options){0};
  clt_status status = clt_solver_check_options(&solver->options, error);
  if (status == CLT_OK) {
    status = choose_method(solver, error);
  }
  if (status == CLT_OK) {
    bool together = solver->options.together && !solver->method->apart;
    solver->systems = together ? 1 : solver->info.channels;
    status = clt_system_init(&solver->system, transport, together, error);
    solver->system.tolerance = solver->options.tolerance;
  }
  if (status == CLT_OK) {
    measure_noise(solver);
    status = prepare_all(solver, error);
  }
  if (status != CLT_OK) {
    clt_solver_destroy(solver);
    return status;
  }
  *out = solver;
  return CLT_OK;
}

void clt_solver_destroy(clt_solver *solver) {
  if (solver == NULL) {
    return;
  }
  for (clt_preparation *of = solver->preparations, *next; of != NULL; of = next) {
    next = of->next;
    of->method->release(of->kept);
    free(of);
  }
  clt_system_finish(&solver->system);
  free(solver);
}

static bool is_finite(const clt_system *system) {
  return isfinite(clt_norm(system->cols, system->light));
}

/* Runs a method on the selected system, and what replaces it where it breaks. */
static clt_status run_method(clt_job *job, const clt_method *method, clt_run *run, clt_outcome *outcome,
                             clt_error *error) {
  clt_system *system = &job->solver->system;
  for (;;) {
    clt_status status = prepare_method(job->solver, method, error);
    if (status != CLT_OK) {
      return status;
    }
    int64_t start_ns = clt_clock_ns();
    *outcome = method->run(system, run);
    job->method_s += clt_clock_since(start_ns);
    if (method != job->solver->method && job->answer != &clt_method_bounded) {
      job->answer = method; /* what any system needed beyond the first method is told of all */
    }
    if (!is_finite(system)) {
      clt_run_note(run, "it gave a value that is not finite");
      memset(system->light, 0, system->cols * sizeof(double));
      *outcome = method == clt_choose_last(system) ? CLT_RUN_STOPPED : CLT_RUN_BROKE;
    }
    if (*outcome != CLT_RUN_BROKE) {
      return CLT_OK;
    }
    if (job->broken == NULL) {
      job->broken = method;
      memcpy(job->why, run->note, sizeof job->why);
    }
    method = job->replacement = clt_choose_next(method, system);
  }
}

static size_t count_outside(const clt_system *system) {
  size_t outside = 0;
  double largest = 0;
  for (size_t j = 0; j < system->cols; j++) {
    largest = fmax(largest, fabs(system->light[j] * system->scale[j]));
  }
  double slack = CLIP_SLACK * fmin(largest, 1);
  for (size_t j = 0; j < system->cols; j++) {
    double x = system->light[j] * system->scale[j];
    outside += x < -slack || x > 1 + slack;
  }
  return outside;
}

/* l to x; the methods that keep 0..1, and auto, end exactly inside. */
static void write_drive(const clt_solver *solver, double *drive) {
  const clt_system *system = &solver->system;
  bool keep = solver->automatic || solver->method->bounded;
  for (size_t j = 0; j < system->cols; j++) {
    double x = system->lit[j] ? system->light[j] / system->first_bounce[j] : 0;
    drive[j] = keep ? fmin(fmax(x, 0), 1) : x;
  }
}

/* ||T x - b|| over lit rows. */
static double drive_residual(clt_system *system, const double *drive) {
  clt_system_drive_residual(system, drive, system->seen);
  return clt_norm(system->rows, system->seen);
}

/* The systems share the time that is left evenly. */
static double system_deadline(const clt_job *job, int k) {
  if (job->solver->options.deadline_s <= 0) {
    return 0;
  }
  double gone = clt_clock_since(job->start_ns);
  return gone + fmax(job->solver->options.deadline_s - gone, 0) / (job->solver->systems - k);
}

/* The second step of auto: an answer outside 0..1, or none to the tolerance, is the start of the bounded solve. */
static clt_status bound(clt_job *job, clt_run *run, clt_outcome *outcome, clt_error *error) {
  size_t outside = count_outside(&job->solver->system);
  job->outside += outside;
  if (outside == 0 && *outcome == CLT_RUN_CONVERGED) {
    return CLT_OK;
  }
  if (!clt_run_may_go_on(run)) {
    *outcome = CLT_RUN_STOPPED;
    return CLT_OK;
  }
  job->stalled = job->stalled || *outcome != CLT_RUN_CONVERGED;
  return run_method(job, &clt_method_bounded, run, outcome, error);
}

static size_t count_lit(const clt_system *system) {
  size_t lit = 0;
  for (size_t j = 0; j < system->cols; j++) {
    lit += system->lit[j] != 0;
  }
  return lit;
}

/* The system's start: the given drive at its lit cells. */
static void take_start(const clt_job *job, int k) {
  clt_system *system = &job->solver->system;
  for (size_t j = 0; job->start != NULL && j < system->cols; j++) {
    system->light[j] = system->lit[j] ? job->start[(size_t)k * system->cols + j] * system->first_bounce[j] : 0;
  }
}

/* True where what the method says of its residual is taken for it: the bounded ones say something else. */
static bool is_trusted(const clt_job *job, clt_outcome outcome, bool bounded) {
  const clt_solver *solver = job->solver;
  return solver->options.trust && outcome == CLT_RUN_CONVERGED && !solver->method->bounded && !bounded;
}

static clt_status solve_system(clt_job *job, int k, const double *wanted, double *drive, bool *converged,
                               clt_error *error) {
  clt_solver *solver = job->solver;
  clt_system *system = &solver->system;
  clt_run *run = &job->run[k];
  clt_status status = CLT_OK;
  clt_outcome outcome = CLT_RUN_CONVERGED;
  long products = system->products;
  size_t outside = job->outside;
  select_system(solver, k);
  clt_system_want(system, wanted + (size_t)k * system->rows);
  take_start(job, k);
  *run = (clt_run){.tolerance = solver->options.tolerance,
                   .noise = solver->noise[k],
                   .iteration_limit = solver->options.iteration_limit,
                   .start_ns = job->start_ns,
                   .deadline_s = system_deadline(job, k),
                   .radius_high = solver->systems > 1 ? clt_certificate_channel(solver->certificate, k)->radius_high
                                                      : clt_certificate_worst(solver->certificate).radius_high};
  if (system->wanted_norm > 0) {
    status = run_method(job, solver->method, run, &outcome, error);
    if (status == CLT_OK && solver->automatic && !solver->method->bounded) {
      status = bound(job, run, &outcome, error);
    }
  } else {
    memset(system->light, 0, system->cols * sizeof(double));
    clt_run_open(run, 0);
  }
  job->lit += count_lit(system);
  job->wanted_norm[k] = system->wanted_norm;
  job->products[k] = system->products - products;
  write_drive(solver, drive + (size_t)k * system->cols);
  job->residual[k] = is_trusted(job, outcome, job->outside > outside || job->stalled)
                         ? run->norm
                         : drive_residual(system, drive + (size_t)k * system->cols);
  *converged = outcome == CLT_RUN_CONVERGED;
  return status;
}

clt_status clt_solver_run(clt_solver *solver, const double *wanted, const double *start, double *drive,
                          clt_solve_result *result, clt_error *error) {
  size_t channels = (size_t)solver->info.channels;
  clt_job job = {.solver = solver, .start = start, .start_ns = clt_clock_ns(), .answer = solver->method};
  clt_status status = clt_solver_check_finite(wanted, channels * solver->info.rows, "target", error);
  if (status == CLT_OK && start != NULL) {
    status = clt_solver_check_finite(start, channels * solver->info.cols, "start drive", error);
  }
  bool converged = true;
  for (int k = 0; status == CLT_OK && k < solver->systems; k++) {
    bool one = false;
    status = solve_system(&job, k, wanted, drive, &one, error);
    converged = converged && one;
  }
  if (status == CLT_OK) {
    clt_job_tell(&job, converged, result);
  }
  return status;
}

clt_status clt_solve(const clt_transport *transport, const clt_certificate *certificate, const double *wanted,
                     const clt_solve_options *options, double *drive, clt_solve_result *result, clt_error *error) {
  clt_solver *solver = NULL;
  clt_status status = clt_solver_create(transport, certificate, options, &solver, error);
  if (status == CLT_OK) {
    status = clt_solver_run(solver, wanted, options != NULL ? options->start : NULL, drive, result, error);
  }
  clt_solver_destroy(solver);
  return status;
}
