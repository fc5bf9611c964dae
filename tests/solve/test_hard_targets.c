/* Hard cases of what is asked for, and of methods that do not fit. */
#include "hard.h"
#include "solve/method.h"

/* ||l - P(l - g)|| of l = F x, relative to its value at x = 0, with g = S' (S l - b) and P the projection on 0 <= l <=
 * F; from the float entries in double. */
static double optimality(const hard *held, const double *x) {
  size_t n = held->room.cells;
  const float *entries = clt_transport_entries(held->room.transport, 0);
  double *r = room_numbers(n), *g = room_numbers(n), norm[2] = {0};
  for (int k = 0; k < 2; k++) {
    double *zero = room_numbers(n);
    const double *at = k == 0 ? zero : x;
    memset(g, 0, n * sizeof *g);
    room_product(held->room.transport, 0, at, r);
    for (size_t i = 0; i < n; i++) {
      for (size_t j = 0; j < n; j++) {
        g[j] += (double)entries[i * n + j] * (r[i] - held->room.b[i]);
      }
    }
    for (size_t j = 0; j < n; j++) {
      double top = entries[j * n + j], l = top * at[j], moved = fmin(fmax(l - g[j] / top, 0), top);
      norm[k] += (l - moved) * (l - moved);
    }
    free(zero);
  }
  free(r);
  free(g);
  return sqrt(norm[1] / norm[0]);
}

/* Black and white squares in a bright room: the blacks receive more than they may show. Barzilai-Borwein steps without
 * a safeguard cycle here. */
static void check_checker(const char *storage, uint64_t seed) {
  hard held = hard_hold(room_cube(5, .95, .04 * (double)(seed - 1), seed), storage, seed);
  room_ask(&held.room, seed, 0, 1);
  size_t squares = 1 + seed % 3;
  for (size_t i = 0; i < held.room.cells; i++) {
    double first = clt_transport_entries(held.room.transport, 0)[i * held.room.cells + i];
    held.room.b[i] = (i / 30 / squares + i % 30 / squares) % 2 ? 2 * first : 0;
  }
  clt_solve_result result = hard_solve_by(&held, "bounded", 1e-6);
  assert_true(result.converged && result.iterations <= 40);
  assert_true(optimality(&held, held.room.x) <= 1e-6 * (1 + 1e-6));
  double best = hard_residual(&held), clamped;
  hard_solve_by(&held, "gmres", 1e-10);
  for (size_t j = 0; j < held.room.cells; j++) {
    held.room.x[j] = fmin(fmax(held.room.x[j], 0), 1);
  }
  clamped = hard_residual(&held);
  assert_true(clamped > 1.3 * best);
  hard_free(&held);
}

static void case_15_infeasible_checker(void **state) {
  (void)state;
  hard_each(check_checker);
}

static void check_feasible(const char *storage, uint64_t seed) {
  hard held = hard_hold(room_cube(5, .8, .5, seed), storage, seed);
  room_ask(&held.room, seed, .02, .98);
  double *unbounded = room_numbers(held.room.cells);
  clt_solve_result linear = hard_solve_by(&held, "auto", 1e-9);
  assert_true(linear.converged && strcmp(linear.method, "bounded") != 0);
  memcpy(unbounded, held.room.x, held.room.cells * sizeof *unbounded);
  assert_true(hard_solve_by(&held, "bounded", 1e-9).converged);
  assert_true(room_distance(held.room.x, unbounded, held.room.cells) <= 1e-7);
  assert_true(room_distance(held.room.x, held.room.known, held.room.cells) <= 1e-7);
  free(unbounded);
  hard_free(&held);
}

static void case_16_feasible_target(void **state) {
  (void)state;
  hard_each(check_feasible);
}

/* Channels of albedo .95, .05 and 0 reach the tolerance each, apart and together. */
static void check_channels(const char *storage, uint64_t seed) {
  hard held = hard_hold(
      room_make((recipe){.width = 10, .height = 8, .channels = 3, .seed = seed, .albedo = {.95, .05, 0}, .spread = .2}),
      storage, seed);
  size_t n = held.room.cells;
  room_ask(&held.room, seed, .1, .9);
  double *y = room_numbers(n);
  for (int together = 0; together < 2; together++) {
    hard_solve(&held, &(clt_solve_options){.method = "pcg", .tolerance = 1e-7, .together = together});
    for (int c = 0; c < 3; c++) {
      const double *x = held.room.x + (size_t)c * n, *b = held.room.b + (size_t)c * n;
      room_product(held.room.transport, c, x, y);
      assert_true(room_distance(y, b, n) <= 1.01e-7);
      assert_true(room_distance(x, held.room.known + (size_t)c * n, n) <= 1e-5);
    }
  }
  free(y);
  hard_free(&held);
}

static void case_22_channels_of_unlike_albedo(void **state) {
  (void)state;
  hard_each(check_channels);
}

/* The upper bound of the spectrum 10 % low: Chebyshev's residual grows, which it notices, and raises the bound. */
static void check_low_bound(const char *storage, uint64_t seed) {
  hard held = hard_hold(room_cube(5, .95, 0, seed), storage, seed);
  clt_error error = {0};
  clt_system system;
  room_ask(&held.room, seed, 0, 1);
  assert_ok(clt_system_init(&system, held.transport, false, &error), error);
  assert_ok(clt_system_reserve(&system, clt_method_chebyshev.vectors, &error), error);
  clt_system_select(&system, 0, clt_certificate_first_bounce(held.certificate, 0),
                    clt_certificate_lit(held.certificate, 0));
  system.flux = clt_certificate_flux(held.certificate, 0);
  clt_system_want(&system, held.room.b);
  clt_run run = {.tolerance = 1e-6, .iteration_limit = 500, .radius_high = .9 * (1 + hard_radius(&held.room)) - 1};
  assert_int_equal(clt_method_chebyshev.run(&system, &run), CLT_RUN_CONVERGED);
  for (size_t j = 0; j < held.room.cells; j++) {
    held.room.x[j] = system.light[j] * system.scale[j];
  }
  assert_true(hard_residual(&held) <= 1.01e-6 && run.iterations < 100);
  clt_system_finish(&system);
  hard_free(&held);
}

static void case_25_upper_bound_too_low(void **state) {
  (void)state;
  hard_each(check_low_bound);
}

/* A cut to another picture while the start is the last one's drive: the same final error as from zero, in hardly more
 * iterations; a picture that moved a little takes fewer. */
static void check_cut(const char *storage, uint64_t seed) {
  hard held = hard_hold(room_cube(5, .9, .3, seed), storage, seed);
  size_t n = held.room.cells;
  room_ask(&held.room, seed, .1, .9);
  double *before = room_numbers(n), *after = room_numbers(n), *cold = room_numbers(n);
  memcpy(before, held.room.known, n * sizeof *before);
  room_wanted(&held.room, seed + 50, .1, .9, after, held.room.b);
  const char *methods[] = {"pcg", "gmres", "chebyshev", "bounded"};
  for (int m = 0; m < 4; m++) {
    clt_solve_options options = {.method = methods[m], .tolerance = 1e-6};
    int from_zero = hard_solve(&held, &options).iterations;
    double error = hard_residual(&held);
    memcpy(cold, held.room.x, n * sizeof *cold);
    options.start = before;
    int from_last = hard_solve(&held, &options).iterations;
    assert_true(error <= 1.01e-6 * (m == 3 ? 10 : 1) && hard_residual(&held) <= 1.01e-6 * (m == 3 ? 10 : 1));
    assert_true(from_last <= from_zero + 3);
    assert_true(room_distance(held.room.x, cold, n) <= 3e-5);
  }
  free(before);
  free(after);
  free(cold);
  hard_free(&held);
}

static void case_26_scene_cut_while_warm(void **state) {
  (void)state;
  hard_each(check_cut);
}

/* Terms that do not die away have no mean to sample: refused, with eq. 48's condition. */
static void check_montecarlo(const char *storage, uint64_t seed) {
  const double albedos[] = {.51, .62, .9, .99};
  for (int k = 0; k < 4; k++) {
    hard held = hard_hold(room_closed(9, 6, albedos[k], seed), storage, seed);
    double radius = hard_radius(&held.room);
    assert_true(radius >= 1 && radius <= albedos[k] / (1 - albedos[k])); /* less by the light in F = diag(T) */
    hard_refused(&held, "montecarlo", "must be below 1");
    hard_refused(&held, "hybrid", "eq. 48 needs m < 1/2");
    hard_free(&held);
  }
}

static void case_28_montecarlo_beyond_one_half(void **state) {
  (void)state;
  hard_each(check_montecarlo);
}

/* A T that no flux makes symmetric, given to conjugate gradients: they meet a direction of negative curvature or stop
 * gaining, say so, and GMRES finishes; auto never gives it to them. */
static void check_asymmetric(const char *storage, uint64_t seed) {
  enum { N = 24 };
  float entries[N * N] = {0};
  uint64_t random = seed;
  for (size_t i = 0; i < N; i++) { /* a strong one-way ring with a chord: symmetric part indefinite */
    entries[i * N + i] = 1;
    entries[i * N + (i + 1) % N] = (float)(1.6 + .3 * test_random(&random));
    entries[(i + 7) % N * N + i] += .8f;
  }
  hard held = hard_hold(room_of(N, N, entries), storage, seed);
  room_ask(&held.room, seed, -1, 1);
  clt_solve_result asked = hard_solve_by(&held, "pcg", 1e-8);
  assert_string_equal(asked.method, "gmres");
  assert_non_null(strstr(asked.reason, "pcg stopped as"));
  assert_true(hard_residual(&held) <= 1.01e-8);
  assert_true(clt_certificate_channel(held.certificate, 0)->reciprocity > CLT_RECIPROCAL);
  room_wanted(&held.room, seed, .1, .9, held.room.known, held.room.b);
  clt_solve_result taken = hard_solve_by(&held, "auto", 1e-8);
  assert_null(strstr(taken.method, "pcg"));
  assert_true(hard_residual(&held) <= 1.01e-8);
  hard_free(&held);
}

static void case_30_asymmetric_transport_given_to_cg(void **state) {
  (void)state;
  hard_each(check_asymmetric);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(case_15_infeasible_checker),
      cmocka_unit_test(case_16_feasible_target),
      cmocka_unit_test(case_22_channels_of_unlike_albedo),
      cmocka_unit_test(case_25_upper_bound_too_low),
      cmocka_unit_test(case_26_scene_cut_while_warm),
      cmocka_unit_test(case_28_montecarlo_beyond_one_half),
      cmocka_unit_test(case_30_asymmetric_transport_given_to_cg),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
