/* Monte Carlo of the forward series (Bai et al. 2010, eq. 46): l_out = (I - A)^-1 l_d is the inverse series of S^-1 = I
 * - A in place of S, whose R = S^-1 - I = -A; so eq. 47's paths serve, and their signs (-1)^k cancel against A's. */
#include <stdlib.h>

#include "analysis/bounce_operator.h"
#include "base/memory.h"
#include "base/random.h"
#include "solve/paths.h"

enum { SAMPLES_MAX = 1000000 };

struct clt_forward_paths {
  clt_bounce_operator bounce; /* its count alone is read after the start */
  clt_paths paths;
};

/* matrix = I - A */
static clt_status fill(const clt_bounce_operator *bounce, clt_matrix *matrix, clt_error *error) {
  size_t count = matrix->count = bounce->count;
  clt_status status = CLT_OK;
  matrix->entries = clt_alloc(count * count, sizeof *matrix->entries);
  if (matrix->entries == NULL) {
    return clt_fail(error, CLT_FAILED, "montecarlo: not enough memory for %zu x %zu entries of A", count, count);
  }
  for (size_t i = 0; i < count && status == CLT_OK; i++) {
    double *row = matrix->entries + i * count;
    status = bounce->row(bounce->context, i, row, error);
    status = status == CLT_OK ? clt_bounce_check(row, count, error) : status;
    for (size_t j = 0; j < count; j++) {
      row[j] = (i == j) - row[j];
    }
  }
  return status;
}

clt_status clt_forward_paths_create(const clt_bounce_operator *bounce, clt_forward_paths **out, clt_error *error) {
  clt_matrix matrix = {0};
  if (bounce->row == NULL || bounce->count > CLT_MATRIX_CELLS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "montecarlo draws paths by the rows of A, %s; use the series or the iteration, which need products "
                    "only",
                    bounce->row == NULL ? "which this operator does not give"
                                        : "and these are too many for its tables");
  }
  clt_forward_paths *of = calloc(1, sizeof *of);
  if (of == NULL) {
    return clt_fail(error, CLT_FAILED, "montecarlo: not enough memory");
  }
  of->bounce = *bounce;
  clt_status status = fill(bounce, &matrix, error);
  if (status == CLT_OK) {
    status = clt_paths_init(&of->paths, &matrix, "light must fade from bounce to bounce, ||A|| < 1", error);
  }
  clt_matrix_finish(&matrix);
  if (status != CLT_OK) {
    clt_forward_paths_destroy(of);
    return status;
  }
  *out = of;
  return CLT_OK;
}

void clt_forward_paths_destroy(clt_forward_paths *paths) {
  if (paths != NULL) {
    clt_paths_finish(&paths->paths);
    free(paths);
  }
}

double clt_forward_paths_ratio(const clt_forward_paths *paths) {
  return paths->paths.ratio;
}

clt_status clt_forward_paths_estimate(const clt_forward_paths *paths, const double *direct, int samples, uint64_t seed,
                                      double *light, double *deviation, clt_error *error) {
  if (samples < 1 || samples > SAMPLES_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%d paths a cell were asked for; 1 to %d can be drawn", samples, SAMPLES_MAX);
  }
  clt_status status = clt_forward_check(&paths->bounce, direct, error);
  if (status == CLT_OK) {
    clt_paths_estimate(&paths->paths, direct, samples, clt_random_key(seed, 0), light, deviation);
  }
  return status;
}
