/* Sums and products of vectors. They are short beside a product with T, and are needed many times in a solve of a few
 * tenths of a millisecond: a thread would cost more than it spares, and a BLAS that starts its own from 10000 values
 * keeps the processors from those of the next product. */
#include <math.h>

#include "solve/system.h"

enum { LANES = 8 };
static const double LEAST_SQUARE = 1e-250, MOST_SQUARE = 1e250; /* between them squares neither vanish nor overflow */

double clt_dot(size_t count, const double *a, const double *b) {
  double lane[LANES] = {0};
  size_t i = 0;
  for (; i + LANES <= count; i += LANES) {
    for (size_t l = 0; l < LANES; l++) {
      lane[l] += a[i + l] * b[i + l];
    }
  }
  for (size_t l = 0; i < count; i++, l++) {
    lane[l] += a[i] * b[i];
  }
  return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

double clt_norm(size_t count, const double *a) {
  double square = clt_dot(count, a, a);
  return square >= LEAST_SQUARE && square <= MOST_SQUARE ? sqrt(square) : cblas_dnrm2((blasint)count, a, 1);
}

void clt_add(size_t count, double factor, const double *restrict x, double *restrict y) {
  for (size_t i = 0; i < count; i++) {
    y[i] += factor * x[i];
  }
}
