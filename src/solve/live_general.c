/* Moving pictures with any transport: the bounded method of the table, which takes products only. It allocates where
 * the method does, and serves small grids. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "solve/job.h"
#include "solve/live.h"

typedef struct general {
  clt_solver *solver;
  double *wanted, *start, *drive; /* channels * cols values each */
} general;

static size_t values_of(const clt_live *live) {
  return (size_t)live->info.channels * live->info.cols;
}

static clt_status create(clt_live *live, clt_error *error) {
  general *own = live->own = clt_alloc(1, sizeof *own);
  double *vectors = clt_alloc(values_of(live), 3 * sizeof *vectors);
  if (own == NULL || vectors == NULL) {
    free(vectors);
    return clt_fail(error, CLT_FAILED, "no memory for moving pictures of %zu cells", live->info.cols);
  }
  *own = (general){.wanted = vectors, .start = vectors + values_of(live), .drive = vectors + 2 * values_of(live)};
  const clt_solve_options options = {.method = "bounded", .tolerance = live->options.target_error, .together = true};
  return clt_solver_create(live->transport, live->certificate, &options, &own->solver, error);
}

static void destroy(clt_live *live) {
  general *own = live->own;
  if (own != NULL) {
    clt_solver_destroy(own->solver);
    free(own->wanted);
    free(own);
  }
}

static void reset(clt_live *live) {
  general *own = live->own;
  memset(own->start, 0, values_of(live) * sizeof *own->start);
}

static void tell(clt_live *live, const clt_solve_result *solve, double wanted, double size, clt_live_result *result) {
  const general *own = live->own;
  size_t lit = 0, clipped = 0;
  for (int c = 0; c < live->info.channels; c++) {
    const unsigned char *takes_part = clt_certificate_lit(live->certificate, c);
    const double *drive = own->drive + (size_t)c * live->info.cols;
    for (size_t j = 0; j < live->info.cols; j++) {
      lit += takes_part[j];
      clipped += takes_part[j] && (drive[j] <= 0 || drive[j] >= 1);
    }
  }
  result->residual = solve->residual * wanted / size;
  result->clipped_fraction = lit > 0 ? (double)clipped / (double)lit : 0;
  result->steps = solve->iterations;
  result->converged = solve->converged;
  result->ms[CLT_LIVE_SOLVE] = 1e3 * solve->method_seconds;
  result->ms[CLT_LIVE_ESTIMATE] = 1e3 * (solve->seconds - solve->method_seconds);
  live->seen = wanted / size + result->residual;
}

/* Fills what is wanted and returns its norm over lit cells; *size = ||target||^2 over these. */
static double want(clt_live *live, const float *target, double *size) {
  general *own = live->own;
  double sum = 0;
  *size = 0;
  for (int c = 0; c < live->info.channels; c++) {
    const float *black = clt_transport_black(live->transport, c);
    const unsigned char *lit = clt_certificate_lit(live->certificate, c);
    for (size_t i = 0; i < live->info.cols; i++) {
      const size_t at = (size_t)c * live->info.cols + i;
      own->wanted[at] = (double)target[at] - (double)black[i];
      sum += lit[i] ? own->wanted[at] * own->wanted[at] : 0;
      *size += (double)target[at] * (lit[i] ? (double)target[at] : 0); /* finite values only */
    }
  }
  return sqrt(sum);
}

static clt_status solve_frame(clt_live *live, const float *target, float *drive, clt_live_result *result,
                              clt_error *error) {
  general *own = live->own;
  clt_solve_result solve = {0};
  double size = 0;
  const double wanted = want(live, target, &size);
  clt_status status = clt_live_measure(live, size, error);
  if (status != CLT_OK) {
    return status;
  }
  result->ms[CLT_LIVE_PREPARE] = 1e3 * clt_clock_since(live->start_ns);
  own->solver->options.deadline_s = 1e-3 * live->options.budget_ms;
  status = clt_solver_run(own->solver, own->wanted, own->start, own->drive, &solve, error);
  if (status == CLT_OK) {
    memcpy(own->start, own->drive, values_of(live) * sizeof *own->drive);
    tell(live, &solve, wanted, live->size, result);
  }
  for (size_t at = 0; at < values_of(live); at++) {
    drive[at] = (float)own->start[at];
  }
  return status;
}

const clt_live_form clt_live_general = {create, destroy, reset, solve_frame};
