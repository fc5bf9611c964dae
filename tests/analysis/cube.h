/* A closed unit cube with the analytic form factors of its patches: rooms whose bounces are known. */
#ifndef CLT_TESTS_ANALYSIS_CUBE_H
#define CLT_TESTS_ANALYSIS_CUBE_H

#include <lapacke.h>

#include "counterlight/analysis.h"
#include "support.h"

typedef struct cube {
  int side; /* side x side patches a face, faces side by side on a grid of 6 side x side cells */
  size_t cells;
  double *exchange; /* A = K G, cells x cells */
  double *first;    /* F */
  clt_transport *transport;
  clt_certificate *certificate;
} cube;

static inline double *numbers(size_t count) {
  double *made = calloc(count, sizeof *made);
  assert_non_null(made);
  return made;
}

/* The function whose differences over the corners of two patches on parallel planes z apart are area times form factor;
 * u and v are differences of coordinates (Howell, Catalog of Radiation Heat Transfer Configuration Factors, C-13). */
static inline double cube_parallel(double u, double v, double z) {
  double a = sqrt(u * u + z * z), b = sqrt(v * v + z * z);
  return (v * a * atan(v / a) + u * b * atan(u / b) - z * z / 2 * log(u * u + v * v + z * z)) / (2 * M_PI);
}

/* The same for perpendicular planes: x and w are distances from the edge that they share, v runs along it (C-15). */
static inline double cube_perpendicular(double x, double w, double v) {
  double square = x * x + w * w, c = sqrt(square), sum = square + v * v;
  double swing = c > 0 ? v * c * atan(v / c) : 0;
  return (swing - (sum > 0 ? (square - v * v) * log(sum) / 4 : 0)) / (2 * M_PI);
}

/* Face of a patch, and its bounds along the three axes (a face of axis a has low[a] = high[a] = 0 or 1). */
static inline void cube_patch(int side, size_t i, int *axis, double low[3], double high[3]) {
  int row = (int)i / (6 * side), column = (int)i % (6 * side), face = column / side, u, v;
  *axis = face / 2;
  u = (*axis + 1) % 3;
  v = (*axis + 2) % 3;
  low[*axis] = high[*axis] = face % 2;
  low[u] = (double)(column % side) / side;
  high[u] = (double)(column % side + 1) / side;
  low[v] = (double)row / side;
  high[v] = (double)(row + 1) / side;
}

/* area_i times the form factor from patch i to j. */
static inline double cube_pair(int side, size_t i, size_t j) {
  int a, b;
  double li[3], hi[3], lj[3], hj[3], sum = 0;
  cube_patch(side, i, &a, li, hi);
  cube_patch(side, j, &b, lj, hj);
  if (a == b && li[a] == lj[a]) {
    return 0;
  }
  int along = a == b ? (a + 1) % 3 : 3 - a - b, other = a == b ? (a + 2) % 3 : -1;
  for (int k = 0; k < 16; k++) {
    double sign = __builtin_popcount((unsigned)k) % 2 ? -1 : 1;
    double v = (k & 1 ? hi[along] : li[along]) - (k & 2 ? hj[along] : lj[along]);
    if (other >= 0) {
      double u = (k & 4 ? hi[other] : li[other]) - (k & 8 ? hj[other] : lj[other]);
      sum += sign * cube_parallel(u, v, 1);
    } else {
      /* the distance of a point of face a from the edge is along axis b */
      double x = fabs((k & 4 ? hi[b] : li[b]) - lj[b]), w = fabs((k & 8 ? hj[a] : lj[a]) - li[a]);
      double flip = (lj[b] == 1) != (li[a] == 1) ? -1 : 1; /* distances that run backwards swap their ends */
      sum += sign * flip * cube_perpendicular(x, w, v);
    }
  }
  return sum;
}

/* T = (I - A)^-1 F by LAPACK, F at random in 0.3..1. */
static inline cube cube_make(int side, double albedo, uint64_t seed) {
  cube made = {.side = side, .cells = 6 * (size_t)side * (size_t)side};
  size_t n = made.cells;
  made.exchange = numbers(n * n);
  made.first = numbers(n);
  double *matrix = numbers(n * n), *inverse = numbers(n * n);
  lapack_int *pivots = calloc(n, sizeof *pivots);
  clt_error error = {0};
  for (size_t i = 0; i < n; i++) {
    made.first[i] = 0.3 + 0.7 * test_random(&seed);
    for (size_t j = 0; j < n; j++) {
      made.exchange[i * n + j] = albedo * (double)(side * side) * cube_pair(side, i, j);
      matrix[i * n + j] = (i == j) - made.exchange[i * n + j];
      inverse[i * n + j] = i == j;
    }
  }
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, (int)n, (int)n, matrix, (int)n, pivots, inverse, (int)n), 0);
  assert_ok(clt_transport_create_dense(6 * side, side, 1, n, &made.transport, &error), error);
  float *entries = clt_transport_entries(made.transport, 0);
  for (size_t k = 0; k < n * n; k++) {
    entries[k] = (float)(inverse[k] * made.first[k % n]);
  }
  assert_ok(clt_certify(made.transport, &made.certificate, &error), error);
  free(matrix);
  free(inverse);
  free(pivots);
  return made;
}

static inline void cube_free(cube *made) {
  clt_certificate_destroy(made->certificate);
  clt_transport_destroy(made->transport);
  free(made->exchange);
  free(made->first);
}

/* y = M x, n x n */
static inline void multiply(size_t n, const double *matrix, const double *x, double *y) {
  for (size_t i = 0; i < n; i++) {
    y[i] = 0;
    for (size_t j = 0; j < n; j++) {
      y[i] += matrix[i * n + j] * x[j];
    }
  }
}

/* ||a - b|| / ||b|| */
static inline double distance(size_t n, const double *a, const double *b) {
  double rest = 0, whole = 0;
  for (size_t i = 0; i < n; i++) {
    rest += (a[i] - b[i]) * (a[i] - b[i]);
    whole += b[i] * b[i];
  }
  return sqrt(rest / whole);
}

/* A = I - F T^-1 of a channel's float entries by LAPACK; F = diag(T), or 1 / (T^-1)_ii. */
static inline double *exchange_of(const clt_transport *transport, int channel, bool exact, double *first) {
  size_t n = clt_transport_describe(transport).cols;
  const float *entries = clt_transport_entries(transport, channel);
  double *inverse = numbers(n * n);
  lapack_int *pivots = calloc(n, sizeof *pivots);
  for (size_t k = 0; k < n * n; k++) {
    inverse[k] = entries[k];
  }
  assert_int_equal(LAPACKE_dgetrf(LAPACK_ROW_MAJOR, (int)n, (int)n, inverse, (int)n, pivots), 0);
  assert_int_equal(LAPACKE_dgetri(LAPACK_ROW_MAJOR, (int)n, inverse, (int)n, pivots), 0);
  for (size_t i = 0; i < n; i++) {
    first[i] = exact ? 1 / inverse[i * n + i] : entries[i * n + i];
    for (size_t j = 0; j < n; j++) {
      inverse[i * n + j] = (i == j) - first[i] * inverse[i * n + j];
    }
  }
  free(pivots);
  return inverse;
}

static inline clt_interreflection *analyse(const clt_transport *transport, const clt_certificate *certificate,
                                           bool exact, double tolerance) {
  clt_interreflection *made = NULL;
  clt_error error = {0};
  clt_interreflection_options options = {.exact_first_bounce = exact, .tolerance = tolerance};
  assert_ok(clt_interreflection_create(transport, certificate, &options, &made, &error), error);
  return made;
}

#endif
