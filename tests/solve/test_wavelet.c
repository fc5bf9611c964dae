/* Daubechies' wavelets on grids of any size, R in them, and the method that solves with it. */
#include "rooms.h"
#include "solve/matrix.h"
#include "solve/wavelet_form.h"

static const size_t SIDES[][2] = {{1, 1},  {7, 5},  {8, 8},   {9, 8},   {13, 1},
                                  {1, 29}, {40, 8}, {61, 37}, {96, 16}, {130, 3}};
enum { GRIDS = sizeof SIDES / sizeof SIDES[0] };

static double dot(size_t count, const double *a, const double *b) {
  double sum = 0;
  for (size_t i = 0; i < count; i++) {
    sum += a[i] * b[i];
  }
  return sum;
}

static void fill_random(double *values, size_t count, uint64_t *random) {
  for (size_t i = 0; i < count; i++) {
    values[i] = 2 * test_random(random) - 1;
  }
}

/* W'W = I and WW' = I on random vectors, and <W a, b> = <a, W' b>. */
static void the_transform_is_orthonormal(void **state) {
  (void)state;
  uint64_t random = 3;
  for (size_t k = 0; k < GRIDS; k++) {
    clt_d4 d4;
    clt_d4_init(&d4, SIDES[k][0], SIDES[k][1]);
    size_t n = SIDES[k][0] * SIDES[k][1];
    double *a = room_numbers(n), *b = room_numbers(n), *to = room_numbers(n), *back = room_numbers(n);
    double *scratch = room_numbers(n);
    fill_random(a, n, &random);
    fill_random(b, n, &random);
    memcpy(to, a, n * sizeof *to);
    clt_d4_forward(&d4, to, scratch);
    memcpy(back, b, n * sizeof *back);
    clt_d4_inverse(&d4, back, scratch);
    assert_near(dot(n, to, b), dot(n, a, back), 1e-12 * (double)n);
    assert_near(dot(n, to, to) / dot(n, a, a), 1, 1e-12);
    clt_d4_inverse(&d4, to, scratch);
    clt_d4_forward(&d4, back, scratch);
    assert_true(room_distance(to, a, n) < 1e-12 && room_distance(back, b, n) < 1e-12);
    free(a);
    free(b);
    free(to);
    free(back);
    free(scratch);
  }
}

/* Every pair of basis functions of a small grid, odd along one axis. */
static void every_wavelet_is_orthogonal_to_every_other(void **state) {
  (void)state;
  enum { WIDTH = 17, HEIGHT = 10, N = WIDTH * HEIGHT };
  clt_d4 d4;
  clt_d4_init(&d4, WIDTH, HEIGHT);
  double *basis = room_numbers((size_t)N * N), scratch[N];
  for (size_t i = 0; i < N; i++) {
    basis[i * N + i] = 1;
    clt_d4_inverse(&d4, basis + i * N, scratch);
  }
  for (size_t i = 0; i < N; i++) {
    for (size_t j = 0; j < N; j++) {
      assert_near(dot(N, basis + i * N, basis + j * N), i == j, 1e-12);
    }
  }
  free(basis);
}

/* Functions that are linear along each axis have no details, at borders too, for every length. */
static void two_moments_vanish(void **state) {
  (void)state;
  for (size_t width = 1; width <= 70; width++) {
    size_t height = width % 2 ? 19 : 24, n = width * height;
    clt_d4 d4;
    clt_d4_init(&d4, width, height);
    size_t across = d4.across > 0 ? d4.row[d4.across - 1].lows : width, down = d4.column[d4.down - 1].lows;
    assert_true(across < 8 && down < 8);
    double *values = room_numbers(n), *scratch = room_numbers(n), details = 0;
    for (size_t i = 0; i < n; i++) {
      double x = (double)(i % width) - 3, y = (double)(i / width);
      values[i] = 1 + .3 * x - .2 * y + .05 * x * y;
    }
    double size = sqrt(dot(n, values, values));
    clt_d4_forward(&d4, values, scratch);
    for (size_t i = 0; i < n; i++) {
      details = i % width < across && i / width < down ? details : fmax(details, fabs(values[i]));
    }
    assert_true(details < 1e-11 * size);
    free(values);
    free(scratch);
  }
}

/* Inside, a detail is Daubechies' filter: the polynomial h(z) = (1 + z)^2 (a + b z) has the root that makes it
 * orthogonal to its shift by 2; here by its closed form. */
static void inside_the_filters_are_those_of_daubechies(void **state) {
  (void)state;
  const double r = sqrt(3),
               h[4] = {(1 + r) / 4 / sqrt(2), (3 + r) / 4 / sqrt(2), (3 - r) / 4 / sqrt(2), (1 - r) / 4 / sqrt(2)};
  enum { N = 14, AT = 4 };
  clt_d4 d4;
  double scratch[N];
  clt_d4_init(&d4, N, 1);
  assert_int_equal(d4.row[0].lows, N / 2 + 1);
  d4.across = d4.levels = 1;
  for (size_t t = 0; t < 4; t++) {
    double values[N] = {0};
    values[AT + t] = 1;
    clt_d4_forward(&d4, values, scratch);
    assert_near(values[AT / 2 + 1], h[t], 1e-14);
    assert_near(values[d4.row[0].lows + AT / 2], (t % 2 ? -1 : 1) * h[3 - t], 1e-14);
  }
}

/* The system that a solver would make ready, of one channel. */
static clt_system system_of(const test_room *room) {
  clt_error error = {0};
  clt_system system;
  assert_ok(clt_system_init(&system, room->transport, false, &error), error);
  clt_system_select(&system, 0, clt_certificate_first_bounce(room->certificate, 0),
                    clt_certificate_lit(room->certificate, 0));
  return system;
}

/* ||R x - W' M W x|| / ||x||, R x in double from the entries. */
static double product_error(const clt_wavelet_form *form, const test_room *room, const double *x) {
  size_t n = room->cells;
  double *drive = room_numbers(n), *exact = room_numbers(n), *c = room_numbers(n), *out = room_numbers(n);
  double *scratch = room_numbers(n), rest = 0;
  for (size_t j = 0; j < n; j++) {
    drive[j] = x[j] / (double)clt_transport_entries(room->transport, 0)[j * (n + 1)];
  }
  room_product(room->transport, 0, drive, exact);
  memcpy(c, x, n * sizeof *c);
  clt_d4_forward(&form->d4, c, scratch);
  clt_wavelet_form_apply(form, c, out);
  clt_d4_inverse(&form->d4, out, scratch);
  for (size_t i = 0; i < n; i++) {
    rest += (exact[i] - x[i] - out[i]) * (exact[i] - x[i] - out[i]);
  }
  rest = sqrt(rest / dot(n, x, x));
  free(drive);
  free(exact);
  free(c);
  free(out);
  free(scratch);
  return rest;
}

/* Random vectors, even ones, and steps; 8 of each. */
static void assert_product_within_bounds(const clt_wavelet_form *form, const test_room *room, double wanted) {
  double *x = room_numbers(room->cells), worst = 0;
  uint64_t random = 5;
  for (size_t k = 0; k < 24; k++) {
    fill_random(x, room->cells, &random);
    for (size_t i = 0; i < room->cells; i++) {
      x[i] = k < 8 ? x[i] : k < 16 ? 1 + .3 * x[i] : i * 8 / room->cells == k - 16;
    }
    double error = product_error(form, room, x);
    worst = fmax(worst, k < 16 ? error : 0);
    assert_true(error <= form->dropped + 1e-6);
  }
  for (size_t i = 0; i < room->cells; i++) {
    x[i] = 1;
  }
  assert_true(product_error(form, room, x) <= form->error + 1e-6);
  assert_true(form->error <= wanted && worst <= 1.5 * wanted);
  free(x);
}

static void a_product_stays_within_its_bounds(void **state) {
  (void)state;
  const double wanted[] = {.02, .005, .001, 1e-5};
  for (int side = 3; side <= 9; side += 2) { /* 54 .. 486 cells */
    test_room room = side == 7 ? room_closed(23, 11, .5, 3) : room_cube(side, .45, .2, 2);
    clt_system system = system_of(&room);
    clt_error error = {0};
    size_t before = 0;
    for (int k = 0; k < 4; k++) {
      clt_wavelet_form form = {0};
      assert_ok(clt_wavelet_form_init(&form, &system, wanted[k], &error), error);
      assert_product_within_bounds(&form, &room, wanted[k]);
      assert_true(form.kept > before);
      before = form.kept;
      clt_wavelet_form_finish(&form);
    }
    clt_system_finish(&system);
    room_free(&room);
  }
}

/* Coefficients a row at a product error of 1 %. */
static double count_per_row(const test_room *room) {
  clt_error error = {0};
  clt_system system = system_of(room);
  clt_wavelet_form form = {0};
  assert_ok(clt_wavelet_form_init(&form, &system, .01, &error), error);
  double per_row = (double)form.kept / (double)form.cells;
  print_message("%zu x %zu: %.1f coefficients a row, %.1f %% of the matrix, product error %.2g, dropped %.2g\n",
                form.d4.width, form.d4.height, per_row, 100 * per_row / (double)form.cells, form.error, form.dropped);
  clt_wavelet_form_finish(&form);
  clt_system_finish(&system);
  return per_row;
}

/* W, the coefficients of a row at 1 % of the light, hardly depends on N (report, section 7); with the cells in a row,
 * and not in the grid's two dimensions, more are needed, and ever more. */
static void sparsity_hardly_depends_on_resolution(void **state) {
  (void)state;
  double per_row[3], in_a_row[3];
  for (int k = 0; k < 3; k++) {
    test_room room = room_cube(4 << k, .4, 0, 2);
    test_room line = room_of(room.cells, room.cells, clt_transport_entries(room.transport, 0));
    per_row[k] = count_per_row(&room);
    in_a_row[k] = count_per_row(&line);
    room_free(&room);
    room_free(&line);
  }
  assert_true(per_row[2] < 1.25 * per_row[1] && per_row[1] < 1.5 * per_row[0]);
  assert_true(in_a_row[2] > 1.5 * per_row[2]);
}

static clt_solve_result solve(const test_room *room, double tolerance) {
  clt_error error = {0};
  clt_solve_result result;
  clt_solve_options options = {.method = "wavelet", .tolerance = tolerance};
  assert_ok(clt_solve(room->transport, room->certificate, room->b, &options, room->x, &result, &error), error);
  assert_string_equal(result.method, "wavelet");
  return result;
}

/* The residual that is stated is met in truth, also where the sketch alone says so, at any albedo. */
static void the_tolerance_is_met_in_truth(void **state) {
  (void)state;
  const double tolerances[] = {3e-2, 1e-2, 3e-3, 1e-4, 1e-8}, albedos[] = {.2, .45, .7, .95};
  int without_product = 0;
  for (int a = 0; a < 4; a++) {
    test_room room = room_cube(5 + a, albedos[a], .3, 4);
    for (uint64_t seed = 1; seed <= 12; seed++) {
      room_ask(&room, seed, seed % 2 ? 0 : -1, 1);
      for (int t = 0; t < 5; t++) {
        clt_solve_result result = solve(&room, tolerances[t]);
        assert_true(result.converged);
        assert_true(room_residual(&room, room.x, room.b) <= tolerances[t]);
        without_product += result.products == 0;
      }
      free(room.known);
      free(room.b);
      free(room.x);
      room.known = room.b = room.x = NULL;
    }
    room_free(&room);
  }
  print_message("%d of 240 solves without a product\n", without_product);
  assert_true(without_product >= 72);
}

/* Random light, of which wavelets hold nothing well, and light that goes one way, with dark cells. */
static void what_is_not_smooth_is_solved_too(void **state) {
  (void)state;
  test_room room = room_closed(14, 9, .6, 4);
  float *entries = clt_transport_entries(room.transport, 0);
  uint64_t random = 6;
  for (size_t i = 0; i < room.cells * room.cells; i++) {
    entries[i] *= i % (room.cells + 1) == 0 ? 1 : (float)(2 * test_random(&random));
    entries[i] = i % room.cells % 9 == 4 ? 1e-7f : entries[i];
  }
  room_certify(&room);
  assert_true(clt_certificate_channel(room.certificate, 0)->reciprocity > .05);
  room_ask(&room, 2, .1, .9);
  for (int t = 1; t <= 9; t += 2) {
    assert_true(solve(&room, pow(10, -t)).converged);
    assert_true(room_residual(&room, room.x, room.b) <= pow(10, -t));
  }
  for (size_t j = 4; j < room.cells; j += 9) {
    assert_true(room.x[j] == 0);
  }
  room_free(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_transform_is_orthonormal),
      cmocka_unit_test(every_wavelet_is_orthogonal_to_every_other),
      cmocka_unit_test(two_moments_vanish),
      cmocka_unit_test(inside_the_filters_are_those_of_daubechies),
      cmocka_unit_test(a_product_stays_within_its_bounds),
      cmocka_unit_test(sparsity_hardly_depends_on_resolution),
      cmocka_unit_test(the_tolerance_is_met_in_truth),
      cmocka_unit_test(what_is_not_smooth_is_solved_too),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
