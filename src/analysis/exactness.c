/* Where A = I - F T^-1 is what bounces do: the exact F, and signs that the scene is not made of flat diffuse patches.
 */
#include <lapacke.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "analysis/interreflection.h"
#include "base/memory.h"

static const double SPREAD_LIMIT = 0.01, RECIPROCITY_LIMIT = 0.1;

/* The lit rows and columns of T, row-major, in double; index lists the lit cells. */
static clt_status gather_lit(const clt_transport *transport, int channel, const size_t *index, size_t count,
                             double *row, double *matrix, clt_error *error) {
  clt_status status = CLT_OK;
  for (size_t i = 0; i < count && status == CLT_OK; i++) {
    status = clt_transport_row(transport, channel, index[i], row, error);
    for (size_t j = 0; j < count && status == CLT_OK; j++) {
      matrix[i * count + j] = row[index[j]];
    }
  }
  return status;
}

static clt_status invert(double *matrix, lapack_int *pivots, size_t count, clt_error *error) {
  lapack_int n = (lapack_int)count;
  lapack_int failed = LAPACKE_dgetrf(LAPACK_ROW_MAJOR, n, n, matrix, n, pivots);
  if (failed == 0) {
    failed = LAPACKE_dgetri(LAPACK_ROW_MAJOR, n, matrix, n, pivots);
  }
  return failed == 0
             ? CLT_OK
             : clt_fail(error, CLT_BAD_INPUT,
                        "T has no inverse (LAPACK says %d), so F cannot come from its diagonal; take F = diag(T)",
                        (int)failed);
}

static clt_status take_reciprocals(const double *inverse, const size_t *index, size_t count, double *first_bounce,
                                   clt_error *error) {
  for (size_t i = 0; i < count; i++) {
    double diagonal = inverse[i * count + i];
    if (!(diagonal > 0) || !isfinite(diagonal)) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "(T^-1)_ii of cell %zu is %g; T is too noisy there for an exact first "
                      "bounce; take F = diag(T)",
                      index[i], diagonal);
    }
    first_bounce[index[i]] = 1 / diagonal;
  }
  return CLT_OK;
}

clt_status clt_exact_first_bounce(const clt_transport *transport, int channel, const unsigned char *lit,
                                  double *first_bounce, clt_error *error) {
  size_t cells = clt_transport_describe(transport).cols, count = 0;
  for (size_t i = 0; i < cells; i++) {
    count += lit[i] != 0;
  }
  if (count > CLT_EXACT_CELLS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the exact first bounce needs the inverse of T over %zu lit cells, and %d are the most (%.0f MB); "
                    "take F = diag(T)",
                    count, CLT_EXACT_CELLS_MAX, 8e-6 * CLT_EXACT_CELLS_MAX * CLT_EXACT_CELLS_MAX);
  }
  double *row = clt_alloc(cells, sizeof *row), *matrix = clt_alloc(count * count, sizeof *matrix);
  size_t *index = clt_alloc(cells, sizeof *index), found = 0;
  lapack_int *pivots = clt_alloc(cells, sizeof *pivots);
  clt_status status = CLT_OK;
  if (!row || !matrix || !index || !pivots) {
    status = clt_fail(error, CLT_FAILED, "not enough memory to invert T over %zu cells; take F = diag(T)", count);
  }
  for (size_t i = 0; i < cells && status == CLT_OK; i++) {
    if (lit[i]) {
      index[found++] = i;
    }
  }
  if (status == CLT_OK) {
    status = gather_lit(transport, channel, index, count, row, matrix, error);
  }
  if (status == CLT_OK && count > 0) {
    status = invert(matrix, pivots, count, error);
  }
  if (status == CLT_OK) {
    status = take_reciprocals(matrix, index, count, first_bounce, error);
  }
  free(row);
  free(matrix);
  free(index);
  free(pivots);
  return status;
}

static int compare_numbers(const void *left, const void *right) {
  double a = *(const double *)left, b = *(const double *)right;
  return (a > b) - (a < b);
}

/* -median of z_i (R z)_i over the lit cells of a channel, z a checkerboard of +1 and -1, R = T diag(T)^-1 - I. What R
 * carries smoothly cancels against the signs; what stays near its cell is weighed with -1 by the four neighbours. The
 * median leaves out folds, where surfaces meet and cells do light their neighbours. */
static double channel_spread(clt_interreflection *op, int c) {
  size_t width = (size_t)op->info.width, cells = op->info.cells, count = 0;
  const unsigned char *lit = clt_certificate_lit(op->certificate, c);
  const double *diagonal = clt_certificate_first_bounce(op->certificate, c);
  for (size_t i = 0; i < cells; i++) {
    double sign = (i % width + i / width) % 2 ? -1 : 1;
    op->drive[i] = lit[i] ? sign / diagonal[i] : 0;
  }
  clt_transport_apply(op->transport, c, op->drive, op->seen);
  for (size_t i = 0; i < cells; i++) {
    double sign = (i % width + i / width) % 2 ? -1 : 1;
    if (lit[i]) {
      op->seen[count++] = 1 - sign * op->seen[i];
    }
  }
  qsort(op->seen, count, sizeof *op->seen, compare_numbers);
  return count > 0 ? op->seen[count / 2] : 0;
}

void clt_judge_exactness(clt_interreflection *op) {
  clt_interreflection_info *info = &op->info;
  for (int c = 0; c < info->channels; c++) {
    double spread = channel_spread(op, c);
    info->spread = fabs(spread) > fabs(info->spread) ? spread : info->spread;
  }
  info->inexact = info->spread > SPREAD_LIMIT || info->reciprocity > RECIPROCITY_LIMIT;
  if (info->spread > SPREAD_LIMIT) {
    snprintf(
        info->why, sizeof info->why,
        "%.2g of a cell's light goes to the cells beside it (defocus, subsurface, a shifted grid; limit %g), which "
        "A_ii = 0 leaves out",
        info->spread, SPREAD_LIMIT);
  } else if (info->inexact) {
    snprintf(
        info->why, sizeof info->why,
        "T is not reciprocal (defect %.2g, limit %g): gloss or noise, and bounces are exact for diffuse light only",
        info->reciprocity, RECIPROCITY_LIMIT);
  }
}
