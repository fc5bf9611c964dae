/* What every acquisition does: options, black, flood, brute force, checks, provenance, progress, cancelling. */
#include "counterlight/acquire.h"
#include "fake_rig.h"

enum { WIDTH = 6, HEIGHT = 5, CELLS = WIDTH * HEIGHT, CHANNELS = 3 };

/* A diagonally dominant random matrix per channel. */
static const double *random_transport(void) {
  static double transport[CHANNELS * CELLS * CELLS];
  uint64_t random = 3;
  for (int at = 0; at < CHANNELS * CELLS * CELLS; at++) {
    transport[at] = at / CELLS % CELLS == at % CELLS ? 0.5 + test_random(&random) : 0.02 * test_random(&random);
  }
  return transport;
}

static fake_rig small_rig(void) {
  return fake_rig_make(WIDTH, HEIGHT, CHANNELS, random_transport(), CHANNELS);
}

static clt_transport *acquire(fake_rig *rig, const clt_acquire_options *options) {
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_ok(clt_acquire(&rig->base, options, &transport, &error), error);
  return transport;
}

/* Row sums in double against the flood that the transport keeps. */
static void check_flood_consistency(const clt_transport *transport) {
  clt_transport_info info = clt_transport_describe(transport);
  double *sums = calloc(info.rows, sizeof *sums);
  for (int c = 0; c < info.channels; c++) {
    clt_transport_row_sums(transport, c, sums);
    for (size_t i = 0; i < info.rows; i++) {
      double flood = clt_transport_flood(transport, c)[i];
      assert_near(sums[i], flood, 2e-6 * flood);
    }
  }
  free(sums);
}

static void brute_force_on_a_clean_rig_is_exact(void **state) {
  (void)state;
  fake_rig rig = small_rig();
  clt_transport *transport = acquire(&rig, &(clt_acquire_options){.scheme = "brute", .repeats = 2, .checks = 3});
  for (int c = 0; c < CHANNELS; c++) {
    const float *entries = clt_transport_entries(transport, c);
    assert_non_null(entries);
    for (size_t at = 0; at < CELLS * CELLS; at++) {
      assert_near(entries[at], rig.transport[(size_t)c * CELLS * CELLS + at], 1e-6);
    }
    assert_near(clt_transport_black(transport, c)[7], 0.01, 1e-8);
  }
  check_flood_consistency(transport);
  const clt_provenance *origin = clt_transport_origin(transport);
  assert_string_equal(origin->scheme, "brute");
  assert_string_equal(origin->source, "a matrix");
  assert_string_equal(origin->response, "gamma 2.2");
  assert_int_equal(origin->patterns, 2 + 2 + CELLS + 3);
  assert_int_equal(origin->frames, 3 * origin->patterns);
  assert_true(origin->acquired > 1700000000);
  assert_near(origin->error, 0, 1e-6);
  clt_transport_destroy(transport);
}

/* An error of the black is in every entry; the flood takes it out of the row sums. Noise of an entry stays, as large as
 * sigma says. */
static void noise_is_reported_and_the_flood_corrects_the_black(void **state) {
  (void)state;
  double square = 0, sigma_square = 0;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    fake_rig rig = small_rig();
    rig.random = seed;
    rig.dark = 1e-4;
    clt_transport *transport = acquire(&rig, &(clt_acquire_options){.scheme = "brute", .repeats = 64});
    check_flood_consistency(transport);
    for (int c = 0; c < CHANNELS; c++) {
      const float *entries = clt_transport_entries(transport, c);
      for (size_t at = 0; at < CELLS * CELLS; at++) {
        double wrong = entries[at] - rig.transport[(size_t)c * CELLS * CELLS + at];
        square += wrong * wrong;
        sigma_square += pow(clt_transport_sigma(transport, c)[at / CELLS], 2);
      }
    }
    clt_transport_destroy(transport);
  }
  /* 8100 entries: the ratio's own error is 0.8 %; the correction takes away one of 30 degrees of freedom */
  assert_near(sqrt(square / sigma_square), 1, 0.05);
}

/* checks compare with fresh observations: a rig that changes behind the acquisition's back shows in the error. */
static void the_error_of_check_patterns_is_the_real_one(void **state) {
  (void)state;
  fake_rig rig = small_rig();
  rig.dark = 0.02;
  clt_transport *transport =
      acquire(&rig, &(clt_acquire_options){.scheme = "brute", .repeats = 1, .checks = 64, .seed = 9});
  /* recompute with patterns of this test: T~ x + b0~ against the light without its noise, x of zeros and ones */
  uint64_t random = 77;
  double wrong = 0, seen = 0;
  for (int n = 0; n < 64; n++) {
    for (int c = 0; c < CHANNELS; c++) {
      double x[CELLS], y[CELLS];
      for (int j = 0; j < CELLS; j++) {
        x[j] = test_random(&random) < 0.5;
      }
      clt_transport_apply(transport, c, x, y);
      for (int i = 0; i < CELLS; i++) {
        double light = rig.black;
        for (int j = 0; j < CELLS; j++) {
          light += rig.transport[(c * CELLS + i) * CELLS + j] * x[j];
        }
        wrong += pow(y[i] + clt_transport_black(transport, c)[i] - light, 2);
        seen += light * light;
      }
    }
  }
  double error = clt_transport_origin(transport)->error;
  assert_near(error / sqrt(wrong / seen), 1, 0.1);
  clt_transport_destroy(transport);
  rig.dark = 0;
  transport = acquire(&rig, &(clt_acquire_options){.scheme = "brute"});
  assert_true(clt_transport_origin(transport)->error < 0);
  clt_transport_destroy(transport);
}

static void a_cell_that_is_never_seen_stays_finite(void **state) {
  (void)state;
  static const char *const schemes[] = {"brute", "hierarchical"};
  for (int n = 0; n < 2; n++) {
    fake_rig rig = small_rig();
    rig.blind = 4;
    clt_transport *transport =
        acquire(&rig, &(clt_acquire_options){.scheme = schemes[n], .threshold = 1e-6, .checks = 4});
    double x[CELLS] = {1}, y[CELLS];
    clt_transport_apply(transport, 0, x, y);
    for (int i = 0; i < CELLS; i++) {
      assert_true(isfinite(y[i]));
    }
    assert_true(clt_transport_origin(transport)->error < 1e-3);
    assert_true(isinf(clt_transport_sigma(transport, 1)[4]));
    assert_true(isfinite(clt_transport_sigma(transport, 1)[5]));
    clt_transport_destroy(transport);
  }
}

typedef struct watcher {
  long calls, last, stop_at;
  double seconds, left;
  int phases;
  char phase[64];
} watcher;

static bool watch(void *context, const clt_progress *progress) {
  watcher *seen = context;
  seen->calls++;
  assert_int_equal(progress->done, seen->last + 1);
  assert_true(progress->total >= progress->done);
  assert_true(progress->seconds >= seen->seconds);
  seen->last = progress->done;
  seen->seconds = progress->seconds;
  seen->left = progress->left;
  if (strcmp(seen->phase, progress->phase) != 0) {
    snprintf(seen->phase, sizeof seen->phase, "%s", progress->phase);
    seen->phases++;
  }
  return progress->done != seen->stop_at;
}

static void progress_counts_every_pattern(void **state) {
  (void)state;
  static const char *const schemes[] = {"brute", "hierarchical"};
  static const int phases[] = {4, 6};
  for (int n = 0; n < 2; n++) {
    fake_rig rig = small_rig();
    watcher seen = {0};
    clt_transport *transport =
        acquire(&rig, &(clt_acquire_options){.scheme = schemes[n], .checks = 2, .progress = watch, .context = &seen});
    assert_int_equal(seen.calls, rig.patterns);
    assert_int_equal(seen.calls, clt_transport_origin(transport)->patterns);
    assert_near(seen.left, 0, 1e-9);
    assert_string_equal(seen.phase, "check");
    assert_true(seen.phases >= phases[n]);
    clt_transport_destroy(transport);
  }
}

static void cancelling_stops_at_the_next_pattern(void **state) {
  (void)state;
  static const char *const schemes[] = {"brute", "hierarchical"};
  static const long stops[] = {1, 3, 12, 23};
  for (int n = 0; n < 8; n++) {
    fake_rig rig = small_rig();
    watcher seen = {.stop_at = stops[n / 2]};
    clt_acquire_options options = {
        .scheme = schemes[n % 2], .repeats = 2, .checks = 2, .progress = watch, .context = &seen};
    clt_transport *transport = NULL;
    clt_error error = {0};
    assert_int_equal(clt_acquire(&rig.base, &options, &transport, &error), CLT_CANCELLED);
    assert_null(transport);
    assert_int_equal(rig.patterns, stops[n / 2]);
  }
}

static void a_failing_rig_is_passed_on(void **state) {
  (void)state;
  static const clt_status statuses[] = {CLT_GONE, CLT_TIMEOUT, CLT_FAILED};
  static const long when[] = {1, 3, 9, 25};
  for (int n = 0; n < 12; n++) {
    fake_rig rig = small_rig();
    rig.fails_with = statuses[n % 3];
    rig.fails_at = when[n / 3];
    clt_transport *transport = NULL;
    clt_error error = {0};
    clt_acquire_options options = {.scheme = n % 2 ? "brute" : "hierarchical", .repeats = 2};
    assert_int_equal(clt_acquire(&rig.base, &options, &transport, &error), statuses[n % 3]);
    assert_null(transport);
    assert_non_null(strstr(error.message, "acquiring ("));
    assert_non_null(strstr(error.message, "the fake is told to fail"));
  }
}

static void bad_options_are_refused_before_any_pattern(void **state) {
  (void)state;
  static const struct {
    clt_acquire_options options;
    const char *wanted;
  } cases[] = {
      {{.scheme = "magic"},
       "\"magic\" is no acquisition scheme; there are auto, brute, hadamard, hierarchical, blocks"},
      {{.threshold = 0.6}, "threshold is 0.6; legal is 0 to 0.5"},
      {{.threshold = NAN}, "threshold is nan"},
      {{.repeats = 257}, "repeats is 257; legal is 0 (the default) to 256"},
      {{.repeats = -1}, "repeats is -1"},
      {{.checks = 65}, "checks is 65; legal is 0 to 64"},
      {{.error = 0.6}, "the wanted error is 0.6"},
      {{.seconds = -1}, "the seconds allowed are -1"},
  };
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    fake_rig rig = small_rig();
    clt_transport *transport = NULL;
    clt_error error = {0};
    assert_int_equal(clt_acquire(&rig.base, &cases[n].options, &transport, &error), CLT_BAD_INPUT);
    assert_int_equal(rig.patterns, 0);
    if (strstr(error.message, cases[n].wanted) == NULL) {
      fail_msg("\"%s\" does not say \"%s\"", error.message, cases[n].wanted);
    }
  }
}

/* Scheme and plan by grid, wanted error and seconds; patterns that cost nothing fit into any time. */
static void auto_weighs_patterns_against_error(void **state) {
  (void)state;
  static double identity[400 * 400];
  for (int i = 0; i < 400; i++) {
    identity[i * 401] = 1;
  }
  static const struct {
    int side;
    double error, seconds;
    const char *scheme;
  } cases[] = {{5, 0, 0, "brute"},       {20, 0, 0, "hierarchical"}, {20, 0.02, 0, "blocks"},
               {20, 0.0034, 0, "brute"}, {20, 0.02, 1e6, "blocks"},  {5, 0.003, 1e6, "brute"}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    fake_rig rig = fake_rig_make(cases[n].side, cases[n].side, 1, identity, 1);
    if (cases[n].side == 5) {
      rig = small_rig();
    }
    clt_acquire_options options = {.scheme = "auto", .error = cases[n].error, .seconds = cases[n].seconds};
    clt_transport *transport = acquire(&rig, &options);
    const clt_provenance *origin = clt_transport_origin(transport);
    assert_string_equal(origin->scheme, cases[n].scheme);
    assert_non_null(strstr(origin->plan, cases[n].scheme));
    assert_non_null(strstr(origin->plan, "patterns"));
    clt_transport_destroy(transport);
  }
}

/* On a rig that takes 10 ms a pattern, a time too short for one pattern a cell chooses and ends the scheme. */
static void auto_keeps_to_the_seconds_allowed(void **state) {
  (void)state;
  static double identity[400 * 400];
  for (int i = 0; i < 400; i++) {
    identity[i * 401] = 1;
  }
  fake_rig rig = fake_rig_make(20, 20, 1, identity, 1);
  rig.pause_us = 10000;
  clt_transport *transport = acquire(&rig, &(clt_acquire_options){.error = 0.001, .seconds = 1});
  const clt_provenance *origin = clt_transport_origin(transport);
  assert_string_equal(origin->scheme, "blocks");
  assert_non_null(strstr(origin->plan, "of 1 s"));
  assert_true(origin->patterns < 100);
  clt_transport_destroy(transport);
}

static void a_dark_room_is_an_error(void **state) {
  (void)state;
  static double nothing[100 * 100];
  fake_rig rig = fake_rig_make(10, 10, 1, nothing, 1);
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_int_equal(clt_acquire(&rig.base, &(clt_acquire_options){.scheme = "hierarchical"}, &transport, &error),
                   CLT_FAILED);
  assert_non_null(strstr(error.message, "no light of a fully driven grid"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(brute_force_on_a_clean_rig_is_exact),
      cmocka_unit_test(noise_is_reported_and_the_flood_corrects_the_black),
      cmocka_unit_test(the_error_of_check_patterns_is_the_real_one),
      cmocka_unit_test(a_cell_that_is_never_seen_stays_finite),
      cmocka_unit_test(progress_counts_every_pattern),
      cmocka_unit_test(cancelling_stops_at_the_next_pattern),
      cmocka_unit_test(a_failing_rig_is_passed_on),
      cmocka_unit_test(bad_options_are_refused_before_any_pattern),
      cmocka_unit_test(auto_weighs_patterns_against_error),
      cmocka_unit_test(auto_keeps_to_the_seconds_allowed),
      cmocka_unit_test(a_dark_room_is_an_error),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
