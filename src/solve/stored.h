/* A stored inverse of S over the lit cells of a channel, as A = I - S^-1, and one product with it. */
#ifndef CLT_SOLVE_STORED_H
#define CLT_SOLVE_STORED_H

#include "solve/matrix.h"
#include "solve/refine.h"

/* Where `single` holds the entries `full` does not, and the other way round. Both are count x count, row-major. */
typedef struct clt_stored {
  size_t count, *cell; /* as in clt_matrix */
  double *full;
  float *single;
  double *in, *out; /* count values each */
  double rest;      /* ||I - S X|| <= rest for X = I - A */
} clt_stored;

/* Takes the list of cells from matrix, and makes room for vectors. */
clt_status clt_stored_init(clt_stored *stored, clt_matrix *matrix, const char *method, clt_error *error);
void clt_stored_finish(clt_stored *stored); /* accepts a zeroed one */
/* l += (I - A) r, refined by products with T where `rest` does not show the tolerance at once. */
clt_outcome clt_stored_run(clt_stored *stored, clt_system *system, clt_run *run);

/* sqrt(||M||_1 ||M||_inf) >= ||M||_2 of count x count entries; column_sums has room for count values. */
double clt_norm_bound(const double *entries, size_t count, double *column_sums);

#endif
