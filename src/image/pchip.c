#include "image/pchip.h"

#include <math.h>

static double node(const double *x, int n, int i) {
  return x != 0 ? x[i] : (double)i / (n - 1);
}

/* The last interval whose lower end is not above `at`, values being ascending. */
static int interval(const double *x, int n, double at) {
  int low = 0, high = n - 1;
  while (high - low > 1) {
    int middle = (low + high) / 2;
    if (node(x, n, middle) <= at) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return low;
}

static double secant(const double *x, const double *y, int n, int i) {
  return (y[i + 1] - y[i]) / (node(x, n, i + 1) - node(x, n, i));
}

/* At an end: the parabola's slope through three points, kept between 0 and three times the secant. */
static double end_slope(double near, double far, double step, double next_step) {
  double slope = ((2 * step + next_step) * near - step * far) / (step + next_step);
  if (slope * near <= 0) {
    return 0;
  }
  return fabs(slope) > 3 * fabs(near) ? 3 * near : slope;
}

static double slope_at(const double *x, const double *y, int n, int i) {
  if (n == 2) {
    return secant(x, y, n, 0);
  }
  if (i == 0 || i == n - 1) {
    int near = i == 0 ? 0 : n - 2, far = i == 0 ? 1 : n - 3;
    return end_slope(secant(x, y, n, near), secant(x, y, n, far), node(x, n, near + 1) - node(x, n, near),
                     node(x, n, far + 1) - node(x, n, far));
  }
  double before = secant(x, y, n, i - 1), after = secant(x, y, n, i);
  if (before * after <= 0) {
    return 0;
  }
  double left = node(x, n, i) - node(x, n, i - 1), right = node(x, n, i + 1) - node(x, n, i);
  double first = 2 * right + left, second = right + 2 * left;
  return (first + second) / (first / before + second / after);
}

/* Hermite's cubic over one interval. */
typedef struct cubic {
  double start, step, low, high, low_slope, high_slope; /* slopes times step */
} cubic;

static cubic cubic_of(const double *x, const double *y, int n, int i) {
  double start = node(x, n, i), step = node(x, n, i + 1) - start;
  return (cubic){start, step, y[i], y[i + 1], step * slope_at(x, y, n, i), step * slope_at(x, y, n, i + 1)};
}

static double cubic_at(const cubic *c, double s) {
  double rise = c->high - c->low;
  double bend = c->low_slope + c->high_slope - 2 * rise;
  return c->low + s * (c->low_slope + s * (rise - c->low_slope - bend + s * bend));
}

double clt_pchip_at(const double *x, const double *y, int n, double at) {
  if (at <= node(x, n, 0)) {
    return y[0];
  }
  if (at >= node(x, n, n - 1)) {
    return y[n - 1];
  }
  cubic c = cubic_of(x, y, n, interval(x, n, at));
  return cubic_at(&c, (at - c.start) / c.step);
}

/* Newton's steps, kept inside the bracket. */
static double cubic_inverse(const cubic *c, double value) {
  enum { STEPS = 60 };
  double rise = c->high - c->low, bend = c->low_slope + c->high_slope - 2 * rise;
  double low = 0, high = 1, s = (value - c->low) / rise;
  for (int step = 0; step < STEPS && high - low > 1e-15; step++) {
    double off = cubic_at(c, s) - value;
    double slope = c->low_slope + s * (2 * (rise - c->low_slope - bend) + s * 3 * bend);
    if (off == 0) {
      break;
    }
    *(off < 0 ? &low : &high) = s;
    double next = s - off / slope;
    s = next > low && next < high ? next : 0.5 * (low + high);
  }
  return s;
}

double clt_pchip_inverse(const double *x, const double *y, int n, double value) {
  if (value <= y[0]) {
    return node(x, n, 0);
  }
  if (value >= y[n - 1]) {
    return node(x, n, n - 1);
  }
  cubic c = cubic_of(x, y, n, interval(y, n, value));
  return c.start + c.step * cubic_inverse(&c, value);
}
