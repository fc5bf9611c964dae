#include "base/order.h"

#include <stdlib.h>

static int compare_doubles(const void *left, const void *right) {
  double a = *(const double *)left, b = *(const double *)right;
  return (a > b) - (a < b);
}

static int compare_floats(const void *left, const void *right) {
  float a = *(const float *)left, b = *(const float *)right;
  return (a > b) - (a < b);
}

void clt_sort_doubles(double *values, size_t count) {
  qsort(values, count, sizeof *values, compare_doubles);
}

void clt_sort_floats(float *values, size_t count) {
  qsort(values, count, sizeof *values, compare_floats);
}
