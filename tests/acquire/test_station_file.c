#include "counterlight/station.h"
#include "support.h"

static char folder[64], path[128];

static clt_status read_text(const char *text, clt_station_config *config, clt_error *error) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  *error = (clt_error){0};
  return clt_station_read(path, config, error);
}

static int make_folder(void **state) {
  (void)state;
  test_folder(folder);
  snprintf(path, sizeof path, "%s/station.cfg", folder);
  return 0;
}

static int remove_folder(void **state) {
  (void)state;
  unlink(path);
  return rmdir(folder);
}

static void everything_is_read(void **state) {
  (void)state;
  clt_station_config config;
  clt_error error;
  const char *text = "scene = \"scenes/room.cfg\";\n"
                     "projector = { driver = \"simulated\"; response = \"gamma 2.4\"; };\n"
                     "camera = { driver = \"other\"; response = \"linear\"; };\n"
                     "rig = { width = 64; height = 48; exposures_ms = (4, 16.5, 66); latency_ms = 0;\n"
                     "        timeout_ms = 250; attempts = 5; verify = false;\n"
                     "        calibration = \"calibration/c.h5\"; patch = { left = 1; top = 2; side = 3; }; };\n"
                     "replay = \"/frames\";\n"
                     "acquire = { scheme = \"brute\"; threshold = 0.01; repeats = 3; checks = 0; seed = 12; };\n"
                     "daemon = { anything = { goes = \"here\"; }; };\n";
  assert_ok(read_text(text, &config, &error), error);
  char scene[160];
  snprintf(scene, sizeof scene, "%s/scenes/room.cfg", folder);
  assert_string_equal(config.scene, scene);
  snprintf(scene, sizeof scene, "%s/calibration/c.h5", folder);
  assert_string_equal(config.calibration, scene);
  assert_string_equal(config.replay, "/frames");
  assert_true(config.verify_given && !config.rig.verify);
  assert_int_equal(config.rig.patch.left, 1);
  assert_int_equal(config.rig.patch.top, 2);
  assert_int_equal(config.rig.patch.side, 3);
  assert_string_equal(config.projector.driver, "simulated");
  assert_string_equal(config.camera.driver, "other");
  assert_true(config.projector_response_given && config.camera_response_given);
  assert_int_equal(config.rig.projector.response[0].kind, CLT_CURVE_GAMMA);
  assert_near(config.rig.projector.response[0].gamma, 2.4, 1e-12);
  assert_int_equal(config.rig.camera.kind, CLT_CURVE_LINEAR);
  assert_int_equal(config.rig.width, 64);
  assert_int_equal(config.rig.height, 48);
  assert_int_equal(config.rig.exposure_count, 3);
  assert_near(config.rig.exposures_s[1], 0.0165, 1e-12);
  assert_near(config.rig.latency_s, 0, 0);
  assert_near(config.rig.timeout_s, 0.25, 1e-12);
  assert_int_equal(config.rig.attempts, 5);
  assert_string_equal(config.scheme, "brute");
  assert_near(config.acquire.threshold, 0.01, 1e-12);
  assert_int_equal(config.acquire.repeats, 3);
  assert_int_equal(config.acquire.checks, 0);
  assert_int_equal(config.acquire.seed, 12);
}

static void what_is_absent_is_left_to_the_scene(void **state) {
  (void)state;
  clt_station_config config;
  clt_error error;
  assert_ok(read_text("scene = \"/abs/room.cfg\";", &config, &error), error);
  assert_string_equal(config.scene, "/abs/room.cfg");
  assert_string_equal(config.projector.driver, "simulated");
  assert_false(config.projector_response_given || config.camera_response_given);
  assert_true(config.rig.latency_s < 0 && !config.verify_given);
  assert_int_equal(strlen(config.calibration) + strlen(config.replay) + strlen(config.record), 0);
  assert_int_equal(config.rig.width + config.rig.exposure_count + config.rig.attempts, 0);
  assert_string_equal(config.scheme, "auto");
  clt_station_config plain;
  assert_ok(clt_station_for_scene("/abs/room.cfg", &plain, &error), error);
  assert_true(clt_station_same(&plain, &config));
}

/* Every setting of a station counts; the same text read twice says the same. */
static void what_differs_is_seen(void **state) {
  (void)state;
  static const char *const settings[] = {
      "scene = \"/b.cfg\";",
      "replay = \"/frames\";",
      "projector = { driver = \"p\"; };",
      "projector = { response = \"gamma 2.2\"; };",
      "projector = { response = \"gamma 2.3\"; };",
      "projector = { monitor = \"HDMI-1\"; };",
      "projector = { width = 64; height = 48; };",
      "projector = { refresh_hz = 50.0; };",
      "projector = { window = true; };",
      "camera = { driver = \"c\"; };",
      "camera = { response = \"srgb\"; };",
      "camera = { device = \"/dev/video1\"; };",
      "camera = { format = \"GREY\"; };",
      "camera = { width = 64; height = 48; };",
      "camera = { rate_hz = 15.0; };",
      "camera = { gain = 3.0; };",
      "camera = { white_balance_k = 5000.0; };",
      "camera = { focus = 7.0; };",
      "camera = { power_line_hz = 60; };",
      "rig = { calibration = \"c.h5\"; };",
      "rig = { width = 8; height = 8; };",
      "rig = { exposures_ms = [1.0, 2.0]; };",
      "rig = { exposures_ms = [1.0, 3.0]; };",
      "rig = { latency_ms = 5.0; };",
      "rig = { timeout_ms = 70.0; };",
      "rig = { attempts = 9; };",
      "rig = { verify = true; };",
      "rig = { verify = false; };",
      "rig = { patch = { left = 1; side = 2; }; };",
      "acquire = { scheme = \"brute\"; };",
      "acquire = { threshold = 0.1; };",
      "acquire = { error = 0.1; };",
      "acquire = { seconds = 9.0; };",
      "acquire = { repeats = 3; };",
      "acquire = { checks = 1; };",
      "acquire = { seed = 4; };",
      "acquire = { watch = 6; };",
      "acquire = { watch_s = 6.0; };",
      "acquire = { patience_s = 6.0; };",
      "",
  };
  enum { SETTINGS = sizeof settings / sizeof settings[0] };
  static clt_station_config config[SETTINGS], again;
  clt_error error;
  for (int k = 0; k < SETTINGS; k++) {
    memset(&config[k], k, sizeof config[k]); /* what lies between the fields */
    assert_ok(read_text(settings[k], &config[k], &error), error);
    memset(&again, 0xff, sizeof again);
    assert_ok(read_text(settings[k], &again, &error), error);
    assert_true(clt_station_same(&config[k], &again));
    for (int l = 0; l < k; l++) {
      if (clt_station_same(&config[k], &config[l])) {
        fail_msg("\"%s\" and \"%s\" are taken for the same", settings[k], settings[l]);
      }
    }
  }
}

static void mistakes_are_named(void **state) {
  (void)state;
  static const struct {
    const char *text, *wanted;
  } cases[] = {
      {"scene = 5;", ":1: scene: must be a text"},
      {"\nrig = { width = 0; height = 4; };", ":2: width: is 0; legal is 1 to 16384"},
      {"rig = { width = 8; };", "needs both width and height"},
      {"rig = { exposures_ms = [8.0, 4.0]; };", "exposures_ms: has 4 after 8"},
      {"rig = { exposures_ms = [1, 2, 3, 4, 5, 6, 7, 8, 9]; };", "has 9 values; legal is 1 to 8"},
      {"rig = { attempts = 0; };", "attempts: is 0; legal is 1 to 100"},
      {"rig = { latency_ms = -1; };", "latency_ms: is -1; legal is 0 to 10000"},
      {"rig = { patch = { left = 3; }; };", "patch needs a side"},
      {"rig = { calibration = 3; };", "calibration: must be a text"},
      {"rig = { verify = 1; };", "verify: "},
      {"rig = { timeout = 5; };", "timeout: is not a known key"},
      {"projector = { response = \"cubic\"; };", "response: "},
      {"camera = { driver = 5; };", "driver: must be a text"},
      {"acquire = { scheme = \"magic\"; };",
       "is \"magic\"; legal is \"auto\", \"brute\", \"hadamard\", \"hierarchical\", \"blocks\""},
      {"acquire = { threshold = 0.7; };", "is 0.7; legal is 0 to 0.5"},
      {"acquire = { checks = 65; };", "is 65; legal is 0 to 64"},
      {"acquire = { seeds = 1; };", "seeds: is not a known key"},
      {"deamon = { };", "deamon: is not a known key"},
      {"rig = { width = ", "syntax error"},
  };
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    clt_station_config config;
    clt_error error;
    assert_int_equal(read_text(cases[n].text, &config, &error), CLT_BAD_INPUT);
    if (strstr(error.message, cases[n].wanted) == NULL || strstr(error.message, "station.cfg:") == NULL) {
      fail_msg("%s gave \"%s\", wanted \"%s\"", cases[n].text, error.message, cases[n].wanted);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(everything_is_read),
      cmocka_unit_test(what_is_absent_is_left_to_the_scene),
      cmocka_unit_test(what_differs_is_seen),
      cmocka_unit_test(mistakes_are_named),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
