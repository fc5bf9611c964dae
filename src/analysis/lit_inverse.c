#include "analysis/lit_inverse.h"

#include <lapacke.h>
#include <stdlib.h>

#include "base/memory.h"
#include "counterlight/analysis.h"

/* The lit rows and columns of T. row: a value for each cell. */
static clt_status gather(clt_lit_inverse *inverse, const clt_transport *transport, int channel, double *row,
                         clt_error *error) {
  size_t count = inverse->count;
  clt_status status = CLT_OK;
  for (size_t i = 0; i < count && status == CLT_OK; i++) {
    status = clt_transport_row(transport, channel, inverse->cell[i], row, error);
    for (size_t j = 0; j < count && status == CLT_OK; j++) {
      inverse->entries[i * count + j] = row[inverse->cell[j]];
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
                        "T has no inverse (LAPACK says %d): it is singular, or noise is all there is of some cells",
                        (int)failed);
}

static clt_status fill(clt_lit_inverse *inverse, const clt_transport *transport, int channel, clt_error *error) {
  size_t cells = clt_transport_describe(transport).cols, count = inverse->count;
  double *row = clt_alloc(cells, sizeof *row);
  lapack_int *pivots = clt_alloc(cells, sizeof *pivots);
  inverse->entries = clt_alloc(count * count, sizeof *inverse->entries);
  clt_status status = CLT_OK;
  if (row == NULL || pivots == NULL || inverse->entries == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory to invert T over %zu cells", count);
  }
  if (status == CLT_OK) {
    status = gather(inverse, transport, channel, row, error);
  }
  if (status == CLT_OK && count > 0) {
    status = invert(inverse->entries, pivots, count, error);
  }
  free(row);
  free(pivots);
  return status;
}

clt_status clt_lit_inverse_init(clt_lit_inverse *inverse, const clt_transport *transport, int channel,
                                const unsigned char *lit, clt_error *error) {
  size_t cells = clt_transport_describe(transport).cols;
  inverse->cell = clt_alloc(cells, sizeof *inverse->cell);
  if (inverse->cell == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a list of %zu cells", cells);
  }
  for (size_t i = 0; i < cells; i++) {
    if (lit[i]) {
      inverse->cell[inverse->count++] = i;
    }
  }
  return inverse->count <= CLT_EXACT_CELLS_MAX
             ? fill(inverse, transport, channel, error)
             : clt_fail(error, CLT_BAD_INPUT,
                        "this needs the inverse of T over %zu lit cells, and %d are the most (%.0f MB)", inverse->count,
                        CLT_EXACT_CELLS_MAX, 8e-6 * CLT_EXACT_CELLS_MAX * CLT_EXACT_CELLS_MAX);
}

void clt_lit_inverse_finish(clt_lit_inverse *inverse) {
  free(inverse->cell);
  free(inverse->entries);
  *inverse = (clt_lit_inverse){0};
}
