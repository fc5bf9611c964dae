/* The pace of the main loop, in a time of its own: what waits take too long adds up nowhere. */
#include "daemon/pace.h"

#include "support.h"

enum { TURNS = 20000, MS = 1000000 };
static const double REFRESH_S = 1.0 / 60;

/* What a wait takes too long: little, and now and then several milliseconds. */
static int64_t overshoot_ns(uint64_t *random) {
  return llround(MS * (test_random(random) < 0.01 ? 5 * test_random(random) : 0.02 + 0.2 * test_random(random)));
}

/* Refreshes that a projector misses which waits for them, though painting takes at most 9 of 16.7 ms. Its refresh
 * differs from the nominal one. */
static int missed_by(double off, uint64_t seed) {
  const double period_ns = 1e9 * REFRESH_S * (1 + off);
  pace own = {0};
  uint64_t random = seed;
  int64_t now_ns = 0;
  double number = 0;
  int missed = 0;
  for (int k = 0; k < TURNS; k++) {
    pace_begin(&own, now_ns, REFRESH_S);
    now_ns += llround(MS * (4 + 5 * test_random(&random)));
    const double next = floor((double)now_ns / period_ns) + 1;
    missed += k > 0 && next - number > 1.5;
    number = next;
    now_ns = llround(next * period_ns);
    const double left_s = pace_left(&own, now_ns, REFRESH_S, true);
    now_ns += left_s > 0 ? llround(1e9 * left_s) + overshoot_ns(&random) : 0;
  }
  return missed;
}

static void a_projector_that_waits_misses_no_refresh(void **state) {
  (void)state;
  static const double offs[] = {0, 1e-3, -1e-3, 5e-3, -5e-3};
  for (size_t k = 0; k < sizeof offs / sizeof *offs; k++) {
    for (uint64_t seed = 1; seed <= 4; seed++) {
      assert_int_equal(missed_by(offs[k], seed), 0);
    }
  }
}

static void turns_come_a_refresh_apart_where_nothing_waits(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    pace own = {0};
    uint64_t random = seed;
    int64_t now_ns = 50 * MS;
    for (int k = 0; k < TURNS; k++) {
      pace_begin(&own, now_ns, REFRESH_S);
      assert_true(llabs(own.at_ns - now_ns) < 5 * MS);
      now_ns += llround(MS * 8 * test_random(&random));
      now_ns += llround(1e9 * pace_left(&own, now_ns, REFRESH_S, false)) + overshoot_ns(&random);
    }
    assert_near(1e-9 * (double)(now_ns - 50 * MS), TURNS * REFRESH_S, 0.006);
  }
}

/* A pattern ends the wait; what comes after it comes when it would have come. */
static void a_turn_between_two_shifts_none(void **state) {
  (void)state;
  pace own = {0};
  int64_t now_ns = 0;
  for (int k = 0; k < 10; k++) {
    pace_begin(&own, now_ns, REFRESH_S);
    now_ns += llround(1e9 * pace_left(&own, now_ns, REFRESH_S, false));
  }
  const int64_t before_ns = own.at_ns, planned_ns = now_ns;
  now_ns -= 10 * MS;
  pace_begin(&own, now_ns, REFRESH_S);
  assert_true(llabs(own.at_ns - before_ns) < 5 * MS); /* the refresh before */
  now_ns += llround(1e9 * pace_left(&own, now_ns + MS, REFRESH_S, false)) + MS;
  assert_near((double)now_ns, (double)planned_ns, 2);
}

/* A turn that took long is not caught up with. */
static void after_a_long_turn_the_next_begins_at_once(void **state) {
  (void)state;
  pace own = {0};
  pace_begin(&own, 100 * MS, REFRESH_S);
  assert_near(pace_left(&own, 150 * MS, REFRESH_S, false), 0, 0);
  pace_begin(&own, 150 * MS, REFRESH_S);
  assert_near(pace_left(&own, 151 * MS, REFRESH_S, false), REFRESH_S - 1e-3, 1e-8);
  pace_begin(&own, 400 * MS, REFRESH_S);
  assert_near(pace_left(&own, 401 * MS, REFRESH_S, true), REFRESH_S / 2 - 1e-3, 1e-8); /* it did not wait after all */
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_projector_that_waits_misses_no_refresh),
      cmocka_unit_test(turns_come_a_refresh_apart_where_nothing_waits),
      cmocka_unit_test(a_turn_between_two_shifts_none),
      cmocka_unit_test(after_a_long_turn_the_next_begins_at_once),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
