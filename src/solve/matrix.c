#include "solve/matrix.h"

#include <stdlib.h>

#include "base/memory.h"

static void list_lit(clt_matrix *matrix, const clt_system *system) {
  size_t count = 0;
  for (size_t j = 0; j < system->cols; j++) {
    if (system->lit[j]) {
      matrix->cell[count++] = j;
    }
  }
  matrix->count = count;
}

static clt_status take_rows(clt_matrix *matrix, const clt_system *system, double *row, clt_error *error) {
  clt_status status = CLT_OK;
  for (size_t i = 0; i < matrix->count && status == CLT_OK; i++) {
    double *to = &matrix->entries[i * matrix->count];
    status = clt_transport_row(system->transport, system->channel, matrix->cell[i], row, error);
    for (size_t j = 0; j < matrix->count && status == CLT_OK; j++) {
      to[j] = row[matrix->cell[j]] * system->scale[matrix->cell[j]];
    }
  }
  return status;
}

clt_status clt_matrix_init(clt_matrix *matrix, const clt_system *system, const char *method, clt_error *error) {
  double *row = clt_alloc(system->cols, sizeof *row);
  matrix->cell = clt_alloc(system->cols, sizeof *matrix->cell);
  clt_status status = CLT_OK;
  if (row == NULL || matrix->cell == NULL) {
    status = clt_fail(error, CLT_FAILED, "%s: not enough memory for a list of %zu cells", method, system->cols);
  } else {
    list_lit(matrix, system);
  }
  if (status == CLT_OK && matrix->count > CLT_MATRIX_CELLS_MAX) {
    status =
        clt_fail(error, CLT_BAD_INPUT,
                 "%s needs every entry of T, but %zu lit cells are more than the %d that it is built for; use pcg, "
                 "gmres or auto, which need only products",
                 method, matrix->count, CLT_MATRIX_CELLS_MAX);
  }
  if (status == CLT_OK) {
    matrix->entries = clt_alloc(matrix->count * matrix->count, sizeof *matrix->entries);
    status = matrix->entries != NULL ? take_rows(matrix, system, row, error)
                                     : clt_fail(error, CLT_FAILED, "%s: not enough memory for %zu x %zu entries",
                                                method, matrix->count, matrix->count);
  }
  free(row);
  return status;
}

void clt_matrix_finish(clt_matrix *matrix) {
  free(matrix->cell);
  free(matrix->entries);
  *matrix = (clt_matrix){0};
}

void clt_matrix_gather(const clt_matrix *matrix, const double *full, double *brief) {
  for (size_t k = 0; k < matrix->count; k++) {
    brief[k] = full[matrix->cell[k]];
  }
}

void clt_matrix_scatter(const clt_matrix *matrix, const double *brief, double *full) {
  for (size_t k = 0; k < matrix->count; k++) {
    full[matrix->cell[k]] = brief[k];
  }
}
