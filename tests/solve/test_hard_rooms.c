/* Hard cases of the spectrum: albedos near 1, thresholds, eigenvalues of both signs, growth, rooms apart. */
#include <cblas.h>

#include "analysis/cube.h"
#include "hard.h"

/* The direct light within 1e-3: in at most six steps of conjugate gradients at every albedo. */
static void check_closed_box(const char *storage, uint64_t seed) {
  const double albedos[] = {.5, .51, .62, .9, .99};
  for (int k = 0; k < 5; k++) {
    hard held = hard_hold(room_cube(5, albedos[k], 0, seed), storage, seed);
    room_ask(&held.room, seed, 0, 1);
    clt_solve_result result = hard_solve_by(&held, "pcg", 1e-3);
    double radius = hard_radius(&held.room);
    const clt_channel_certificate *channel = clt_certificate_channel(held.certificate, 0);
    assert_string_equal(result.method, "pcg");
    assert_true(result.iterations <= 6 && hard_residual(&held) <= 1e-3);
    assert_true(channel->radius_low <= radius * (1 + 1e-6) && radius <= channel->radius_high * (1 + 1e-6));
    assert_true(channel->radius_high <= radius * 1.01);
    if (radius >= 1) {
      hard_refused(&held, "jacobi", "rho(R)");
    } else {
      assert_true(hard_solve_by(&held, "jacobi", 1e-3).converged && hard_residual(&held) <= 1e-3);
    }
    hard_free(&held);
  }
}

static void case_01_closed_box(void **state) {
  (void)state;
  hard_each(check_closed_box);
}

static void check_nearly_lossless(const char *storage, uint64_t seed) {
  hard held = hard_hold(room_closed(10, 8, 1 - 1e-6, seed), storage, seed);
  room_ask(&held.room, seed, 0, 1);
  const char *methods[] = {"pcg", "deflated-pcg", "gmres", "lsmr", "direct", "auto"};
  for (int m = 0; m < 6; m++) {
    hard_solve_by(&held, methods[m], 1e-4);
    for (size_t j = 0; j < held.room.cells; j++) {
      assert_true(isfinite(held.room.x[j]));
    }
    assert_true(hard_residual(&held) < 1e-3);
  }
  hard_free(&held);
}

static void case_02_nearly_lossless_room(void **state) {
  (void)state;
  hard_each(check_nearly_lossless);
}

/* A cube without its last face. The form factors are closed forms; 6 x 6 patches a face. */
static test_room five_sides(double albedo, uint64_t seed, double *top) {
  enum { SIDE = 6, N = 5 * SIDE * SIDE };
  double *matrix = room_numbers(N * N), *inverse = room_numbers(N * N), *x = room_numbers(2 * N);
  float *entries = calloc((size_t)N * N, sizeof *entries);
  lapack_int pivots[N];
  for (size_t i = 0; i < N; i++) {
    size_t from = i / (5 * SIDE) * 6 * SIDE + i % (5 * SIDE);
    for (size_t j = 0; j < N; j++) {
      size_t to = j / (5 * SIDE) * 6 * SIDE + j % (5 * SIDE);
      matrix[i * N + j] = -albedo * SIDE * SIDE * cube_pair(SIDE, from, to);
      inverse[i * N + j] = i == j;
    }
    x[i] = 1;
  }
  for (int step = 0; step < 200; step++) { /* the Perron root of A */
    multiply(N, matrix, x, x + N);
    *top = 0;
    for (size_t i = 0; i < N; i++) {
      *top = fmax(*top, -x[N + i]);
    }
    for (size_t i = 0; i < N; i++) {
      x[i] = -x[N + i] / *top;
    }
  }
  for (size_t i = 0; i < N; i++) {
    matrix[i * N + i] += 1;
  }
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, N, N, matrix, N, pivots, inverse, N), 0);
  for (size_t k = 0; k < (size_t)N * N; k++) {
    entries[k] = (float)(inverse[k] * (.3 + .7 * test_random(&(uint64_t){seed + k % N})));
  }
  test_room room = room_of(N, N, entries);
  free(matrix);
  free(inverse);
  free(x);
  free(entries);
  return room;
}

/* Jacobi's limit m = 1/2 lies at albedo .610 for five sides; with F = diag(T), which holds light that came back, a
 * little higher. The certificate must be right on either side of it. */
static void check_five_sides(const char *storage, uint64_t seed) {
  const double albedos[] = {.60, .61, .63};
  for (int k = 0; k < 3; k++) {
    double top;
    hard held = hard_hold(five_sides(albedos[k], seed, &top), storage, seed);
    room_ask(&held.room, seed, 0, 1);
    double radius = hard_radius(&held.room);
    const clt_channel_certificate *channel = clt_certificate_channel(held.certificate, 0);
    assert_near(.5 * albedos[k] / top, .610, .004);
    assert_true(radius < top / (1 - top));
    assert_true(channel->radius_low <= radius * (1 + 1e-6) && radius <= channel->radius_high * (1 + 1e-6));
    assert_true((channel->radius_high < 1) == (radius < 1) && (channel->radius_low >= 1) == (radius >= 1));
    if (radius < 1) {
      assert_true(hard_solve(&held, &(clt_solve_options){.method = "jacobi", .iteration_limit = 20000}).converged);
      assert_true(hard_residual(&held) <= 1e-4);
    } else {
      hard_refused(&held, "jacobi", "must be below 1");
    }
    hard_free(&held);
  }
}

static void case_03_five_sides_at_the_threshold(void **state) {
  (void)state;
  hard_each(check_five_sides);
}

/* Light that only goes to and fro between two plates: with v the Perron vector of A, m v = A v, the vector that has v
 * on one plate and -v on the other belongs to -m. */
static void assert_spectrum_is_even(const test_room *room) {
  size_t n = room->cells;
  double *first = room_numbers(n), *v = room_numbers(2 * n), *next = v + n, m = 0;
  double *a = exchange_of(room->transport, 0, true, first);
  for (size_t i = 0; i < n; i++) {
    v[i] = 1;
  }
  for (int step = 0; step < 300; step++) {
    multiply(n, a, v, next);
    m = cblas_dnrm2((blasint)n, next, 1) / cblas_dnrm2((blasint)n, v, 1);
    for (size_t i = 0; i < n; i++) {
      v[i] = (v[i] + next[i] / m) / 2; /* half a step: A alone would swap the plates for ever */
    }
  }
  for (size_t i = n / 2; i < n; i++) {
    v[i] = -v[i];
  }
  multiply(n, a, v, next);
  for (size_t i = 0; i < n; i++) {
    assert_near(next[i], -m * v[i], 1e-4);
  }
  assert_true(m > .8);
  free(first);
  free(v);
  free(a);
}

/* The spectrum of A is even and that of S reaches down to 1 / (1 + m). */
static void check_parallel_plates(const char *storage, uint64_t seed) {
  hard held = hard_hold(
      room_make((recipe){.width = 10, .height = 8, .channels = 1, .seed = seed, .albedo = {.9}, .shape = SHAPE_PLATES}),
      storage, seed);
  size_t n = held.room.cells;
  room_ask(&held.room, seed, 0, 1);
  assert_spectrum_is_even(&held.room);
  double radius = clt_certificate_channel(held.certificate, 0)->radius_high, m = radius / (1 + radius);
  double q = m / (1 + sqrt(1 - m * m));
  const char *methods[] = {"chebyshev", "damped", "pcg", "gmres"};
  for (int k = 0; k < 4; k++) {
    clt_solve_result result = hard_solve_by(&held, methods[k], 1e-6);
    assert_string_equal(result.method, methods[k]);
    assert_true(hard_residual(&held) <= 1.01e-6);
    /* the laws of NUMERICS section 1, from a residual of at most cond(S) = (1 + m) / (1 - m) */
    assert_true(k != 0 || result.iterations <= ceil(log(1e-6 / 2 * (1 - m) / (1 + m)) / log(q)));
    assert_true(k != 1 || result.iterations <= ceil(log(1e-6 * (1 - m) / (1 + m)) / log(m)));
    assert_true(room_distance(held.room.x, held.room.known, n) <= 1e-4);
  }
  hard_refused(&held, "jacobi", "must be below 1");
  hard_free(&held);
}

static void case_04_parallel_plates(void **state) {
  (void)state;
  hard_each(check_parallel_plates);
}

/* A = m P, P a cyclic shift, is as far from symmetric as A can be: T = (I - m P)^-1 F has the entries m^k / (1 - m^n).
 * Damping by 1 - m^2 still gains the factor m an iteration. */
static void check_cyclic_shift(const char *storage, uint64_t seed) {
  enum { N = 48 };
  const double m = .5 + .08 * (double)seed;
  float entries[N * N];
  uint64_t random = seed;
  for (int j = 0; j < N; j++) {
    double phi = .3 + .7 * test_random(&random);
    for (int i = 0; i < N; i++) {
      entries[i * N + j] = (float)(phi * pow(m, (i - j + N) % N) / (1 - pow(m, N)));
    }
  }
  hard held = hard_hold(room_of(N, N, entries), storage, seed);
  room_ask(&held.room, seed, 0, 1);
  double residual[2];
  for (int k = 0; k < 2; k++) {
    clt_solve_options options = {.method = "damped", .tolerance = 1e-12, .iteration_limit = 12 * (k + 1)};
    hard_solve(&held, &options);
    residual[k] = hard_residual(&held);
  }
  assert_near(pow(residual[1] / residual[0], 1. / 12), m, .02 * m);
  assert_true(clt_certificate_channel(held.certificate, 0)->reciprocity > .2);
  clt_solve_result taken = hard_solve_by(&held, "auto", 1e-8); /* one that needs no symmetry, the faster of two */
  assert_true(strcmp(taken.method, "gmres") == 0 || strcmp(taken.method, "damped") == 0);
  assert_true(room_distance(held.room.x, held.room.known, N) <= 1e-6);
  hard_free(&held);
}

static void case_05_cyclic_shift(void **state) {
  (void)state;
  hard_each(check_cyclic_shift);
}

/* R is nilpotent: Jacobi's residual grows by a factor of hundreds, then is 0. That is no divergence. */
static void check_transient_growth(const char *storage, uint64_t seed) {
  enum { MOST = 12 };
  size_t n = 5 + seed;
  float entries[MOST * MOST] = {0};
  for (size_t i = 0; i < n; i++) {
    entries[i * n + i] = 1;
    if (i + 1 < n) {
      entries[i * n + i + 1] = 2;
    }
  }
  hard held = hard_hold(room_of(n, n, entries), storage, seed);
  room_ask(&held.room, seed, 0, 1);
  double most = 0;
  for (int limit = 1; limit < (int)n; limit++) { /* of the iterates, which the solve does not return when worse */
    double *x = room_numbers(n), *y = room_numbers(n);
    for (int step = 0; step < limit; step++) {
      room_product(held.room.transport, 0, x, y);
      for (size_t i = 0; i < n; i++) {
        x[i] += held.room.b[i] - y[i];
      }
    }
    most = fmax(most, room_residual(&held.room, x, held.room.b));
    free(x);
    free(y);
  }
  clt_solve_result result = hard_solve_by(&held, "jacobi", 1e-10);
  assert_true(most > 2);
  assert_string_equal(result.method, "jacobi");
  assert_true(result.iterations <= (int)n && hard_residual(&held) <= 1e-10);
  hard_free(&held);
}

static void case_06_transient_growth(void **state) {
  (void)state;
  hard_each(check_transient_growth);
}

/* Two rooms in one grid, a dark one and a bright one: the bounds are those of the brighter, and both are solved. */
static void check_rooms_apart(const char *storage, uint64_t seed) {
  test_room parts[2] = {room_closed(8, 5, .2, seed), room_closed(8, 5, .9, seed + 9)};
  size_t part = parts[0].cells, n = 2 * part;
  float *entries = calloc(n * n, sizeof *entries);
  for (size_t p = 0; p < 2; p++) {
    for (size_t i = 0; i < part; i++) {
      memcpy(entries + (p * part + i) * n + p * part, clt_transport_entries(parts[p].transport, 0) + i * part,
             part * sizeof *entries);
    }
  }
  double bright = hard_radius(&parts[1]), dark = hard_radius(&parts[0]);
  hard held = hard_hold(room_of(n, n, entries), storage, seed);
  room_ask(&held.room, seed, 0, 1);
  const clt_channel_certificate *channel = clt_certificate_channel(held.certificate, 0);
  assert_true(dark < .5 * bright);
  assert_true(channel->radius_low <= bright * (1 + 1e-6) && channel->radius_low >= .9 * bright);
  assert_true(channel->radius_high >= bright * (1 - 1e-6) && channel->radius_high <= 1.1 * bright);
  assert_true(hard_solve_by(&held, "auto", 1e-8).converged);
  for (size_t p = 0; p < 2; p++) {
    assert_true(room_distance(held.room.x + p * part, held.room.known + p * part, part) <= 1e-6);
    room_free(&parts[p]);
  }
  free(entries);
  hard_free(&held);
}

static void case_20_disconnected_rooms(void **state) {
  (void)state;
  hard_each(check_rooms_apart);
}

/* Nothing comes back: T is F, and every method has the answer at once. */
static void check_albedo_zero(const char *storage, uint64_t seed) {
  hard held = hard_hold(room_closed(8, 6, 0, seed), storage, seed);
  room_ask(&held.room, seed, 0, 1);
  const clt_channel_certificate *channel = clt_certificate_channel(held.certificate, 0);
  assert_true(channel->radius_low == 0 && channel->radius_high == 0 && channel->reciprocity == 0);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    clt_solve_result result = hard_solve_by(&held, clt_method_name(m), 1e-9);
    /* lsmr works on T itself, where the others work on T F^-1 = I */
    assert_true(result.iterations <= (strcmp(result.method, "lsmr") == 0 ? (int)held.room.cells : 2));
    for (size_t j = 0; j < held.room.cells; j++) {
      double entry = clt_transport_entries(held.room.transport, 0)[j * held.room.cells + j];
      assert_near(held.room.x[j], held.room.b[j] / entry, 1e-6);
    }
  }
  hard_free(&held);
}

static void case_21_albedo_zero(void **state) {
  (void)state;
  hard_each(check_albedo_zero);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(case_01_closed_box),
      cmocka_unit_test(case_02_nearly_lossless_room),
      cmocka_unit_test(case_03_five_sides_at_the_threshold),
      cmocka_unit_test(case_04_parallel_plates),
      cmocka_unit_test(case_05_cyclic_shift),
      cmocka_unit_test(case_06_transient_growth),
      cmocka_unit_test(case_20_disconnected_rooms),
      cmocka_unit_test(case_21_albedo_zero),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
