#include "sim/weights.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

bool clt_weights_init(clt_weights *weights, int rows) {
  *weights = (clt_weights){.start = clt_alloc((size_t)rows + 1, sizeof *weights->start)};
  return weights->start != NULL;
}

void clt_weights_finish(clt_weights *weights) {
  free(weights->start);
  free(weights->element);
  free(weights->weight);
  *weights = (clt_weights){0};
}

static bool grow(clt_weights *weights, size_t needed) {
  size_t room = needed > 2 * weights->room ? needed : 2 * weights->room;
  if (needed > INT_MAX) {
    return false;
  }
  int *element = realloc(weights->element, room * sizeof *element);
  weights->element = element != NULL ? element : weights->element;
  double *weight = realloc(weights->weight, room * sizeof *weight);
  weights->weight = weight != NULL ? weight : weights->weight;
  weights->room = element != NULL && weight != NULL ? room : weights->room;
  return element != NULL && weight != NULL;
}

bool clt_weights_append(clt_weights *weights, const int *element, const double *weight, int count) {
  size_t used = (size_t)weights->start[weights->rows], needed = used + (size_t)count;
  if (needed > weights->room && !grow(weights, needed)) {
    return false;
  }
  if (count > 0) {
    memcpy(&weights->element[used], element, (size_t)count * sizeof *element);
    memcpy(&weights->weight[used], weight, (size_t)count * sizeof *weight);
  }
  weights->start[++weights->rows] = (int)needed;
  return true;
}
