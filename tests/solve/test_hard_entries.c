/* Hard cases of what T holds: mirrors, shadows, noise, doubles, any shape, a corner. */
#include <cblas.h>

#include "hard.h"
#include "noise.h"

/* A mirror sends every cell's light to another cell: the diagonal is dark though the room is not. As it stands such a T
 * is refused; with its rows matched to the columns any method serves, and least squares take it with one row more. */
static void check_mirror(const char *storage, uint64_t seed) {
  enum { N = 40 };
  test_room room = room_closed(8, 5, .3, seed);
  const float *entries = clt_transport_entries(room.transport, 0);
  float mirrored[(N + 1) * N] = {0};
  for (size_t i = 0; i < N; i++) {
    memcpy(mirrored + (N - 1 - i) * N, entries + i * N, N * sizeof *mirrored);
  }
  for (size_t i = 0; i < N; i++) { /* nothing comes back to the cell itself */
    mirrored[i * N + i] = 0;
  }
  clt_error error = {0};
  clt_certificate *none = NULL;
  test_room square = {.cells = N};
  assert_ok(clt_transport_create_dense(8, 5, 1, N, &square.transport, &error), error);
  memcpy(clt_transport_entries(square.transport, 0), mirrored, N * N * sizeof *mirrored);
  clt_transport *held = NULL;
  assert_ok(clt_transport_convert(square.transport, storage, &held, &error), error);
  assert_int_equal(clt_certify(held, &none, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "mirror"));
  assert_null(none);
  clt_transport_destroy(held);
  clt_transport_destroy(square.transport);
  hard longer = hard_hold(room_of(N + 1, N, mirrored), storage, seed);
  room_ask(&longer.room, seed, .1, .9);
  const char *methods[] = {"lsmr", "bounded"};
  for (int m = 0; m < 2; m++) {
    assert_string_equal(hard_solve_by(&longer, methods[m], 1e-9).method, methods[m]);
    assert_true(room_distance(longer.room.x, longer.room.known, N) <= 1e-6);
  }
  hard_free(&longer);
  room_free(&room);
}

static void case_07_mirror(void **state) {
  (void)state;
  hard_each(check_mirror);
}

/* Every fifth column 0 or a millionth of what it was; every fifth row asks for light all the same. */
static void darken(test_room *room) {
  size_t n = room->cells;
  float *entries = clt_transport_entries(room->transport, 0);
  for (size_t j = 0; j < n; j += 5) {
    for (size_t i = 0; i < n; i++) {
      entries[i * n + j] *= j / 5 % 2 == 0 ? 0 : 1e-6f;
    }
  }
  room_certify(room);
}

/* Cells whose F is 0, a millionth, or not a number take no part: no drive, no row. The others get what they asked. What
 * is not a number in their rows cannot be told from their answer, and is refused. */
static void check_dark(const char *storage, uint64_t seed) {
  test_room room = room_closed(12, 10, .7, seed);
  size_t n = room.cells;
  darken(&room);
  hard held = hard_hold(room, storage, seed);
  assert_int_equal(clt_certificate_channel(held.certificate, 0)->dark, n / 5);
  room_ask(&held.room, seed, .1, .9);
  for (size_t i = 0; i < n; i += 5) {
    held.room.known[i] = 0;
  }
  room_product(held.room.transport, 0, held.room.known, held.room.b);
  for (size_t i = 0; i < n; i += 5) {
    held.room.b[i] = .7; /* an even target asks of the shadow what it cannot show */
  }
  const char *methods[] = {"pcg", "gmres", "lsmr", "bounded", "auto"};
  for (int m = 0; m < 5; m++) {
    assert_true(hard_solve_by(&held, methods[m], 1e-9).converged);
    for (size_t j = 0; j < n; j++) {
      assert_near(held.room.x[j], held.room.known[j], 1e-6);
    }
  }
  hard_free(&held);
}

/* In single precision, as conversion refuses what is not a number. */
static void check_missing(uint64_t seed) {
  test_room room = room_closed(12, 10, .7, seed);
  size_t n = room.cells, missing = 10 + seed;
  float *entries = clt_transport_entries(room.transport, 0);
  clt_error error = {0};
  clt_certificate *certificate = NULL;
  clt_solve_result result;
  room_ask(&room, seed, .1, .9);
  room.known[missing] = 0;
  room_product(room.transport, 0, room.known, room.b);
  for (size_t j = 0; j < n; j++) {
    entries[missing * n + j] = NAN;
  }
  room_certify(&room);
  assert_int_equal(clt_certificate_lit(room.certificate, 0)[missing], 0);
  clt_solve_options options = {.method = "pcg", .tolerance = 1e-9};
  assert_ok(clt_solve(room.transport, room.certificate, room.b, &options, room.x, &result, &error), error);
  for (size_t j = 0; j < n; j++) {
    assert_near(room.x[j], room.known[j], 1e-6);
  }
  entries[3 * n + 5] = NAN;
  assert_int_equal(clt_certify(room.transport, &certificate, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "row 3 of channel 0"));
  room_free(&room);
}

static void case_08_dark_and_missing_cells(void **state) {
  (void)state;
  hard_each(check_dark);
  for (uint64_t seed = 1; seed <= HARD_SEEDS; seed++) {
    check_missing(seed);
  }
}

static void check_black(const char *storage, uint64_t seed) {
  enum { N = 12 };
  float entries[N * N] = {0};
  hard held = hard_hold(room_of(N, N, entries), storage, seed);
  room_ask(&held.room, seed, 0, 1);
  for (size_t i = 0; i < N; i++) {
    held.room.b[i] = 1 + (double)i;
  }
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    memset(held.room.x, 0x40, N * sizeof(double));
    assert_true(hard_solve_by(&held, clt_method_name(m), 1e-6).converged);
    for (size_t j = 0; j < N; j++) {
      assert_true(held.room.x[j] == 0);
    }
  }
  hard_free(&held);
}

static void case_09_black_scene(void **state) {
  (void)state;
  hard_each(check_black);
}

/* LAPACK's least squares of least norm. */
static void least_norm(const float *entries, size_t rows, size_t cols, const double *b, double *x) {
  size_t longer = rows > cols ? rows : cols;
  double *matrix = room_numbers(rows * cols), *y = room_numbers(longer), *singular = room_numbers(longer);
  lapack_int rank = 0;
  for (size_t k = 0; k < rows * cols; k++) {
    matrix[k] = (double)entries[k];
  }
  memcpy(y, b, rows * sizeof *y);
  assert_int_equal(LAPACKE_dgelsd(LAPACK_ROW_MAJOR, (lapack_int)rows, (lapack_int)cols, 1, matrix, (lapack_int)cols, y,
                                  1, singular, 1e-9, &rank),
                   0);
  memcpy(x, y, cols * sizeof *x);
  free(matrix);
  free(y);
  free(singular);
}

static void check_least_squares(const char *storage, uint64_t seed, size_t rows, size_t cols, bool doubled) {
  float *entries = calloc(rows * cols, sizeof *entries);
  uint64_t random = seed;
  for (size_t k = 0; k < rows * cols; k++) {
    entries[k] = (float)(test_random(&random) + (k / cols == k % cols ? 4 : 0));
  }
  for (size_t i = 0; doubled && i < rows; i++) {
    entries[i * cols + cols - 1] = entries[i * cols + cols - 2];
  }
  hard held = hard_hold(room_of(rows, cols, entries), storage, seed);
  room_ask(&held.room, seed, .2, .8);
  for (size_t i = 0; i < rows; i++) {
    held.room.b[i] *= .95 + .1 * test_random(&random);
  }
  double *wanted = room_numbers(cols);
  least_norm(entries, rows, cols, held.room.b, wanted);
  assert_string_equal(hard_solve_by(&held, "lsmr", 1e-11).method, "lsmr");
  assert_true(room_distance(held.room.x, wanted, cols) <= 1e-5);
  free(entries);
  free(wanted);
  hard_free(&held);
}

static void check_duplicates(const char *storage, uint64_t seed) {
  check_least_squares(storage, seed, 40, 40, true);
}

static void case_10_duplicate_columns(void **state) {
  (void)state;
  hard_each(check_duplicates);
}

static void check_shapes(const char *storage, uint64_t seed) {
  check_least_squares(storage, seed, 70, 40, false);
  check_least_squares(storage, seed, 40, 60, false);
  hard held = hard_hold(room_of(20, 30, (float[600]){1}), storage, seed);
  hard_refused(&held, "pcg", "20 rows and 30 columns; use bounded");
  hard_free(&held);
}

static void case_11_rows_are_not_columns(void **state) {
  (void)state;
  hard_each(check_shapes);
}

/* Adds sigma times standard normal numbers to the entries. */
static void add_noise(test_room *room, double sigma, uint64_t *random) {
  float *entries = clt_transport_entries(room->transport, 0);
  for (size_t k = 0; k < room->cells * room->cells; k++) {
    entries[k] += (float)(sigma * test_normal(random));
  }
}

/* T + E with iid entries of E: the drive that solves it shows T x = b - E x, of which E x has the rms sigma ||x||. */
static void check_noise_law(const char *storage, uint64_t seed) {
  const double sigmas[] = {1e-5, 1e-4, 1e-3, 1e-2};
  for (int k = 0; k < 4; k++) {
    test_room clean = room_cube(5, .6, .2, seed);
    hard held = {0};
    test_room noisy = room_cube(5, .6, .2, seed);
    uint64_t random = 100 * seed + (uint64_t)k;
    add_noise(&noisy, sigmas[k], &random);
    held = hard_hold(noisy, storage, seed);
    room_ask(&held.room, seed, .2, .8);
    hard_solve_by(&held, "gmres", 1e-9);
    size_t n = held.room.cells;
    double *seen = room_numbers(n), off = 0, norm = 0;
    room_product(clean.transport, 0, held.room.x, seen);
    for (size_t i = 0; i < n; i++) {
      off += (seen[i] - held.room.b[i]) * (seen[i] - held.room.b[i]) / (double)n;
      norm += held.room.x[i] * held.room.x[i];
    }
    /* a sum of n squares is within 4 sqrt(2 / n) of its mean */
    assert_near(off / (sigmas[k] * sigmas[k] * norm), 1, 4 * sqrt(2 / (double)n));
    free(seen);
    room_free(&clean);
    hard_free(&held);
  }
}

static void case_13_noise_in_every_entry(void **state) {
  (void)state;
  hard_each(check_noise_law);
}

/* Half of the far entries below zero: bounds and solves stay those of the room. */
static void check_negative(const char *storage, uint64_t seed) {
  test_room room = room_cube(5, .4, .2, seed);
  double clean = hard_radius(&room);
  uint64_t random = seed;
  add_noise(&room, 5e-3, &random);
  size_t negative = 0, n = room.cells;
  for (size_t k = 0; k < n * n; k++) {
    negative += clt_transport_entries(room.transport, 0)[k] < 0;
  }
  hard held = hard_hold(room, storage, seed);
  room_ask(&held.room, seed, .1, .9);
  double *direct = room_numbers(n);
  room_direct(&held.room, 0, held.room.b, direct);
  const clt_channel_certificate *channel = clt_certificate_channel(held.certificate, 0);
  assert_true(negative > n * n / 10);
  assert_true(channel->radius_low <= 1.1 * clean && channel->radius_low >= .8 * clean);
  assert_true(channel->radius_high >= .9 * clean);
  const char *methods[] = {"jacobi", "gmres", "lsmr", "direct", "auto"};
  for (int m = 0; m < 5; m++) {
    hard_solve_by(&held, methods[m], 1e-8);
    assert_true(hard_residual(&held) <= 1.01e-8 && room_distance(held.room.x, direct, n) <= 1e-6);
  }
  free(direct);
  hard_free(&held);
}

static void case_14_negative_noisy_entries(void **state) {
  (void)state;
  hard_each(check_negative);
}

/* Two walls that meet: A_ij ~ 1 / (i + j)^3 from the crease out, over a range of 1e5, one row after the other. T = (I -
 * A)^-1 in double; what its float entries give is within their rounding of the double solution. */
static void check_contact(const char *storage, uint64_t seed) {
  enum { HALF = 48, N = 2 * HALF };
  const double albedo = .5 + .08 * (double)seed;
  double *matrix = room_numbers(N * N), *inverse = room_numbers(N * N), least = INFINITY, most = 0, worst = 0;
  float entries[N * N];
  lapack_int pivots[N];
  for (size_t i = 0; i < N; i++) {
    for (size_t j = 0; j < N; j++) {
      double apart = (double)(i % HALF + j % HALF) + 1, share = (i < HALF) == (j < HALF) ? 0 : pow(apart, -2.5);
      matrix[i * N + j] = share;
      inverse[i * N + j] = i == j;
    }
  }
  for (size_t i = 0; i < N; i++) {
    double sum = cblas_dasum(N, matrix + i * N, 1);
    worst = fmax(worst, sum);
  }
  for (size_t k = 0; k < (size_t)N * N; k++) {
    least = matrix[k] > 0 ? fmin(least, matrix[k]) : least;
    most = fmax(most, matrix[k]);
    matrix[k] = (k % (N + 1) == 0) - albedo * matrix[k] / worst;
  }
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, N, N, matrix, N, pivots, inverse, N), 0);
  for (size_t k = 0; k < (size_t)N * N; k++) {
    entries[k] = (float)inverse[k];
  }
  hard held = hard_hold(room_of(N, N, entries), storage, seed);
  room_ask(&held.room, seed, .1, .9);
  for (size_t i = 0; i < N; i++) { /* what the room itself would show */
    held.room.b[i] = cblas_ddot(N, inverse + i * N, 1, held.room.known, 1);
  }
  const char *methods[] = {"pcg", "gmres", "direct", "stored-inverse", "bounded"};
  assert_true(most / least > 5e4);
  for (int m = 0; m < 5; m++) {
    hard_solve_by(&held, methods[m], 1e-10);
    assert_true(room_distance(held.room.x, held.room.known, N) <= 1e-6);
  }
  free(matrix);
  free(inverse);
  hard_free(&held);
}

static void case_17_contact_corner(void **state) {
  (void)state;
  hard_each(check_contact);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(case_07_mirror),
      cmocka_unit_test(case_08_dark_and_missing_cells),
      cmocka_unit_test(case_09_black_scene),
      cmocka_unit_test(case_10_duplicate_columns),
      cmocka_unit_test(case_11_rows_are_not_columns),
      cmocka_unit_test(case_13_noise_in_every_entry),
      cmocka_unit_test(case_14_negative_noisy_entries),
      cmocka_unit_test(case_17_contact_corner),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
