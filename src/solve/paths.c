#include "solve/paths.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/random.h"

enum { POWER_STEPS = 12, NEGATIVE = 1 << 15 };
static const double SHIFT = 0.05; /* of the power iteration, relative to the radius */

static double reflected(const clt_matrix *matrix, size_t i, size_t j) {
  return matrix->entries[i * matrix->count + j] - (i == j);
}

static void fill_weights(const clt_matrix *matrix, double *weight) {
  for (size_t i = 0; i < matrix->count; i++) {
    weight[i] = 0;
    for (size_t j = 0; j < matrix->count; j++) {
      weight[i] += fabs(reflected(matrix, i, j));
    }
  }
}

/* max (D |R| x)_i / x_i >= rho(D |R|) (Collatz-Wielandt), D = diag(|R_i|), with x drawn towards the Perron vector. */
static double second_moment(const clt_matrix *matrix, const double *weight, double *x, double *y) {
  size_t n = matrix->count;
  double bound = INFINITY;
  for (size_t i = 0; i < n; i++) {
    x[i] = 1;
  }
  for (int step = 0; step < POWER_STEPS; step++) {
    double most = 0;
    for (size_t i = 0; i < n; i++) {
      y[i] = 0;
      for (size_t j = 0; j < n; j++) {
        y[i] += weight[i] * fabs(reflected(matrix, i, j)) * x[j];
      }
      most = fmax(most, y[i] / x[i]);
    }
    bound = fmin(bound, most);
    for (size_t i = 0; i < n && most > 0; i++) {
      x[i] = y[i] / most + SHIFT * x[i];
    }
  }
  return bound;
}

/* Vose's order of Walker's tables: columns below the mean are filled up from one above it. `share` becomes |R_ij| n /
 * |R_i|; stack has n values. */
static void fill_row(const clt_matrix *matrix, size_t i, double weight, double *share, size_t *stack, float *keep,
                     uint16_t *alias) {
  size_t n = matrix->count, small = 0, large = n;
  for (size_t j = 0; j < n; j++) {
    share[j] = weight == 0 ? 0 : fabs(reflected(matrix, i, j)) * (double)n / weight;
    stack[share[j] < 1 ? small++ : --large] = j;
    alias[j] = (uint16_t)j;
    keep[j] = 1;
  }
  while (small > 0 && large < n) {
    size_t low = stack[--small], high = stack[large];
    keep[low] = (float)share[low];
    alias[low] = (uint16_t)(high | (reflected(matrix, i, high) < 0 ? NEGATIVE : 0));
    share[high] -= 1 - share[low];
    if (share[high] < 1) {
      large++;
      stack[small++] = high;
    }
  }
  for (size_t j = 0; j < n; j++) {
    keep[j] = reflected(matrix, i, j) < 0 ? -keep[j] : keep[j];
  }
}

static clt_status fill_tables(clt_paths *paths, const clt_matrix *matrix, clt_error *error) {
  size_t n = paths->count;
  double *share = clt_alloc(n, sizeof *share);
  size_t *stack = clt_alloc(n, sizeof *stack);
  bool room = share != NULL && stack != NULL;
  for (size_t i = 0; i < n && room; i++) {
    fill_row(matrix, i, paths->weight[i], share, stack, paths->keep + i * n, paths->alias + i * n);
  }
  free(share);
  free(stack);
  return room ? CLT_OK : clt_fail(error, CLT_FAILED, "montecarlo: not enough memory for a row of %zu cells", n);
}

clt_status clt_paths_init(clt_paths *paths, const clt_matrix *matrix, const char *remedy, clt_error *error) {
  size_t n = paths->count = matrix->count;
  paths->keep = clt_alloc(n * n, sizeof *paths->keep);
  paths->alias = clt_alloc(n * n, sizeof *paths->alias);
  paths->weight = clt_alloc(n, sizeof *paths->weight);
  double *scratch = clt_alloc(2 * n, sizeof *scratch);
  clt_status status = CLT_OK;
  if (paths->keep == NULL || paths->alias == NULL || paths->weight == NULL || scratch == NULL) {
    status = clt_fail(error, CLT_FAILED, "montecarlo: not enough memory for the tables of %zu x %zu entries", n, n);
  }
  if (status == CLT_OK && n > 0) {
    fill_weights(matrix, paths->weight);
    paths->ratio = sqrt(second_moment(matrix, paths->weight, scratch, scratch + n));
    status = paths->ratio < 1
                 ? fill_tables(paths, matrix, error)
                 : clt_fail(error, CLT_BAD_INPUT,
                            "montecarlo has no finite variance here: the mean square of its terms grows by %.3g a step "
                            "and must fall (%s)",
                            paths->ratio, remedy);
  }
  free(scratch);
  return status;
}

void clt_paths_finish(clt_paths *paths) {
  free(paths->keep);
  free(paths->alias);
  free(paths->weight);
  *paths = (clt_paths){0};
}

/* A column of row i with probability |R_ij| / |R_i|; *sign is turned where R_ij < 0. */
static size_t draw(const clt_paths *paths, size_t i, double uniform, double *sign) {
  double place = uniform * (double)paths->count;
  size_t j = (size_t)place;
  j = j < paths->count ? j : paths->count - 1;
  float keep = paths->keep[i * paths->count + j];
  if (place - (double)j < (double)fabsf(keep)) {
    *sign = signbit(keep) ? -*sign : *sign;
    return j;
  }
  uint16_t alias = paths->alias[i * paths->count + j];
  *sign = alias & NEGATIVE ? -*sign : *sign;
  return alias & (NEGATIVE - 1);
}

/* One path's f / p (eq. 50). */
static double follow(const clt_paths *paths, const double *b, size_t from, uint64_t key) {
  double q = paths->ratio, step = log(clt_random_uniform(key, 0)) / log(q);
  size_t length = step < 1e6 ? 1 + (size_t)step : 1000001, cell = from;
  double term = 1 / (1 - q), sign = 1; /* 1 / p(k) = q / (1 - q) q^-k is taken up step by step */
  for (size_t k = 0; k < length && term != 0; k++) {
    term *= -paths->weight[cell] / (k > 0 ? q : 1);
    cell = term != 0 ? draw(paths, cell, clt_random_uniform(key, k + 1), &sign) : cell;
  }
  return term * sign * b[cell];
}

void clt_paths_estimate(const clt_paths *paths, const double *b, int samples, uint64_t key, double *out,
                        double *deviation) {
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t i = 0; i < paths->count; i++) {
    double sum = 0, squares = 0;
    for (int s = 0; s < samples && paths->ratio > 0; s++) {
      double value = follow(paths, b, i, clt_random_key(key, i * (uint64_t)samples + (uint64_t)s));
      sum += value;
      squares += value * value;
    }
    out[i] = b[i] + sum / samples;
    if (deviation != NULL) {
      double spread = samples > 1 ? (squares - sum * sum / samples) / (samples - 1) : INFINITY;
      deviation[i] = sqrt(fmax(spread, 0) / samples);
    }
  }
}

void clt_paths_hybrid(const clt_paths *paths, const double *b, int samples, int steps, uint64_t key, double *last,
                      double *out) {
  size_t n = paths->count;
  clt_copy(n, b, out);
  for (int step = 0; step < steps; step++) {
    clt_copy(n, out, last);
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t i = 0; i < n; i++) {
      uint64_t row = clt_random_key(clt_random_key(key, (uint64_t)step), i);
      double sum = 0;
      for (int s = 0; s < samples && paths->weight[i] > 0; s++) {
        double sign = 1;
        size_t j = draw(paths, i, clt_random_uniform(row, (uint64_t)s), &sign);
        sum += sign * last[j];
      }
      out[i] = b[i] - paths->weight[i] * sum / samples;
    }
  }
}
