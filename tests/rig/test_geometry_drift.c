/* The check of pattern + inverse: silent on a steady camera, with numbers on one that moves. */
#include "rig/geometry/drift.h"
#include "structured.h"

static clt_findings judge(const seen_scene *s, clt_drift *drift) {
  clt_pairs pairs;
  clt_findings findings = {0};
  clt_error error = {0};
  seen_take(s, &pairs);
  assert_ok(clt_drift_measure(&pairs, drift, &error), error);
  clt_drift_judge(drift, &findings);
  clt_pairs_finish(&pairs);
  return findings;
}

static void a_steady_camera_gives_no_finding(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    clt_drift drift;
    seen_scene s = seen_wall(seed);
    s.channels = seed % 2 == 0 ? 3 : 1;
    s.blur = 0.4 * (double)seed;
    s.srgb = seed == 4;
    s.bits = s.srgb ? 8 : 12;
    s.light = seed == 3 ? 0.15 : 0.5;
    s.step = 12;
    clt_findings findings = judge(&s, &drift);
    for (int c = 0; c < s.channels; c++) {
      assert_true(clt_drift_span(&drift, c, false) < 0.01);
    }
    if (findings.count > 0) {
      fail_msg("seed %d: %s", (int)seed, findings.item[0].text);
    }
  }
}

/* The exposure grows evenly: pairs k of n stand (2 k + 1/2) / (2 n - 1) of the way on. */
static void an_exposure_that_grows_is_told_with_its_growth(void **state) {
  (void)state;
  static const double growths[] = {0.03, 0.08, -0.2};
  for (size_t n = 0; n < 3; n++) {
    clt_drift drift;
    seen_scene s = seen_wall(10 + n);
    s.drift = growths[n];
    clt_findings findings = judge(&s, &drift);
    int known = 0;
    for (int k = 0; k < drift.pairs; k++) {
      double wanted = (1 + s.drift * (2 * k + 0.5) / (2 * drift.pairs - 1)) / (1 + s.drift / 2);
      assert_near(drift.all[k][0], wanted, 0.005);
      if (isfinite(drift.wide[k][0])) {
        assert_near(drift.wide[k][0], wanted, 0.005);
        known++;
      }
    }
    assert_true(known > 10);
    assert_int_equal(findings.count, 1);
    assert_true(findings.item[0].serious);
    char growth[16];
    snprintf(growth, sizeof growth, "%.1f %%", 100 * clt_drift_span(&drift, 0, true));
    assert_non_null(strstr(findings.item[0].text, growth));
    assert_non_null(strstr(findings.item[0].text, "lock"));
  }
}

/* Samples are taken as linear and are not: half light comes out as .73 of white, where stripes blur. */
static void a_wrong_response_is_told_by_fine_stripes(void **state) {
  (void)state;
  clt_drift drift;
  clt_error error = {0};
  seen_scene s = seen_wall(20);
  s.srgb = true;
  s.bits = 8;
  s.blur = 1.5;
  s.indirect = 0;
  clt_gray gray;
  clt_pairs pairs;
  clt_findings findings = {0};
  assert_ok(clt_gray_init(&gray, PANEL_WIDTH, PANEL_HEIGHT, &error), error);
  clt_camera_info sensor = seen_sensor(&s);
  assert_ok(clt_pairs_init(&pairs, &gray, &sensor, &(clt_curve){.kind = CLT_CURVE_LINEAR}, &error), error);
  uint16_t *samples = malloc(sizeof *samples * SEEN_PIXELS);
  for (int k = 0; k < clt_gray_pictures(&gray); k++) {
    clt_frame frame = seen_frame(&s, &gray, k, samples);
    clt_pairs_add(&pairs, k, &frame);
  }
  free(samples);
  assert_ok(clt_drift_measure(&pairs, &drift, &error), error);
  clt_drift_judge(&drift, &findings);
  assert_true(clt_drift_span(&drift, 0, false) > 0.3);
  bool told = false;
  for (int k = 0; k < findings.count; k++) {
    told |= strstr(findings.item[k].text, "not linear") != NULL;
  }
  assert_true(told);
  clt_pairs_finish(&pairs);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_steady_camera_gives_no_finding),
      cmocka_unit_test(an_exposure_that_grows_is_told_with_its_growth),
      cmocka_unit_test(a_wrong_response_is_told_by_fine_stripes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
