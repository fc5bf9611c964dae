/* Monte Carlo over paths of cells: unbiased, of the variance that it should have, and refused where it has none. */
#include <omp.h>

#include "rooms.h"
#include "solve/paths.h"

/* S of the room's only channel, its paths, b and S^-1 b. */
typedef struct problem {
  test_room room;
  size_t count;
  clt_matrix matrix;
  clt_paths paths;
  double *b, *answer, *out, *last;
} problem;

static void take_matrix(problem *of) {
  clt_error error = {0};
  clt_system system;
  assert_ok(clt_system_init(&system, of->room.transport, false, &error), error);
  clt_system_select(&system, 0, clt_certificate_first_bounce(of->room.certificate, 0),
                    clt_certificate_lit(of->room.certificate, 0));
  assert_ok(clt_matrix_init(&of->matrix, &system, "test", &error), error);
  clt_system_finish(&system);
}

static problem problem_of(test_room room) {
  clt_error error = {0};
  problem of = {.room = room, .count = room.cells};
  take_matrix(&of);
  assert_int_equal(of.matrix.count, of.count);
  assert_ok(clt_paths_init(&of.paths, &of.matrix, "", &error), error);
  of.b = room_numbers(of.count);
  of.answer = room_numbers(of.count);
  of.out = room_numbers(of.count);
  of.last = room_numbers(of.count);
  double *s = room_numbers(of.count * of.count);
  lapack_int n = (lapack_int)of.count, *pivots = calloc(of.count, sizeof *pivots);
  uint64_t random = 4;
  for (size_t i = 0; i < of.count; i++) {
    of.b[i] = of.answer[i] = .2 + test_random(&random);
  }
  memcpy(s, of.matrix.entries, of.count * of.count * sizeof *s);
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, n, 1, s, n, pivots, of.answer, 1), 0);
  free(s);
  free(pivots);
  return of;
}

static void problem_free(problem *of) {
  clt_paths_finish(&of->paths);
  clt_matrix_finish(&of->matrix);
  room_free(&of->room);
  free(of->b);
  free(of->answer);
  free(of->out);
  free(of->last);
}

/* Mean of squares of the estimates' errors over the cells, and over `seeds`. */
static double mean_square(problem *of, int samples, uint64_t seeds) {
  double sum = 0;
  for (uint64_t seed = 0; seed < seeds; seed++) {
    clt_paths_estimate(&of->paths, of->b, samples, 1000 * (uint64_t)samples + seed, of->out, NULL);
    for (size_t i = 0; i < of->count; i++) {
      sum += (of->out[i] - of->answer[i]) * (of->out[i] - of->answer[i]);
    }
  }
  return sum / (double)(seeds * of->count);
}

/* The mean over seeds lies within 4 of its standard errors of `wanted`, in every cell; so do their squares' mean of 1.
 */
static void assert_unbiased(problem *of, const double *wanted, int steps) {
  enum { SEEDS = 600, SAMPLES = 10 };
  double *sum = room_numbers(of->count), *squares = room_numbers(of->count), worst = 0, mean = 0;
  for (uint64_t seed = 0; seed < SEEDS; seed++) {
    if (steps > 0) {
      clt_paths_hybrid(&of->paths, of->b, SAMPLES, steps, seed, of->last, of->out);
    } else {
      clt_paths_estimate(&of->paths, of->b, SAMPLES, seed, of->out, NULL);
    }
    for (size_t i = 0; i < of->count; i++) {
      sum[i] += of->out[i];
      squares[i] += of->out[i] * of->out[i];
    }
  }
  for (size_t i = 0; i < of->count; i++) {
    double at = sum[i] / SEEDS, variance = (squares[i] / SEEDS - at * at) / (SEEDS - 1);
    double score = (at - wanted[i]) / sqrt(variance);
    worst = fmax(worst, fabs(score));
    mean += score * score / (double)of->count;
  }
  print_message("worst of %zu cells %.1f standard errors off, mean square %.2f\n", of->count, worst, mean);
  assert_true(worst < 4);
  assert_true(mean > .5 && mean < 1.6);
  free(sum);
  free(squares);
}

static void paths_are_unbiased(void **state) {
  (void)state;
  problem even = problem_of(room_closed(8, 6, .35, 2)), cube = problem_of(room_cube(3, .42, .4, 5));
  assert_unbiased(&even, even.answer, 0);
  assert_unbiased(&cube, cube.answer, 0);
  problem_free(&even);
  problem_free(&cube);
}

/* Noise makes entries of R negative; paths take their sign along. */
static void negative_entries_keep_their_sign(void **state) {
  (void)state;
  test_room room = room_closed(7, 6, .35, 2);
  float *entries = clt_transport_entries(room.transport, 0);
  uint64_t random = 3;
  for (size_t i = 0; i < room.cells * room.cells; i++) {
    bool turned = i % (room.cells + 1) != 0 && test_random(&random) < .3;
    entries[i] = turned ? -entries[i] : entries[i];
  }
  room_certify(&room);
  problem noisy = problem_of(room);
  assert_unbiased(&noisy, noisy.answer, 0);
  problem_free(&noisy);
}

/* Drawing columns leaves the iterate's mean what it is without drawing. */
static void the_hybrid_is_unbiased_for_the_iterate(void **state) {
  (void)state;
  enum { STEPS = 3 };
  problem of = problem_of(room_closed(8, 6, .4, 7));
  double *iterate = room_numbers(of.count), *before = room_numbers(of.count);
  memcpy(iterate, of.b, of.count * sizeof *iterate);
  for (int k = 0; k < STEPS; k++) {
    memcpy(before, iterate, of.count * sizeof *before);
    for (size_t i = 0; i < of.count; i++) {
      iterate[i] = of.b[i];
      for (size_t j = 0; j < of.count; j++) {
        iterate[i] -= i == j ? 0 : of.matrix.entries[i * of.count + j] * before[j];
      }
    }
  }
  assert_unbiased(&of, iterate, STEPS);
  free(iterate);
  free(before);
  problem_free(&of);
}

/* Fig. 11: the slope of log variance over log samples. */
static void variance_falls_inversely_with_samples(void **state) {
  (void)state;
  problem of = problem_of(room_cube(4, .4, .2, 5));
  double x = 0, y = 0, xx = 0, xy = 0;
  enum { POINTS = 7 };
  for (int k = 0; k < POINTS; k++) {
    double samples = 4 << k, variance = mean_square(&of, 4 << k, 24);
    x += log(samples) / POINTS;
    y += log(variance) / POINTS;
    xx += log(samples) * log(samples) / POINTS;
    xy += log(samples) * log(variance) / POINTS;
  }
  double slope = (xy - x * y) / (xx - x * x);
  print_message("variance ~ samples^%.3f\n", slope);
  assert_near(slope, -1, .15);
  problem_free(&of);
}

/* Fig. 11, top: one true product after 30 samples a cell. */
static void a_final_gather_smooths(void **state) {
  (void)state;
  problem of = problem_of(room_cube(8, .4, .2, 5));
  double raw = 0, gathered = 0;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    clt_paths_estimate(&of.paths, of.b, 30, seed, of.out, NULL);
    raw += room_distance(of.out, of.answer, of.count) / 4;
    memcpy(of.last, of.b, of.count * sizeof *of.last);
    for (size_t i = 0; i < of.count; i++) {
      for (size_t j = 0; j < of.count; j++) {
        of.last[i] -= i == j ? 0 : of.matrix.entries[i * of.count + j] * of.out[j];
      }
    }
    gathered += room_distance(of.last, of.answer, of.count) / 4;
  }
  print_message("error with 30 samples %.3f, gathered %.4f: %.1f times less\n", raw, gathered, raw / gathered);
  assert_true(gathered < raw / 5);
  problem_free(&of);
}

static void the_number_of_threads_does_not_matter(void **state) {
  (void)state;
  problem of = problem_of(room_closed(9, 7, .4, 2));
  int before = omp_get_max_threads();
  double *one = room_numbers(of.count);
  for (int hybrid = 0; hybrid < 2; hybrid++) {
    for (int threads = 1; threads <= 4; threads++) {
      omp_set_num_threads(threads);
      if (hybrid) {
        clt_paths_hybrid(&of.paths, of.b, 20, 4, 9, of.last, of.out);
      } else {
        clt_paths_estimate(&of.paths, of.b, 20, 9, of.out, NULL);
      }
      if (threads == 1) {
        memcpy(one, of.out, of.count * sizeof *one);
      }
      assert_memory_equal(one, of.out, of.count * sizeof *one);
    }
  }
  omp_set_num_threads(before);
  free(one);
  problem_free(&of);
}

static void assert_refused(const test_room *room, const char *method, const char *phrase) {
  clt_error error = {0};
  clt_solver *solver = NULL;
  assert_int_equal(
      clt_solver_create(room->transport, room->certificate, &(clt_solve_options){.method = method}, &solver, &error),
      CLT_BAD_INPUT);
  if (strstr(error.message, phrase) == NULL) {
    fail_msg("\"%s\" does not say \"%s\"", error.message, phrase);
  }
}

/* Case 28 of NUMERICS section 8; and light of which rho(R) is .67 while the squares of its terms grow without end. */
static void what_has_no_variance_is_refused(void **state) {
  (void)state;
  const double albedos[] = {.51, .62, .9, .99};
  for (int k = 0; k < 4; k++) {
    test_room room = room_closed(9, 6, albedos[k], 3);
    assert_refused(&room, "montecarlo", "must be below 1");
    assert_refused(&room, "hybrid", "eq. 48 needs m < 1/2");
    room_free(&room);
  }
  const float entries[9] = {1, .45f, 3, 1, 1, 0, 0, 0, 1};
  test_room skewed = room_of(3, 3, entries);
  assert_true(clt_certificate_channel(skewed.certificate, 0)->radius_high < 1);
  assert_refused(&skewed, "montecarlo", "no finite variance");
  room_free(&skewed);
}

/* Passes on what is left reach any tolerance, in truth. */
static void passes_reach_the_tolerance(void **state) {
  (void)state;
  const char *names[] = {"montecarlo", "hybrid"};
  const double tolerances[] = {1e-2, 1e-4, 1e-9};
  for (uint64_t seed = 1; seed <= 3; seed++) {
    test_room room = seed % 2 ? room_cube(5, .45, .2, seed) : room_closed(10, 9, .3, seed);
    room_ask(&room, seed, -.5, 1.5);
    for (int k = 0; k < 6; k++) {
      clt_error error = {0};
      clt_solve_result result;
      clt_solve_options options = {.method = names[k % 2], .tolerance = tolerances[k / 2]};
      assert_ok(clt_solve(room.transport, room.certificate, room.b, &options, room.x, &result, &error), error);
      assert_string_equal(result.method, names[k % 2]);
      assert_true(result.converged && room_residual(&room, room.x, room.b) <= tolerances[k / 2]);
      print_message("%s to %.0e: %d passes\n", names[k % 2], tolerances[k / 2], result.iterations);
    }
    room_free(&room);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(paths_are_unbiased),
      cmocka_unit_test(negative_entries_keep_their_sign),
      cmocka_unit_test(the_hybrid_is_unbiased_for_the_iterate),
      cmocka_unit_test(variance_falls_inversely_with_samples),
      cmocka_unit_test(a_final_gather_smooths),
      cmocka_unit_test(the_number_of_threads_does_not_matter),
      cmocka_unit_test(what_has_no_variance_is_refused),
      cmocka_unit_test(passes_reach_the_tolerance),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
