/* What a solve reports of itself. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "base/clock.h"
#include "solve/job.h"

static double norm_of(const double *values, int count) {
  double sum = 0;
  for (int i = 0; i < count; i++) {
    sum += values[i] * values[i];
  }
  return sqrt(sum);
}

/* The channels' curves together; a channel that has stopped keeps its last residual. */
static void combine_curves(const clt_job *job, double wanted_norm, clt_solve_result *result) {
  for (int c = 0; c < job->solver->systems; c++) {
    if (job->run[c].curve_count > result->curve_count) {
      result->curve_count = job->run[c].curve_count;
    }
  }
  for (size_t k = 0; k < result->curve_count; k++) {
    double rests[CLT_CHANNELS_MAX];
    for (int c = 0; c < job->solver->systems; c++) {
      size_t count = job->run[c].curve_count;
      rests[c] = job->run[c].curve[k < count ? k : count - 1];
    }
    result->curve[k] = wanted_norm > 0 ? norm_of(rests, job->solver->systems) / wanted_norm : 0;
  }
}

static void add_text(char *text, size_t size, const char *format, ...) CLT_PRINTF(3, 4);
static void add_text(char *text, size_t size, const char *format, ...) {
  size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text + used, size - used, format, arguments);
  va_end(arguments);
}

/* The bounds that decide which methods serve, and the figures that decide between those. */
static void tell_choice(const clt_solver *solver, char *text, size_t size) {
  clt_channel_certificate worst = clt_certificate_worst(solver->certificate);
  const clt_choice *choice = &solver->choice;
  add_text(text, size, "reciprocity defect %.2g and rho(R) in [%.2g, %.2g]: %s, %d iterations and %.3g ms expected",
           worst.reciprocity, worst.radius_low, worst.radius_high, choice->method->name, choice->expected.iterations,
           1e3 * choice->expected.seconds);
  if (choice->expected.residual > solver->options.tolerance) {
    add_text(text, size, " to come to %.2g in time", choice->expected.residual);
  }
  if (choice->next != NULL) {
    add_text(text, size, " (%s: %d and %.3g ms)", choice->next->name, choice->next_expected.iterations,
             1e3 * choice->next_expected.seconds);
  }
}

static void tell_reason(const clt_job *job, clt_solve_result *result) {
  char *text = result->reason;
  size_t size = sizeof result->reason;
  if (!job->solver->automatic) {
    add_text(text, size, "%s was asked for", job->solver->method->name);
  } else if (job->solver->info.rows != job->solver->info.cols) {
    add_text(text, size, "%zu rows for %zu columns: bounded least squares", job->solver->info.rows,
             job->solver->info.cols);
  } else {
    tell_choice(job->solver, text, size);
  }
  if (job->broken != NULL) {
    add_text(text, size, "; %s stopped as %s, so %s", job->broken->name, job->why, job->replacement->name);
  }
  if (job->stalled) {
    add_text(text, size, "; it did not reach the tolerance");
  }
  if (job->outside > 0) {
    const char *then = job->answer == &clt_method_bounded ? "so the bounded optimum was sought from there"
                                                          : "and were clipped as time was up";
    add_text(text, size, "; %.2g %% of the cells left 0..1, %s", 100 * (double)job->outside / (double)job->lit, then);
  }
}

void clt_job_tell(const clt_job *job, bool converged, clt_solve_result *result) {
  double wanted_norm = norm_of(job->wanted_norm, job->solver->systems);
  *result = (clt_solve_result){.converged = converged,
                               .seconds = clt_clock_since(job->start_ns),
                               .method_seconds = job->method_s,
                               .prepare_seconds = job->solver->prepare_s};
  double residual = norm_of(job->residual, job->solver->systems);
  result->residual = wanted_norm > 0 ? residual / wanted_norm : 0;
  for (int c = 0; c < job->solver->systems; c++) {
    if (job->run[c].iterations > result->iterations) {
      result->iterations = job->run[c].iterations;
    }
    if (job->products[c] > result->products) {
      result->products = job->products[c];
    }
  }
  combine_curves(job, wanted_norm, result);
  snprintf(result->method, sizeof result->method, "%s", job->answer->name);
  tell_reason(job, result);
}
