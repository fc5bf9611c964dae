/* Sparse rows: for each cell, the elements that it has to do with, and how much. */
#ifndef CLT_SIM_WEIGHTS_H
#define CLT_SIM_WEIGHTS_H

#include <stdbool.h>
#include <stddef.h>

/* Row i is element[k] with weight[k], start[i] <= k < start[i+1]. */
typedef struct clt_weights {
  int rows; /* that are there */
  int *start, *element;
  double *weight;
  size_t room; /* entries that fit */
} clt_weights;

/* Room for `rows` rows, with none there yet; false where memory is short. weights is finished by the caller in either
 * case. */
bool clt_weights_init(clt_weights *weights, int rows);
void clt_weights_finish(clt_weights *weights);
/* Entries of all rows together. */
static inline int clt_weights_count(const clt_weights *weights) {
  return weights->rows > 0 ? weights->start[weights->rows] : 0;
}
/* Appends a row of `count` entries, copied; false where memory is short. */
bool clt_weights_append(clt_weights *weights, const int *element, const double *weight, int count);

#endif
