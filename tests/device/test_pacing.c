/* Pacing against displays that are simulated here, whose refreshes are known: the time that is told is never before the
 * truth, and pictures that are on time are told to be. */
#include "device/projector/pacing.h"

#include "support.h"

/* A screen whose swaps return at refreshes, late by a random time that is now and then long. */
typedef struct screen {
  double period_ns, phase_ns;
  double jitter_ns, hiccup_ns;
  int lag; /* refreshes from a return until the picture is up */
  uint64_t random;
  double now_ns, last_refresh;
} screen;

static double refresh_at(const screen *s, double number) {
  return s->phase_ns + number * s->period_ns;
}

/* A picture that takes drawing_ns: began and returned of its swap; returns when it is up. */
static double swap(screen *s, double drawing_ns, int64_t *began_ns, int64_t *returned_ns) {
  s->now_ns += drawing_ns;
  *began_ns = (int64_t)s->now_ns;
  double number = ceil((s->now_ns - s->phase_ns) / s->period_ns);
  number = number > s->last_refresh ? number : s->last_refresh + 1;
  s->last_refresh = number;
  double late_ns = s->jitter_ns * test_random(&s->random);
  late_ns += test_random(&s->random) < 0.01 ? s->hiccup_ns * test_random(&s->random) : 0;
  s->now_ns = refresh_at(s, number) + late_ns;
  *returned_ns = (int64_t)s->now_ns;
  return refresh_at(s, number + s->lag - 1);
}

static void open_screen(screen *s, uint64_t seed, double hz, int lag) {
  *s = (screen){.period_ns = 1e9 / hz, .random = seed, .jitter_ns = 5e5, .lag = lag};
  s->phase_ns = 1e12 + s->period_ns * test_random(&s->random);
  s->now_ns = s->phase_ns + 3e6;
}

static const double rates_hz[] = {59.94, 60, 50, 23.976, 120, 144};
enum { RATES = sizeof rates_hz / sizeof rates_hz[0], FRAMES = 4000 };

/* Full rate, seeds, rates that GLFW rounds to whole hertz: never early, steady once the phase is found, and the period
 * within 1e-4. */
static void test_full_rate(void **state) {
  (void)state;
  for (int k = 0; k < 6 * RATES; k++) {
    screen s;
    clt_pacing pacing;
    int64_t began, returned, before = 0;
    int uneven = 0;
    open_screen(&s, (uint64_t)k + 1, rates_hz[k % RATES], 1 + k % 2);
    clt_pacing_start(&pacing, floor(rates_hz[k % RATES] + 0.01), true, s.lag, (int64_t)s.now_ns);
    for (int frame = 0; frame < FRAMES; frame++) {
      double truth = swap(&s, 0.2 * s.period_ns, &began, &returned);
      int64_t shown = clt_pacing_swapped(&pacing, began, returned);
      assert_true((double)shown >= truth - 1e3);
      assert_true((double)shown <= truth + 3.3 * s.period_ns);
      assert_true(clt_pacing_release(&pacing) <= returned + (int64_t)(0.1 * s.period_ns));
      uneven += frame > 400 && fabs((double)(shown - before) / s.period_ns - 1) > 0.25;
      before = shown;
    }
    assert_int_equal(uneven, 0);
    assert_near(pacing.period_ns / s.period_ns, 1, 1e-4);
  }
}

/* Pictures now and then, hiccups of two refreshes: still never early, and never more than two refreshes behind what the
 * lag allows. */
static void test_irregular(void **state) {
  (void)state;
  for (int k = 0; k < 6 * RATES; k++) {
    screen s;
    clt_pacing pacing;
    int64_t began, returned;
    open_screen(&s, (uint64_t)k + 100, rates_hz[k % RATES], 1 + k % 2);
    s.hiccup_ns = 2 * s.period_ns;
    clt_pacing_start(&pacing, floor(rates_hz[k % RATES] + 0.01), true, s.lag, (int64_t)s.now_ns);
    for (int frame = 0; frame < FRAMES; frame++) {
      double pause = (test_random(&s.random) < 0.02 ? 300 : 5) * test_random(&s.random) * s.period_ns;
      double truth = swap(&s, pause, &began, &returned);
      int64_t shown = clt_pacing_swapped(&pacing, began, returned);
      assert_true((double)shown >= truth - 1e3);
      assert_true((double)shown <= (double)returned + (s.lag + 2) * s.period_ns);
    }
  }
}

/* Without a screen that waits, the clock's refreshes: whole periods apart, after the return, never two at once; and the
 * caller is held back until then. */
static void test_clock(void **state) {
  (void)state;
  uint64_t random = 7;
  clt_pacing pacing;
  int64_t now = 5000000000, first = now, before = 0;
  clt_pacing_start(&pacing, 60, false, 2, now);
  for (int frame = 0; frame < FRAMES; frame++) {
    int64_t returned = now + (int64_t)(4e7 * test_random(&random) * test_random(&random));
    int64_t shown = clt_pacing_swapped(&pacing, now, returned);
    double refreshes = (double)(shown - first) * 60e-9;
    assert_near(refreshes, round(refreshes), 1e-6);
    assert_true(shown > returned && shown - returned <= 16666668);
    assert_true(shown - before > 16000000);
    assert_int_equal(clt_pacing_release(&pacing), shown);
    now = before = shown;
  }
}

/* The display's own stamps are passed on, and give the period. */
static void test_stamps(void **state) {
  (void)state;
  clt_pacing pacing;
  int64_t number = 1000000;
  uint64_t random = 9;
  clt_pacing_start(&pacing, 60, true, 1, 0);
  for (int frame = 0; frame < FRAMES; frame++) {
    number += 1 + (test_random(&random) < 0.1);
    int64_t started = (int64_t)((double)number * 1e9 / 59.94);
    assert_int_equal(clt_pacing_stamped(&pacing, started, number), started);
  }
  assert_near(pacing.period_ns, 1e9 / 59.94, 10);
}

static void test_waits(void **state) {
  (void)state;
  double waiting[] = {1e5, 16.6e6, 16.7e6, 33e6, 16.5e6}, free_running[] = {4e6, 2e6, 30e6, 5e6, 3e6};
  assert_true(clt_pacing_waits(waiting, 5, 60));
  assert_false(clt_pacing_waits(free_running, 5, 60));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_full_rate), cmocka_unit_test(test_irregular),
                                     cmocka_unit_test(test_clock), cmocka_unit_test(test_stamps),
                                     cmocka_unit_test(test_waits)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
