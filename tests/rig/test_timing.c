/* Latency by flashes, in simulated rooms of known latency. */
#include "rig/timing/flashes.h"
#include "rough_room.h"

typedef struct timing_case {
  double latency_ms, jitter_ms, fps, exposure_s;
} timing_case;

static clt_latency measure(unsigned seed, const timing_case *truth, const char *faults, clt_findings *findings) {
  char projector[300], camera[200];
  snprintf(projector, sizeof projector, "latency_ms = %g; jitter_ms = %g; " ROUGH_PANEL, truth->latency_ms,
           truth->jitter_ms);
  snprintf(camera, sizeof camera, "fps = %g; %s", truth->fps, faults);
  rough_room room;
  rough_open(&room, seed, (rough_settings){projector, camera, ROUGH_LIGHT});
  room.shots.latency_s = 0.123; /* is not to be used */
  clt_latency found;
  clt_error error = {0};
  clt_latency_options options = {.exposure_s = truth->exposure_s, .seed = seed};
  assert_ok(clt_latency_measure(&room.shots, &options, &found, findings, &error), error);
  rough_close(&room);
  return found;
}

static void latency_is_found_within_half_a_frame(void **state) {
  (void)state;
  static const timing_case cases[] = {{37, 0, 60, 1 / 60.},  {37, 0, 60, 1 / 240.}, {3, 0, 30, 1 / 60.},
                                      {120, 0, 25, 1 / 60.}, {37, 4, 60, 1 / 60.},  {80, 6, 30, 1 / 60.}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    for (unsigned seed = 1; seed <= 3; seed++) {
      clt_findings findings = {0};
      clt_latency found = measure(seed, &cases[n], "", &findings);
      double off = found.seconds - cases[n].latency_ms * 1e-3;
      double allowed = n == 0 || n == 1 ? 1e-4 : n == 4 ? 2e-3 : 0.5 / cases[n].fps;
      assert_near(off, 0, allowed);
      assert_true(found.latest_s >= cases[n].latency_ms * 1e-3 - 1e-4);
      assert_true(found.complete_s >= found.latest_s && found.lost == 0 && found.duplicates == 0 && found.wrong == 0);
      assert_int_equal(findings.count, 0);
      assert_near(found.frame_s, 1 / cases[n].fps, 1e-6);
      if (n == 4) { /* evenly spread over +- 4 ms: deviation 2.3 ms */
        assert_near(found.jitter_s, 4e-3 / sqrt(3), 5e-4);
      }
      printf("latency %g +- %g ms, %g fps, exposure %.1f ms: off by %+.2f ms, from %.1f to %.1f ms, "
             "jitter %.2f ms, %d changes\n",
             cases[n].latency_ms, cases[n].jitter_ms, cases[n].fps, cases[n].exposure_s * 1e3, off * 1e3,
             found.earliest_s * 1e3, found.latest_s * 1e3, found.jitter_s * 1e3, found.changes);
    }
  }
}

/* Frames that go wrong are counted, named, and hardly move the estimate. */
static void faults_are_counted(void **state) {
  (void)state;
  const timing_case truth = {37, 0, 60, 1 / 60.};
  long wrong = 0;
  for (unsigned seed = 1; seed <= 3; seed++) {
    clt_findings findings = {0};
    clt_latency found = measure(seed, &truth, "faults = { dropped = 0.05; stuck = 0.04; };", &findings);
    assert_near(found.seconds, 0.037, 2e-3);
    assert_true(found.lost > 2 && found.lost < 40 && found.duplicates > 2 && found.duplicates < 40);
    assert_true(found.wrong <= found.duplicates);
    assert_true(findings.count == 2 + (found.wrong > 0) && findings.item[1].serious);
    assert_non_null(strstr(findings.item[0].text, "lost"));
    assert_non_null(strstr(findings.item[1].text, "repeat the one before"));
    wrong += found.wrong;
    assert_true(found.wrong == 0 || strstr(findings.item[2].text, "do not show what was there") != NULL);
  }
  assert_true(wrong > 0);
}

/* A camera that looks elsewhere. */
static void darkness_is_an_error_with_numbers(void **state) {
  (void)state;
  rough_room room;
  rough_open(&room, 1, (rough_settings){"intensity = 1e-6;", "responsivity = 1.0;", ROUGH_LIGHT});
  clt_latency found;
  clt_error error = {0};
  clt_findings findings = {0};
  assert_int_equal(clt_latency_measure(&room.shots, &(clt_latency_options){0}, &found, &findings, &error), CLT_FAILED);
  assert_non_null(strstr(error.message, "does not see the flashes"));
  rough_close(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(latency_is_found_within_half_a_frame),
      cmocka_unit_test(faults_are_counted),
      cmocka_unit_test(darkness_is_an_error_with_numbers),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
