/* Monte Carlo with a final gather, repeated on what is left (Halton 1962) until the tolerance: every pass estimates
 * S^-1 r, of which one true product makes the gathered d = r - R d'. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/random.h"
#include "solve/paths.h"
#include "solve/refine.h"

enum {
  SEED = 20101025,
  SAMPLES = 30, /* of a cell in the first pass: the report's number; more where a pass gains little */
  SAMPLES_MAX = 1920
};
static const double GAIN = 0.5;        /* a pass that leaves more than this asks for twice the samples */
static const double TRUNCATION = 0.05; /* what the hybrid's iteration may leave out, as its last step's noise is more */

typedef struct montecarlo {
  size_t *cell; /* as in clt_matrix */
  clt_paths paths;
  double *in, *out, *last; /* over the listed cells */
  bool hybrid;

  /* of the run that goes on */
  clt_system *system;
  double before; /* the residual that the pass before began with */
  int samples;
  uint64_t pass;
} montecarlo;

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  if (channel->lit > 0 && channel->radius_low >= 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "montecarlo cannot serve here: rho(R) is in [%.3g, %.3g] and must be below 1, or the sum over path "
                    "lengths diverges (eq. 48 needs m < 1/2); use %s or auto",
                    channel->radius_low, channel->radius_high, clt_method_linear(channel->reciprocity)->name);
  }
  return CLT_OK;
}

static clt_status fill(montecarlo *of, clt_matrix *matrix, clt_error *error) {
  of->in = clt_alloc(matrix->count, sizeof *of->in);
  of->out = clt_alloc(matrix->count, sizeof *of->out);
  of->last = clt_alloc(matrix->count, sizeof *of->last);
  if (of->in == NULL || of->out == NULL || of->last == NULL) {
    return clt_fail(error, CLT_FAILED, "montecarlo: not enough memory for vectors of %zu cells", matrix->count);
  }
  of->cell = matrix->cell;
  matrix->cell = NULL;
  return clt_paths_init(&of->paths, matrix, "eq. 48 needs m < 1/2; use direct or auto", error);
}

static clt_status prepare_kind(clt_system *system, bool hybrid, void **prepared, clt_error *error) {
  montecarlo *of = *prepared = clt_alloc(1, sizeof *of);
  if (of == NULL) {
    return clt_fail(error, CLT_FAILED, "montecarlo: not enough memory");
  }
  of->hybrid = hybrid;
  clt_matrix matrix = {0};
  clt_status status = clt_matrix_init(&matrix, system, "montecarlo", error);
  if (status == CLT_OK) {
    status = fill(of, &matrix, error);
  }
  clt_matrix_finish(&matrix);
  return status;
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  return prepare_kind(system, false, prepared, error);
}

static clt_status prepare_hybrid(clt_system *system, void **prepared, clt_error *error) {
  return prepare_kind(system, true, prepared, error);
}

static void release(void *prepared) {
  montecarlo *of = prepared;
  if (of == NULL) {
    return;
  }
  clt_paths_finish(&of->paths);
  free(of->cell);
  free(of->in);
  free(of->out);
  free(of->last);
  free(of);
}

/* Steps after which what the iteration leaves out is TRUNCATION of its start. */
static int count_steps(double ratio) {
  return ratio > 0 ? 1 + (int)(log(TRUNCATION) / log(fmin(ratio, 0.99))) : 1;
}

/* d' estimates S^-1 r; d = r - R d' = d' + (r - S d') gathers. */
static void apply(void *context, const double *r, double *d) {
  montecarlo *of = context;
  clt_system *system = of->system;
  double *seen = clt_system_vector(system, CLT_REFINE_VECTORS);
  uint64_t key = clt_random_key(SEED, of->pass++);
  double norm = clt_norm(system->rows, r);
  of->samples = norm > GAIN * of->before && of->samples < SAMPLES_MAX ? 2 * of->samples : of->samples;
  of->before = norm;
  for (size_t k = 0; k < of->paths.count; k++) {
    of->in[k] = r[of->cell[k]];
  }
  if (of->hybrid) {
    clt_paths_hybrid(&of->paths, of->in, of->samples, count_steps(of->paths.ratio), key, of->last, of->out);
  } else {
    clt_paths_estimate(&of->paths, of->in, of->samples, key, of->out, NULL);
  }
  for (size_t k = 0; k < of->paths.count; k++) {
    d[of->cell[k]] = of->out[k];
  }
  clt_system_apply(system, d, seen);
  for (size_t j = 0; j < system->cols; j++) {
    d[j] += r[j] - seen[j];
  }
}

static clt_outcome run_montecarlo(clt_system *system, clt_run *run) {
  montecarlo *of = system->prepared;
  clt_inverse inverse = {.apply = apply, .context = of};
  of->system = system;
  of->before = INFINITY;
  of->samples = SAMPLES;
  of->pass = 0;
  memset(clt_system_vector(system, 2), 0, system->cols * sizeof(double)); /* d at the cells that `apply` leaves */
  return clt_refine(&inverse, system, run);
}

/* A pass leaves a share of the target that falls with the albedo and the samples (docs/solving.md); a sample takes some
 * dozens of operations a bounce. */
static void expect(clt_effort *effort) {
  static const double SHARE = 0.03, SAMPLE = 80, TABLE = 60;
  double rho = fmin(effort->channel->radius_high, 0.95), bounces = 1 / (1 - rho);
  clt_effort_steady(effort, fmin(SHARE * rho * bounces, 0.5));
  clt_effort_take(effort, 2, 2, SAMPLE * SAMPLES * bounces);
  effort->prepare_s = TABLE * (double)effort->model->cells * effort->model->vector_s;
}

const clt_method clt_method_montecarlo = {
    .name = "montecarlo",
    .summary =
        "paths drawn from the rows of R (eq. 47-50), 30 a cell, a final gather, and again on what is left; the same "
        "for any number of threads; where rho(R) < 1, up to 12288 lit cells",
    .apart = true,
    .invests = true,
    .vectors = CLT_REFINE_VECTORS + 1,
    .check = check,
    .prepare = prepare,
    .release = release,
    .expect = expect,
    .run = run_montecarlo,
};

const clt_method clt_method_hybrid = {
    .name = "hybrid",
    .summary =
        "the report's iteration with 30 columns drawn of each row (section 8), a final gather, and again on what is "
        "left; where rho(R) < 1, up to 12288 lit cells",
    .apart = true,
    .invests = true,
    .vectors = CLT_REFINE_VECTORS + 1,
    .check = check,
    .prepare = prepare_hybrid,
    .release = release,
    .expect = expect,
    .run = run_montecarlo,
};
