#include "acquire/colouring.h"

#include <stdlib.h>

#include "base/memory.h"

typedef struct ranked {
  int64_t conflicts; /* upper bound of the column's degree in the conflict graph */
  int32_t column;
} ranked;

/* The rows of each column (the transpose), the order of colouring, and marks of forbidden colours. */
typedef struct workspace {
  int64_t *first; /* rows of column k: row[first[k]] .. row[first[k + 1] - 1] */
  int32_t *row;
  ranked *order;
  int32_t *forbidden; /* forbidden[colour] == k: a neighbour of column k has it */
} workspace;

static void free_workspace(workspace *work) {
  free(work->first);
  free(work->row);
  free(work->order);
  free(work->forbidden);
}

static clt_status make_workspace(workspace *work, int64_t entries, int32_t columns, clt_error *error) {
  *work = (workspace){.first = clt_alloc((size_t)columns + 2, sizeof *work->first),
                      .row = clt_alloc((size_t)entries, sizeof *work->row),
                      .order = clt_alloc((size_t)columns, sizeof *work->order),
                      .forbidden = clt_alloc((size_t)columns + 1, sizeof *work->forbidden)};
  if (work->first == NULL || work->row == NULL || work->order == NULL || work->forbidden == NULL) {
    free_workspace(work);
    return clt_fail(error, CLT_FAILED, "out of memory for colouring %d blocks", columns);
  }
  return CLT_OK;
}

/* first is counted two places ahead, so that filling in moves each to where it belongs. */
static void transpose(size_t rows, const int64_t *start, const int32_t *column, int32_t columns, workspace *work) {
  for (int64_t e = 0; e < start[rows]; e++) {
    work->first[column[e] + 2]++;
  }
  for (int32_t k = 0; k < columns; k++) {
    work->first[k + 2] += work->first[k + 1];
  }
  for (size_t i = 0; i < rows; i++) {
    for (int64_t e = start[i]; e < start[i + 1]; e++) {
      work->row[work->first[column[e] + 1]++] = (int32_t)i;
    }
  }
}

static int compare_ranked(const void *left, const void *right) {
  const ranked *a = left, *b = right;
  if (a->conflicts != b->conflicts) {
    return a->conflicts < b->conflicts ? 1 : -1;
  }
  return (a->column > b->column) - (a->column < b->column);
}

static void rank_columns(const int64_t *start, int32_t columns, workspace *work) {
  for (int32_t k = 0; k < columns; k++) {
    work->order[k] = (ranked){.column = k};
    for (int64_t e = work->first[k]; e < work->first[k + 1]; e++) {
      int32_t i = work->row[e];
      work->order[k].conflicts += start[i + 1] - start[i];
    }
  }
  qsort(work->order, (size_t)columns, sizeof *work->order, compare_ranked);
}

static int32_t least_free_colour(const int64_t *start, const int32_t *column, const int32_t *colour, int32_t k,
                                 workspace *work) {
  for (int64_t e = work->first[k]; e < work->first[k + 1]; e++) {
    int32_t i = work->row[e];
    for (int64_t f = start[i]; f < start[i + 1]; f++) {
      if (colour[column[f]] >= 0) {
        work->forbidden[colour[column[f]]] = k;
      }
    }
  }
  int32_t least = 0;
  while (work->forbidden[least] == k) {
    least++;
  }
  return least;
}

clt_status clt_colour_columns(size_t rows, const int64_t *start, const int32_t *column, int32_t columns,
                              int32_t *colour, int32_t *colours, clt_error *error) {
  workspace work;
  clt_status status = make_workspace(&work, start[rows], columns, error);
  if (status != CLT_OK) {
    return status;
  }
  transpose(rows, start, column, columns, &work);
  rank_columns(start, columns, &work);
  for (int32_t k = 0; k < columns; k++) {
    colour[k] = -1;
    work.forbidden[k] = -1;
  }
  work.forbidden[columns] = -1;
  *colours = 0;
  for (int32_t at = 0; at < columns; at++) {
    int32_t k = work.order[at].column;
    if (work.first[k + 1] > work.first[k]) {
      colour[k] = least_free_colour(start, column, colour, k, &work);
      *colours = colour[k] >= *colours ? colour[k] + 1 : *colours;
    }
  }
  free_workspace(&work);
  return CLT_OK;
}
