#include "daemon/trend.h"

#include "support.h"

/* A straight line is found exactly, however many were forgotten before. */
static void a_line_gives_its_slope(void **state) {
  (void)state;
  for (int many = TREND_LEAST; many <= 3 * TREND_MOST; many++) {
    trend kept = {0};
    trend_slopes slopes;
    for (int i = 0; i < many; i++) {
      double t = 1e6 + 60.0 * i;
      trend_add(&kept, t, 0.02 + 0.05 * t / 3600, 1 - 0.01 * t / 3600);
    }
    assert_int_equal(kept.count, many < TREND_MOST ? many : TREND_MOST);
    assert_near(kept.time_s[kept.count - 1], 1e6 + 60.0 * (many - 1), 0);
    assert_true(trend_measure(&kept, &slopes));
    assert_near(slopes.error, 0.05, 1e-8);
    assert_near(slopes.brightness, -0.01, 1e-8);
    assert_near(slopes.error_deviation, 0, 1e-7);
  }
}

/* Over many draws the slopes scatter as their deviations say. */
static void the_deviation_is_that_of_the_slope(void **state) {
  (void)state;
  uint64_t random = 11;
  double squares = 0;
  enum { DRAWS = 2000 };
  for (int n = 0; n < DRAWS; n++) {
    trend kept = {0};
    trend_slopes slopes;
    for (int i = 0; i < TREND_MOST; i++) {
      trend_add(&kept, 600.0 * i, 0.1 * test_random(&random), 0.5 * 600.0 * i / 3600 + 0.1 * test_random(&random));
    }
    assert_true(trend_measure(&kept, &slopes));
    double off = (slopes.brightness - 0.5) / slopes.brightness_deviation;
    squares += off * off;
  }
  /* Student's t of n - 2 degrees of freedom has the variance (n - 2) / (n - 4) */
  assert_near(squares / DRAWS, (TREND_MOST - 2.0) / (TREND_MOST - 4), 0.12);
}

static void too_little_gives_none(void **state) {
  (void)state;
  trend kept = {0};
  trend_slopes slopes;
  for (int i = 0; i < TREND_LEAST; i++) {
    assert_false(trend_measure(&kept, &slopes));
    trend_add(&kept, 5, 0.1, 1);
  }
  assert_false(trend_measure(&kept, &slopes)); /* all at one time */
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_line_gives_its_slope),
                                     cmocka_unit_test(the_deviation_is_that_of_the_slope),
                                     cmocka_unit_test(too_little_gives_none)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
