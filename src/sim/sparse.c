#include "sim/sparse.h"

#include <stdlib.h>

#include "base/memory.h"

static bool make_room(clt_sparse *sparse, int rows, size_t entries) {
  sparse->rows = rows;
  sparse->start = clt_alloc((size_t)rows + 2, sizeof *sparse->start);
  sparse->column = clt_alloc(entries + 1, sizeof *sparse->column);
  sparse->weight = clt_alloc(entries + 1, sizeof *sparse->weight);
  return sparse->start && sparse->column && sparse->weight;
}

bool clt_sparse_init(clt_sparse *sparse, const clt_weights *lists, const int *place) {
  if (!make_room(sparse, lists->rows, (size_t)lists->start[lists->rows])) {
    return false;
  }
  for (int i = 0; i <= lists->rows; i++) {
    sparse->start[i] = lists->start[i];
  }
  for (int k = 0; k < lists->start[lists->rows]; k++) {
    sparse->column[k] = place[lists->element[k]];
    sparse->weight[k] = (float)lists->weight[k];
  }
  return true;
}

bool clt_sparse_transpose(const clt_sparse *of, int columns, clt_sparse *sparse) {
  if (!make_room(sparse, columns, (size_t)of->start[of->rows])) {
    return false;
  }
  int *next = sparse->start; /* counted two places on, so that filling moves each start to where it belongs */
  for (int k = 0; k < of->start[of->rows]; k++) {
    next[of->column[k] + 2]++;
  }
  for (int i = 2; i <= columns + 1; i++) {
    next[i] += next[i - 1];
  }
  for (int row = 0; row < of->rows; row++) {
    for (int k = of->start[row]; k < of->start[row + 1]; k++) {
      int at = next[of->column[k] + 1]++;
      sparse->column[at] = row;
      sparse->weight[at] = of->weight[k];
    }
  }
  return true;
}

void clt_sparse_finish(clt_sparse *sparse) {
  free(sparse->start);
  free(sparse->column);
  free(sparse->weight);
  *sparse = (clt_sparse){0};
}

size_t clt_sparse_bytes(const clt_sparse *sparse) {
  size_t entries = sparse->rows > 0 ? (size_t)sparse->start[sparse->rows] : 0;
  return (size_t)sparse->rows * sizeof *sparse->start + entries * (sizeof *sparse->column + sizeof *sparse->weight);
}

void clt_sparse_product(const clt_sparse *sparse, const clt_lanes *x, const clt_lanes *factor, clt_lanes *out) {
#pragma omp parallel for schedule(static)
  for (int i = 0; i < sparse->rows; i++) {
    clt_lanes sum = {0};
    for (int k = sparse->start[i]; k < sparse->start[i + 1]; k++) {
      sum += sparse->weight[k] * x[sparse->column[k]];
    }
    out[i] = factor != NULL ? factor[i] * sum : sum;
  }
}
