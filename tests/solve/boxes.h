/* The bounded problem of a room, and what the tests know of its optimum. */
#ifndef CLT_TESTS_SOLVE_BOXES_H
#define CLT_TESTS_SOLVE_BOXES_H

#include "rooms.h"

/* One channel's least squares over lit cells, in x: min ||T x - b||, 0 <= x <= 1. Dark rows of b are 0 here. */
typedef struct problem {
  const test_room *room;
  size_t rows, cols;
  const unsigned char *lit; /* NULL where rows != cols: every row and column takes part */
  double *b, *r, *gradient;
} problem;

static inline problem problem_of(const test_room *room, const double *b) {
  clt_transport_info info = clt_transport_describe(room->transport);
  problem p = {.room = room, .rows = info.rows, .cols = info.cols};
  p.lit = info.rows == info.cols ? clt_certificate_lit(room->certificate, 0) : NULL;
  p.b = room_numbers(p.rows);
  p.r = room_numbers(p.rows);
  p.gradient = room_numbers(p.cols);
  for (size_t i = 0; i < p.rows; i++) {
    p.b[i] = p.lit == NULL || p.lit[i] ? b[i] : 0;
  }
  return p;
}

static inline void problem_free(problem *p) {
  free(p->b);
  free(p->r);
  free(p->gradient);
}

/* ||T x - b||^2, and the gradient T' (T x - b) in p->gradient. */
static inline double objective(problem *p, const double *x) {
  const float *entries = clt_transport_entries(p->room->transport, 0);
  double sum = 0;
  room_product(p->room->transport, 0, x, p->r);
  memset(p->gradient, 0, p->cols * sizeof(double));
  for (size_t i = 0; i < p->rows; i++) {
    p->r[i] = p->lit == NULL || p->lit[i] ? p->r[i] - p->b[i] : 0;
    sum += p->r[i] * p->r[i];
    for (size_t j = 0; j < p->cols; j++) {
      p->gradient[j] += (double)entries[i * p->cols + j] * p->r[i];
    }
  }
  return sum;
}

/* The norm of l - P(l - g) over 0 <= l <= F, with l = F x and g the gradient in l. */
static inline double projected_gradient(problem *p, const double *x) {
  const double *f = clt_certificate_first_bounce(p->room->certificate, 0);
  double sum = 0;
  objective(p, x);
  for (size_t j = 0; j < p->cols; j++) {
    if (p->lit == NULL || p->lit[j]) {
      double l = f[j] * x[j], moved = fmin(fmax(l - p->gradient[j] / f[j], 0), f[j]);
      sum += (l - moved) * (l - moved);
    }
  }
  return sqrt(sum);
}

static inline double optimality(problem *p, const double *x) {
  double *zero = room_numbers(p->cols);
  double start = projected_gradient(p, zero), end = projected_gradient(p, x);
  free(zero);
  return start > 0 ? end / start : end;
}

/* The optimum by cyclic coordinate descent, which shares nothing with the library's way; returns ||T x - b||^2. */
static inline double reference_optimum(problem *p, double *x) {
  const float *entries = clt_transport_entries(p->room->transport, 0);
  memset(x, 0, p->cols * sizeof(double));
  objective(p, x);
  double change = 1;
  for (int sweep = 0; sweep < 20000 && change > 1e-13; sweep++) {
    change = 0;
    for (size_t j = 0; j < p->cols; j++) {
      double slope = 0, curvature = 0;
      for (size_t i = 0; (p->lit == NULL || p->lit[j]) && i < p->rows; i++) {
        double entry = p->lit == NULL || p->lit[i] ? (double)entries[i * p->cols + j] : 0;
        slope += entry * p->r[i];
        curvature += entry * entry;
      }
      double next = curvature > 0 ? fmin(fmax(x[j] - slope / curvature, 0), 1) : 0, step = next - x[j];
      x[j] = next;
      change = fmax(change, fabs(step));
      for (size_t i = 0; step != 0 && i < p->rows; i++) {
        p->r[i] += p->lit == NULL || p->lit[i] ? (double)entries[i * p->cols + j] * step : 0;
      }
    }
  }
  return objective(p, x);
}

static inline clt_solve_result solve(const test_room *room, const char *method, double tolerance, const double *b,
                                     double *x) {
  clt_error error = {0};
  clt_solve_result result;
  clt_solve_options options = {.method = method, .tolerance = tolerance};
  assert_ok(clt_solve(room->transport, room->certificate, b, &options, x, &result, &error), error);
  return result;
}

static inline void assert_in_box(const double *x, size_t count) {
  for (size_t j = 0; j < count; j++) {
    assert_true(x[j] >= 0 && x[j] <= 1);
  }
}

/* ||T x - b||^2 of the unbounded solution, clamped. */
static inline double clamped_objective(problem *p, const double *b, double *x) {
  solve(p->room, "gmres", 1e-10, b, x);
  for (size_t j = 0; j < p->cols; j++) {
    x[j] = fmin(fmax(x[j], 0), 1);
  }
  return objective(p, x);
}

#endif
