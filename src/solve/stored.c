#include "solve/stored.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

enum { WORTH_SHARING = 32768 /* entries that pay for waking threads */, LANES = 8 };

clt_status clt_stored_init(clt_stored *stored, clt_matrix *matrix, const char *method, clt_error *error) {
  stored->count = matrix->count;
  stored->cell = matrix->cell;
  matrix->cell = NULL;
  stored->in = clt_alloc(stored->count, sizeof *stored->in);
  stored->out = clt_alloc(stored->count, sizeof *stored->out);
  if (stored->in == NULL || stored->out == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: not enough memory for vectors of %zu cells", method, stored->count);
  }
  return CLT_OK;
}

void clt_stored_finish(clt_stored *stored) {
  free(stored->cell);
  free(stored->full);
  free(stored->single);
  free(stored->in);
  free(stored->out);
  *stored = (clt_stored){0};
}

/* Single entries, added in double. */
static double single_row(const float *row, const double *in, size_t count) {
  double sum[LANES] = {0}, rest = 0;
  size_t j = 0;
  for (; j + LANES <= count; j += LANES) {
    for (size_t lane = 0; lane < LANES; lane++) {
      sum[lane] += (double)row[j + lane] * in[j + lane];
    }
  }
  for (; j < count; j++) {
    rest += (double)row[j] * in[j];
  }
  for (int lane = 0; lane < LANES; lane++) {
    rest += sum[lane];
  }
  return rest;
}

/* d = (I - A) r */
static void apply(void *context, const double *r, double *d) {
  clt_stored *stored = context;
  size_t count = stored->count;
  for (size_t k = 0; k < count; k++) {
    stored->in[k] = r[stored->cell[k]];
  }
#pragma omp parallel for schedule(static) if (count * count >= WORTH_SHARING)
  for (size_t k = 0; k < count; k++) {
    stored->out[k] = stored->single != NULL ? single_row(stored->single + k * count, stored->in, count)
                                            : clt_dot(count, stored->full + k * count, stored->in);
  }
  for (size_t k = 0; k < count; k++) {
    d[stored->cell[k]] = stored->in[k] - stored->out[k];
  }
}

static double bound(void *context, const double *l, double norm) {
  (void)l;
  return ((const clt_stored *)context)->rest * norm;
}

clt_outcome clt_stored_run(clt_stored *stored, clt_system *system, clt_run *run) {
  clt_inverse inverse = {.apply = apply, .bound = bound, .context = stored};
  memset(clt_system_vector(system, 2), 0, system->cols * sizeof(double)); /* d at the cells that `apply` leaves */
  return clt_refine(&inverse, system, run);
}

double clt_norm_bound(const double *entries, size_t count, double *column_sums) {
  double most_row = 0, most_column = 0;
  memset(column_sums, 0, count * sizeof *column_sums);
  for (size_t i = 0; i < count; i++) {
    double row = 0;
    for (size_t j = 0; j < count; j++) {
      double size = fabs(entries[i * count + j]);
      row += size;
      column_sums[j] += size;
    }
    most_row = fmax(most_row, row);
  }
  for (size_t j = 0; j < count; j++) {
    most_column = fmax(most_column, column_sums[j]);
  }
  return sqrt(most_row * most_column);
}
