#include "sim/formfactor.h"
#include "support.h"

static clt_rectangle rectangle(clt_vector corner, clt_vector u, clt_vector v) {
  clt_rectangle made = {.corner = corner, .u = u, .v = v};
  assert_true(clt_rectangle_complete(&made));
  return made;
}

static clt_rectangle part(const clt_rectangle *whole, int columns, int rows, int number) {
  clt_rectangle made = *whole;
  made.u = vec_scale(1.0 / columns, whole->u);
  made.v = vec_scale(1.0 / rows, whole->v);
  made.corner = vec_along(whole->corner, number % columns, made.u, number / columns, made.v);
  return made;
}

/* The form factor from a to b, summed over columns x rows elements of each. */
static double meshed(const clt_rectangle *a, const clt_rectangle *b, int columns, int rows) {
  double sum = 0.0;
  for (int i = 0; i < columns * rows; i++) {
    for (int j = 0; j < columns * rows; j++) {
      clt_rectangle from = part(a, columns, rows, i), to = part(b, columns, rows, j);
      sum += clt_formfactor_exchange(&from, &to);
    }
  }
  return sum / clt_rectangle_area(a);
}

/* Directly opposed a x b rectangles at distance c (Howell, catalog of view factors, C-11). */
static double opposed(double a, double b, double c) {
  double x = a / c, y = b / c, x1 = sqrt(1 + x * x), y1 = sqrt(1 + y * y);
  return 2 / (M_PI * x * y) *
         (log(sqrt(x1 * x1 * y1 * y1 / (1 + x * x + y * y))) + x * y1 * atan(x / y1) + y * x1 * atan(y / x1) -
          x * atan(x) - y * atan(y));
}

/* From a w x l rectangle to an h x l one at right angles that shares the edge l (Howell, C-14). */
static double adjacent(double w, double h, double l) {
  double W = w / l, H = h / l, W2 = W * W, H2 = H * H, D = sqrt(H2 + W2);
  double logs = log((1 + W2) * (1 + H2) / (1 + W2 + H2)) + W2 * log(W2 * (1 + W2 + H2) / ((1 + W2) * (W2 + H2))) +
                H2 * log(H2 * (1 + H2 + W2) / ((1 + H2) * (H2 + W2)));
  return (W * atan(1 / W) + H * atan(1 / H) - D * atan(1 / D) + logs / 4) / (M_PI * W);
}

static void opposed_walls(void **state) {
  (void)state;
  const double sizes[][3] = {{1, 1, 1}, {2, 1, 0.5}, {1, 3, 4}, {1, 1, 0.2}};
  for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
    double a = sizes[k][0], b = sizes[k][1], c = sizes[k][2];
    clt_rectangle low = rectangle((clt_vector){0, 0, 0}, (clt_vector){a, 0, 0}, (clt_vector){0, b, 0});
    clt_rectangle high = rectangle((clt_vector){0, 0, c}, (clt_vector){0, b, 0}, (clt_vector){a, 0, 0});
    assert_near(meshed(&low, &high, 12, 10), opposed(a, b, c), 1e-4 * opposed(a, b, c));
    assert_near(meshed(&high, &low, 12, 10), opposed(a, b, c), 1e-4 * opposed(a, b, c));
  }
}

static void adjacent_walls(void **state) {
  (void)state;
  const double sizes[][3] = {{1, 1, 1}, {2, 1, 1}, {0.3, 1, 2}};
  for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
    double w = sizes[k][0], h = sizes[k][1], l = sizes[k][2];
    clt_rectangle floor = rectangle((clt_vector){0, 0, 0}, (clt_vector){w, 0, 0}, (clt_vector){0, l, 0});
    clt_rectangle wall = rectangle((clt_vector){0, 0, 0}, (clt_vector){0, l, 0}, (clt_vector){0, 0, h});
    assert_near(meshed(&floor, &wall, 12, 12), adjacent(w, h, l), 1e-4 * adjacent(w, h, l));
    assert_near(meshed(&floor, &wall, 3, 3), adjacent(w, h, l), 1e-4 * adjacent(w, h, l));
  }
}

/* Above a corner of a parallel rectangle (Howell, B-3), near and so far that the small-angle series serves. */
static void point_above_corner(void **state) {
  (void)state;
  const double heights[] = {0.1, 1.0, 7.0, 30.0};
  for (int k = 0; k < 4; k++) {
    double A = 1.5 / heights[k], B = 0.7 / heights[k], A1 = sqrt(1 + A * A), B1 = sqrt(1 + B * B);
    double closed = (A / A1 * atan(B / A1) + B / B1 * atan(A / B1)) / (2 * M_PI);
    clt_vector vertices[4] = {{0, 0, 0}, {1.5, 0, 0}, {1.5, 0.7, 0}, {0, 0.7, 0}};
    clt_vector above = {0, 0, heights[k]}, down = {0, 0, -1}, up = {0, 0, 1};
    assert_near(clt_formfactor_point(above, down, vertices, 4, up), closed, 1e-8 * closed);
    assert_near(clt_formfactor_point(above, down, vertices, 4, down), 0.0, 0.0);
  }
}

/* A wall that reaches below the horizon counts as its upper part alone. */
static void horizon_cuts(void **state) {
  (void)state;
  clt_vector whole[4] = {{2, -1, -3}, {2, -1, 2}, {2, 1, 2}, {2, 1, -3}};
  clt_vector upper[4] = {{2, -1, 0}, {2, -1, 2}, {2, 1, 2}, {2, 1, 0}};
  clt_vector origin = {0, 0, 0}, up = {0, 0, 1}, facing = {-1, 0, 0};
  double wanted = clt_formfactor_point(origin, up, upper, 4, facing);
  assert_true(wanted > 0.05);
  assert_near(clt_formfactor_point(origin, up, whole, 4, facing), wanted, 1e-12);
  clt_vector tilted = vec_unit((clt_vector){-0.9, 0.3, -0.2});
  assert_near(clt_formfactor_point(origin, tilted, upper, 4, facing), 0.0, 0.0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(opposed_walls),
      cmocka_unit_test(adjacent_walls),
      cmocka_unit_test(point_above_corner),
      cmocka_unit_test(horizon_cuts),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
