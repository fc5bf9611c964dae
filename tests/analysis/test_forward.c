/* The forward duals against dense solves in double: series (eq. 14), iteration (41), Monte Carlo (46). */
#include "counterlight/forward.h"
#include "cube.h"

static const double ROUNDING = 1e-14;

/* A cube's A, direct light, and (I - A)^-1 of it by LAPACK. */
typedef struct problem {
  cube room;
  size_t count;
  clt_bounce_entries entries;
  clt_bounce_operator bounce;
  double *direct, *answer, *light;
} problem;

static void solve(problem *of) {
  size_t n = of->count;
  double *matrix = numbers(n * n);
  lapack_int *pivots = calloc(n, sizeof *pivots);
  for (size_t k = 0; k < n * n; k++) {
    matrix[k] = (k % (n + 1) == 0) - of->entries.entries[k];
  }
  memcpy(of->answer, of->direct, n * sizeof *of->answer);
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, (int)n, 1, matrix, (int)n, pivots, of->answer, 1), 0);
  free(matrix);
  free(pivots);
}

/* uneven: every patch has an albedo of its own, up to `albedo`. */
static void problem_init(problem *of, int side, double albedo, bool uneven, uint64_t seed) {
  *of = (problem){.room = cube_make(side, albedo, seed)};
  of->count = of->room.cells;
  of->direct = numbers(of->count);
  of->answer = numbers(of->count);
  of->light = numbers(of->count);
  for (size_t i = 0; i < of->count; i++) {
    double share = uneven ? test_random(&seed) : 1;
    of->direct[i] = test_random(&seed);
    for (size_t j = 0; j < of->count; j++) {
      of->room.exchange[i * of->count + j] *= share;
    }
  }
  of->entries = (clt_bounce_entries){of->count, of->room.exchange};
  of->bounce = clt_bounce_operator_of_entries(&of->entries);
  solve(of);
}

static void problem_finish(problem *of) {
  cube_free(&of->room);
  free(of->direct);
  free(of->answer);
  free(of->light);
}

static double largest(const double *values, const double *less, size_t count) {
  double most = 0;
  for (size_t i = 0; i < count; i++) {
    most = fmax(most, fabs(values[i] - (less != NULL ? less[i] : 0)));
  }
  return most;
}

/* ||S l_d - S_n l_d|| <= m^(n+1) / (1 - m) ||l_d|| (eq. 38), with m the largest row sum of a closed room's A. */
static void the_series_keeps_its_bound(void **state) {
  (void)state;
  static const double albedos[] = {0.3, 0.6, 0.9};
  static const int bounces[] = {0, 1, 2, 5, 10, 40};
  for (int n = 0; n < 18; n++) {
    double m = albedos[n % 3];
    problem of;
    clt_error error = {0};
    clt_forward_result result;
    problem_init(&of, 4, m, false, (uint64_t)n + 1);
    for (int even = 0; even < 2; even++) {
      for (size_t i = 0; i < of.count && even; i++) {
        of.direct[i] = 1;
      }
      solve(&of);
      int terms = bounces[n / 3];
      double bound = pow(m, terms + 1) / (1 - m);
      assert_ok(clt_forward_series(&of.bounce, of.direct, terms, of.light, &result, &error), error);
      double left = largest(of.light, of.answer, of.count);
      assert_true(left <= bound * largest(of.direct, NULL, of.count) * (1 + 1e-9) + ROUNDING);
      assert_true(!even || fabs(left - bound) < 1e-9 * bound + ROUNDING); /* even light attains it */
      assert_near(result.norm, m, 1e-9);
      assert_near(result.bound, bound, 1e-7 * bound);
      assert_int_equal(result.bounces, terms);
    }
    problem_finish(&of);
  }
}

/* In a room of many albedos the bound holds in the norm that it speaks of, so the light meets a dense solve. */
static void series_and_iteration_meet_a_dense_solve(void **state) {
  (void)state;
  static const double albedos[] = {0.2, 0.5, 0.8, 0.95};
  for (int n = 0; n < 8; n++) {
    problem of;
    clt_error error = {0};
    clt_forward_result summed, iterated;
    problem_init(&of, 4, albedos[n % 4], n >= 4, (uint64_t)n + 20);
    assert_ok(clt_forward_iterate(&of.bounce, of.direct, 1e-12, of.light, &iterated, &error), error);
    assert_true(distance(of.count, of.light, of.answer) < 1e-10);
    assert_true(iterated.last <= 1e-12 && iterated.norm < (n >= 4 ? 0.75 : 1) * albedos[n % 4] + 1e-9);
    double *series = numbers(of.count), *one_less = numbers(of.count);
    assert_ok(clt_forward_series(&of.bounce, of.direct, iterated.bounces, series, &summed, &error), error);
    assert_true(distance(of.count, series, of.light) < 1e-14);
    assert_ok(clt_forward_series(&of.bounce, of.direct, 3, series, &summed, &error), error);
    assert_ok(clt_forward_series(&of.bounce, of.direct, 2, one_less, NULL, &error), error);
    double added = 0, whole = 0;
    for (size_t i = 0; i < of.count; i++) {
      added += (series[i] - one_less[i]) * (series[i] - one_less[i]);
      whole += of.direct[i] * of.direct[i];
    }
    assert_near(summed.last, sqrt(added / whole), 1e-12);
    free(series);
    free(one_less);
    problem_finish(&of);
  }
}

/* Cells that the projector does not light, every seventh, receive and do not send. */
static void darken(cube *of) {
  clt_error error = {0};
  float *entries = clt_transport_entries(of->transport, 0);
  for (size_t k = 0; k < of->cells * of->cells; k++) {
    entries[k] = k % of->cells % 7 == 3 ? 0 : entries[k];
  }
  clt_certificate_destroy(of->certificate);
  assert_ok(clt_certify(of->transport, &of->certificate, &error), error);
}

/* With A = I - F T^-1, whatever F is, S F x is T x: at dark cells too. */
static void a_measured_room_leads_back_to_its_transport(void **state) {
  (void)state;
  for (int n = 0; n < 6; n++) {
    cube room = cube_make(4, 0.6, (uint64_t)n + 40);
    clt_error error = {0};
    if (n % 3 == 2) {
      darken(&room);
    }
    clt_interreflection *op = analyse(room.transport, room.certificate, n % 2, 0);
    clt_bounce_operator bounce = clt_bounce_operator_of_transport(op);
    const double *first = clt_interreflection_first_bounce(op, 0);
    double *x = numbers(room.cells), *seen = numbers(room.cells), *light = numbers(room.cells);
    double *entries = numbers(room.cells * room.cells), *next = numbers(room.cells), *product = numbers(room.cells);
    uint64_t seed = (uint64_t)n + 60;
    for (size_t i = 0; i < room.cells; i++) {
      x[i] = test_random(&seed) * first[i]; /* F x, for x in 0..1 */
      light[i] = first[i] > 0 ? x[i] / first[i] : 0;
    }
    clt_transport_apply(room.transport, 0, light, seen);
    assert_ok(clt_forward_iterate(&bounce, x, 1e-9, light, NULL, &error), error);
    assert_true(distance(room.cells, light, seen) < 1e-7);
    assert_ok(clt_interreflection_entries(op, 0, entries, &error), error);
    clt_bounce_entries dense = {room.cells, entries};
    bounce = clt_bounce_operator_of_entries(&dense);
    assert_ok(clt_forward_iterate(&bounce, x, 1e-9, light, NULL, &error), error);
    assert_true(distance(room.cells, light, seen) < 1e-7);
    multiply(room.cells, entries, x, product);
    assert_ok(clt_interreflection_apply(op, x, next, NULL, &error), error);
    assert_true(distance(room.cells, next, product) < 1e-7);
    free(x);
    free(seen);
    free(light);
    free(entries);
    free(next);
    free(product);
    clt_interreflection_destroy(op);
    cube_free(&room);
  }
}

enum { SEEDS = 400 };

/* Means over seeds lie within 4 of their standard errors of the answer; returns the mean square error of a cell, and
 * that which the estimates say of themselves. */
static double mean_square(problem *of, const clt_forward_paths *paths, int samples, double *told) {
  clt_error error = {0};
  double *sum = numbers(of->count), *squares = numbers(of->count), *deviation = numbers(of->count), all = 0;
  *told = 0;
  for (uint64_t seed = 0; seed < SEEDS; seed++) {
    assert_ok(clt_forward_paths_estimate(paths, of->direct, samples, seed, of->light, deviation, &error), error);
    for (size_t i = 0; i < of->count; i++) {
      double off = of->light[i] - of->answer[i];
      sum[i] += off;
      squares[i] += off * off;
      *told += deviation[i] * deviation[i] / (SEEDS * (double)of->count);
    }
  }
  for (size_t i = 0; i < of->count; i++) {
    double mean = sum[i] / SEEDS, error_of_mean = sqrt(squares[i] / SEEDS / SEEDS);
    assert_true(fabs(mean) < 4 * error_of_mean);
    all += squares[i] / (SEEDS * (double)of->count);
  }
  free(sum);
  free(squares);
  free(deviation);
  return all;
}

static void paths_are_unbiased_and_know_their_error(void **state) {
  (void)state;
  static const double albedos[] = {0.3, 0.7, 0.9};
  static const int samples[] = {4, 16, 64};
  for (int n = 0; n < 6; n++) {
    problem of;
    clt_error error = {0};
    clt_forward_paths *paths = NULL;
    problem_init(&of, 3, albedos[n % 3], n >= 3, (uint64_t)n + 80);
    assert_ok(clt_forward_paths_create(&of.bounce, &paths, &error), error);
    assert_true(n >= 3 || fabs(clt_forward_paths_ratio(paths) - albedos[n]) < 1e-6); /* the law of eq. 38's terms */
    double square[3], told[3];
    for (int k = 0; k < 3; k++) {
      square[k] = mean_square(&of, paths, samples[k], &told[k]);
      assert_near(told[k] / square[k], 1, 0.1);
    }
    double slope = log(square[2] / square[0]) / log(16);
    print_message("albedo %g%s: variance falls as samples^%.3f\n", albedos[n % 3], n >= 3 ? ", uneven" : "", slope);
    assert_near(slope, -1, 0.05);
    clt_forward_paths_destroy(paths);
    problem_finish(&of);
  }
}

static void light_that_would_not_settle_is_refused(void **state) {
  (void)state;
  static const double albedos[] = {1, 1.2};
  for (int n = 0; n < 2; n++) {
    problem of;
    clt_error error = {0};
    clt_forward_paths *paths = NULL;
    problem_init(&of, 2, 0.5, false, 7);
    for (size_t k = 0; k < of.count * of.count; k++) {
      of.room.exchange[k] *= albedos[n] / 0.5;
    }
    assert_int_equal(clt_forward_series(&of.bounce, of.direct, 3, of.light, NULL, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, n == 0 ? "||A|| <= 1 " : "||A|| <= 1.2 "));
    assert_int_equal(clt_forward_iterate(&of.bounce, of.direct, 1e-3, of.light, NULL, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "cannot be shown to be below 1"));
    assert_int_equal(clt_forward_paths_create(&of.bounce, &paths, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "||A|| < 1"));
    problem_finish(&of);
  }
}

/* A with negative entries whose even light fades and whose uneven light grows: the bound does not see it, the bounces
 * do. */
static void bounces_that_grow_are_noticed(void **state) {
  (void)state;
  enum { COUNT = 12 };
  static const double radii[] = {1.1, 1.3, 2};
  for (int n = 0; n < 3; n++) {
    double matrix[COUNT * COUNT], direct[COUNT], light[COUNT];
    uint64_t seed = (uint64_t)n + 1;
    for (size_t k = 0; k < (size_t)COUNT * COUNT; k++) { /* .9 for even light, -radius for the rest */
      matrix[k] = (0.9 + radii[n]) / COUNT - (k % (COUNT + 1) == 0 ? radii[n] : 0);
    }
    for (int i = 0; i < COUNT; i++) {
      direct[i] = test_random(&seed);
    }
    clt_bounce_entries entries = {COUNT, matrix};
    clt_bounce_operator bounce = clt_bounce_operator_of_entries(&entries);
    clt_error error = {0};
    assert_int_equal(clt_forward_series(&bounce, direct, 40, light, NULL, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "||A|| is not below 1"));
    assert_int_equal(clt_forward_iterate(&bounce, direct, 1e-6, light, NULL, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "||A|| is not below 1"));
  }
}

static void what_cannot_be_asked_is_refused(void **state) {
  (void)state;
  problem of;
  clt_error error = {0};
  clt_forward_paths *paths = NULL;
  problem_init(&of, 1, 0.5, false, 9);
  clt_bounce_operator without = {of.count, of.bounce.apply, NULL, of.bounce.context};
  assert_int_equal(clt_forward_paths_create(&without, &paths, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "rows of A"));
  assert_int_equal(clt_forward_series(&of.bounce, of.direct, -1, of.light, NULL, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_forward_iterate(&of.bounce, of.direct, 0, of.light, NULL, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_forward_iterate(&of.bounce, of.direct, NAN, of.light, NULL, &error), CLT_BAD_INPUT);
  assert_ok(clt_forward_paths_create(&of.bounce, &paths, &error), error);
  assert_int_equal(clt_forward_paths_estimate(paths, of.direct, 0, 1, of.light, NULL, &error), CLT_BAD_INPUT);
  assert_ok(clt_forward_paths_estimate(paths, of.direct, 1, 1, of.light, of.answer, &error), error);
  assert_true(isinf(of.answer[0])); /* one sample says nothing of its spread */
  of.direct[2] = NAN;
  assert_int_equal(clt_forward_series(&of.bounce, of.direct, 1, of.light, NULL, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "value 2"));
  assert_int_equal(clt_forward_paths_estimate(paths, of.direct, 9, 1, of.light, NULL, &error), CLT_BAD_INPUT);
  clt_forward_paths_destroy(paths);
  clt_forward_paths_destroy(NULL);
  of.direct[2] = 1;
  of.room.exchange[3] = NAN;
  assert_int_equal(clt_forward_series(&of.bounce, of.direct, 1, of.light, NULL, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "finite"));
  assert_int_equal(clt_forward_paths_create(&of.bounce, &paths, &error), CLT_BAD_INPUT);
  problem_finish(&of);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_series_keeps_its_bound),
      cmocka_unit_test(series_and_iteration_meet_a_dense_solve),
      cmocka_unit_test(a_measured_room_leads_back_to_its_transport),
      cmocka_unit_test(paths_are_unbiased_and_know_their_error),
      cmocka_unit_test(light_that_would_not_settle_is_refused),
      cmocka_unit_test(bounces_that_grow_are_noticed),
      cmocka_unit_test(what_cannot_be_asked_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
