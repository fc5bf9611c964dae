/* Front, choice and sentence on made-up points, against brute force. */
#include "support.h"
#include "tradeoff/front.h"

enum { POINTS = 60, SEEDS = 300 };

static clt_tradeoff_point points[POINTS];

static clt_tradeoff draw(uint64_t seed, double noise) {
  for (size_t k = 0; k < POINTS; k++) {
    points[k] = (clt_tradeoff_point){.seconds = pow(10, -4 + 4 * test_random(&seed)), .noise_error = noise};
    /* a coarse scale, so that some are equal */
    points[k].error = points[k].solver_error = pow(10, -floor(12 * test_random(&seed)) / 2);
    snprintf(points[k].method, sizeof points[k].method, "m%zu", k);
  }
  return (clt_tradeoff){.count = POINTS, .points = points};
}

static bool beats(const clt_tradeoff_point *a, const clt_tradeoff_point *b) {
  return a->seconds <= b->seconds && a->error <= b->error && (a->seconds < b->seconds || a->error < b->error);
}

static void the_front_is_what_no_point_beats(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= SEEDS; seed++) {
    clt_error error = {0};
    clt_tradeoff made = draw(seed, -1);
    size_t order[POINTS], on_front = 0;
    assert_ok(clt_front_mark(&made, &error), error);
    for (size_t k = 0; k < POINTS; k++) {
      bool beaten = false;
      for (size_t i = 0; i < POINTS; i++) {
        beaten = beaten || beats(&points[i], &points[k]);
      }
      assert_int_equal(points[k].front, !beaten);
      on_front += points[k].front;
    }
    assert_int_equal(clt_front_list(&made, order), on_front);
    for (size_t k = 1; k < on_front; k++) {
      assert_true(points[order[k]].seconds > points[order[k - 1]].seconds);
      assert_true(points[order[k]].error < points[order[k - 1]].error);
    }
  }
}

/* The wanted point by going over all of them. */
static size_t brute_force(const clt_tradeoff_options *options) {
  size_t best = POINTS;
  for (size_t k = 0; k < POINTS; k++) {
    bool fits =
        options->tolerance > 0 ? points[k].error <= options->tolerance : points[k].seconds <= options->deadline_s;
    double mine = options->tolerance > 0 ? points[k].seconds : points[k].error;
    double other = best == POINTS ? INFINITY : options->tolerance > 0 ? points[best].seconds : points[best].error;
    best = fits && mine < other ? k : best;
  }
  return best;
}

static void the_choice_is_as_asked(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= SEEDS; seed++) {
    clt_error error = {0};
    clt_tradeoff made = draw(seed, -1);
    clt_tradeoff_options by_error = {.tolerance = pow(10, -(double)(seed % 5) - .3)};
    clt_tradeoff_options by_time = {.deadline_s = pow(10, -(double)(seed % 4) - .5)};
    assert_ok(clt_front_mark(&made, &error), error);
    assert_ok(clt_front_tell(&made, &by_error, &error), error);
    size_t wanted = brute_force(&by_error);
    assert_true(wanted == POINTS || points[made.chosen].seconds == points[wanted].seconds);
    assert_ok(clt_front_tell(&made, &by_time, &error), error);
    wanted = brute_force(&by_time);
    assert_true(wanted == POINTS || points[made.chosen].error == points[wanted].error);
    assert_true(points[made.chosen].front);
  }
}

static void the_sentence_names_what_limits(void **state) {
  (void)state;
  clt_error error = {0};
  clt_tradeoff_options options = {0};
  clt_tradeoff made = draw(5, 0.003);
  points[0] = (clt_tradeoff_point){.seconds = 5.4e-3, .error = 9e-4, .solver_error = 9e-4, .noise_error = 3e-4};
  points[1] = (clt_tradeoff_point){.seconds = 2.1e-3, .error = 9e-3, .solver_error = 9e-3, .noise_error = 3e-4};
  points[2] = (clt_tradeoff_point){.seconds = 1.25, .error = 1e-4, .solver_error = 1e-4, .noise_error = 3e-4};
  made.count = 3;
  assert_ok(clt_front_mark(&made, &error), error);
  assert_ok(clt_front_tell(&made, &options, &error), error);
  assert_string_equal(made.sentence,
                      "1 % costs 2.1 ms; 0.1 % costs 5.4 ms; below 0.03 % the camera's noise is the limit");
  for (int k = 0; k < 3; k++) {
    points[k].noise_error = -1;
  }
  points[2].storage_error = 2e-4;
  assert_ok(clt_front_tell(&made, &options, &error), error);
  assert_string_equal(made.sentence, "1 % costs 2.1 ms; 0.1 % costs 5.4 ms; 0.01 % costs 1.25 s; below 0.01 % the "
                                     "precision in which T is stored is the limit");
  points[2].clipping_error = 2e-4;
  assert_ok(clt_front_tell(&made, &options, &error), error);
  assert_non_null(strstr(made.sentence, "below 0.01 % no drive between 0 and 1 comes"));
  made.count = 1;
  assert_ok(clt_front_mark(&made, &error), error);
  assert_ok(clt_front_tell(&made, &options, &error), error);
  assert_non_null(strstr(made.sentence, "0.1 % costs 5.4 ms"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_front_is_what_no_point_beats),
      cmocka_unit_test(the_choice_is_as_asked),
      cmocka_unit_test(the_sentence_names_what_limits),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
