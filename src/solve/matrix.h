/* The entries of S, for the methods that need more than products. */
#ifndef CLT_SOLVE_MATRIX_H
#define CLT_SOLVE_MATRIX_H

#include "solve/system.h"

enum { CLT_MATRIX_CELLS_MAX = 12288 }; /* 1.2 GB of entries */

/* S of one channel over its lit cells only. */
typedef struct clt_matrix {
  size_t count;    /* lit cells */
  size_t *cell;    /* of each row and column: its number in the grid, ascending */
  double *entries; /* count x count, row-major */
} clt_matrix;

/* Takes the entries of the selected channel; by transposed products where T is not held entry by entry. Needs rows =
 * cols. CLT_BAD_INPUT, beginning with the method's name, for more than CLT_MATRIX_CELLS_MAX lit cells. matrix was
 * zeroed by the caller, and is finished by it in either case. */
clt_status clt_matrix_init(clt_matrix *matrix, const clt_system *system, const char *method, clt_error *error);
void clt_matrix_finish(clt_matrix *matrix);

/* brief[k] = full[cell[k]], and back: full[cell[k]] = brief[k]; other values of full stay. */
void clt_matrix_gather(const clt_matrix *matrix, const double *full, double *brief);
void clt_matrix_scatter(const clt_matrix *matrix, const double *brief, double *full);

#endif
