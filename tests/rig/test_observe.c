/* The camera rig on scripted devices: which frame belongs to which pattern. */
#include "fake_devices.h"

enum { WIDTH = 4, HEIGHT = 2, CELLS = WIDTH * HEIGHT };

typedef struct rig_bench {
  fake_world world;
  clt_rig_config config;
  clt_rig *rig;
  clt_image drive, radiance, deviation;
  clt_error error;
} rig_bench;

static void open_bench(rig_bench *bench) {
  bench->error = (clt_error){0};
  assert_ok(
      clt_rig_open(&bench->config, &bench->world.projector.base, &bench->world.camera.base, &bench->rig, &bench->error),
      bench->error);
  clt_image *images[] = {&bench->drive, &bench->radiance, &bench->deviation};
  for (int i = 0; i < 3; i++) {
    assert_ok(clt_image_init(images[i], FAKE_CHANNELS, HEIGHT, WIDTH, &bench->error), bench->error);
  }
}

static void start_bench(rig_bench *bench) {
  fake_world_init(&bench->world, WIDTH, HEIGHT);
  bench->config = fake_rig_config(&bench->world);
}

static void close_bench(rig_bench *bench) {
  bench->rig->operations->close(bench->rig);
  clt_image_finish(&bench->drive);
  clt_image_finish(&bench->radiance);
  clt_image_finish(&bench->deviation);
}

static clt_status observe(rig_bench *bench) {
  return bench->rig->operations->observe(bench->rig, &bench->drive, &bench->radiance, &bench->deviation, &bench->error);
}

/* Drives each cell differently, anew in every round, and checks that its radiance is this round's. */
static void check_rounds(rig_bench *bench, int rounds) {
  uint64_t random = 5;
  double step = 1 / (4031.0 * bench->config.exposures_s[0] * bench->world.sensor.responsivity);
  for (int n = 0; n < rounds; n++) {
    for (int i = 0; i < CELLS * FAKE_CHANNELS; i++) {
      bench->drive.data[i] = (float)test_random(&random);
    }
    assert_ok(observe(bench), bench->error);
    for (int i = 0; i < CELLS * FAKE_CHANNELS; i++) {
      assert_near(bench->radiance.data[i], bench->world.gain * bench->drive.data[i] + bench->world.ambient, step);
      assert_true(isfinite(bench->deviation.data[i]) && bench->deviation.data[i] > 0);
    }
  }
  clt_rig_info info;
  bench->rig->operations->describe(bench->rig, &info);
  assert_int_equal(info.patterns, rounds);
  assert_int_equal(info.frames, rounds * bench->config.exposure_count);
  assert_string_equal(info.source, "a fake");
  assert_int_equal(info.width * info.height * info.channels, CELLS * FAKE_CHANNELS);
}

static void frames_belong_to_their_pattern(void **state) {
  (void)state;
  static const double lags[] = {0, 0.001, 0.0167, 0.04, 0.1};
  static const int delays[] = {0, 1, 3};
  for (int l = 0; l < 5; l++) {
    for (int d = 0; d < 3; d++) {
      rig_bench bench;
      start_bench(&bench);
      bench.world.lag_s = bench.config.latency_s = lags[l];
      bench.world.exposure_delay = delays[d];
      open_bench(&bench);
      check_rounds(&bench, 6);
      close_bench(&bench);
    }
  }
}

/* The control of the test above: a latency that is too small by one frame does pick frames of the change. */
static void too_small_a_latency_shows(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  bench.world.lag_s = 0.2;
  bench.config.latency_s = 0.2 - 2.0 / 30;
  open_bench(&bench);
  for (int i = 0; i < CELLS * FAKE_CHANNELS; i++) {
    bench.drive.data[i] = 1;
  }
  assert_ok(observe(&bench), bench.error);
  assert_true(bench.radiance.data[0] < 0.9);
  close_bench(&bench);
}

static void dropped_frames_and_silence_are_survived(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  static const int dropped[] = {2, 3, 4, 9, 14, 15, 21, 30};
  static const int silent[] = {6, 19, 26, 40};
  for (int i = 0; i < 8; i++) {
    bench.world.script[dropped[i]] = FAKE_DROPPED;
  }
  for (int i = 0; i < 4; i++) {
    bench.world.script[silent[i]] = FAKE_SILENCE;
  }
  open_bench(&bench);
  check_rounds(&bench, 8);
  close_bench(&bench);
}

static void lasting_silence_is_a_timeout_after_every_attempt(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  bench.config.attempts = 3;
  for (int n = 0; n < FAKE_SCRIPT_MAX; n++) {
    bench.world.script[n] = FAKE_SILENCE;
  }
  open_bench(&bench);
  assert_int_equal(observe(&bench), CLT_TIMEOUT);
  assert_non_null(strstr(bench.error.message, "3 attempts"));
  assert_non_null(strstr(bench.error.message, "no frame within"));
  assert_int_equal(bench.world.sequence, 3);
  close_bench(&bench);
}

static void a_camera_that_is_gone_is_not_asked_again(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  bench.world.script[5] = FAKE_GONE;
  open_bench(&bench);
  clt_status status = CLT_OK;
  for (int n = 0; n < 4 && status == CLT_OK; n++) {
    status = observe(&bench);
  }
  assert_int_equal(status, CLT_GONE);
  assert_int_equal(bench.world.sequence, 6);
  close_bench(&bench);
}

static void a_deaf_camera_is_named_with_both_exposures(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  bench.world.deaf = true;
  open_bench(&bench);
  assert_int_equal(observe(&bench), CLT_TIMEOUT);
  assert_non_null(strstr(bench.error.message, "no frame with exposure 4.167 ms after 8 frames (last had 16.67 ms)"));
  close_bench(&bench);
}

/* As USB cameras do, to 0.1 ms: 0.52 ms becomes 0.5 ms, and the light is that of 0.5 ms. */
static void a_rounded_exposure_counts_as_what_it_was(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  bench.world.unit_s = bench.world.sensor.exposure_min_s;
  bench.config.exposures_s[0] = 0.00052;
  bench.config.exposure_count = 1;
  open_bench(&bench);
  check_rounds(&bench, 3);
  close_bench(&bench);
}

static void responses_are_undone(void **state) {
  (void)state;
  static const char *const curves[] = {"linear", "srgb", "gamma 2.2"};
  for (int p = 0; p < 3; p++) {
    for (int c = 0; c < 3; c++) {
      rig_bench bench;
      start_bench(&bench);
      assert_ok(clt_curve_parse(curves[p], &bench.world.projector_curve, &bench.error), bench.error);
      assert_ok(clt_curve_parse(curves[c], &bench.config.camera, &bench.error), bench.error);
      bench.config.projector = clt_panel_of_curve(&bench.world.projector_curve);
      bench.world.camera_curve = bench.config.camera;
      open_bench(&bench);
      check_rounds(&bench, 2);
      clt_rig_info info;
      bench.rig->operations->describe(bench.rig, &info);
      assert_memory_equal(info.response, curves[p], 4);
      close_bench(&bench);
    }
  }
}

/* A panel of 4 x 2 pixels on a grid of 2 x 1 cells: every pixel of a cell gets its code. */
static void cells_cover_their_panel_pixels(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  bench.config.width = 2;
  bench.config.height = 1;
  open_bench(&bench);
  clt_image drive = {FAKE_CHANNELS, 1, 2, (float[]){0.25f, 1, 0.5f, 0, 0.125f, 0.75f}};
  clt_image radiance = {FAKE_CHANNELS, 1, 2, (float[6]){0}}, deviation = {FAKE_CHANNELS, 1, 2, (float[6]){0}};
  assert_ok(bench.rig->operations->observe(bench.rig, &drive, &radiance, &deviation, &bench.error), bench.error);
  for (int i = 0; i < CELLS * FAKE_CHANNELS; i++) {
    int channel = i / CELLS, x = i % WIDTH;
    assert_near(bench.world.after[i], drive.data[channel * 2 + x / 2], 1e-6);
  }
  for (int i = 0; i < 6; i++) {
    assert_near(radiance.data[i], drive.data[i] + bench.world.ambient, 0.004);
  }
  close_bench(&bench);
}

static void refuse(rig_bench *bench, const char *wanted) {
  clt_rig *rig = NULL;
  clt_error error = {0};
  assert_int_equal(clt_rig_open(&bench->config, &bench->world.projector.base, &bench->world.camera.base, &rig, &error),
                   CLT_BAD_INPUT);
  if (strstr(error.message, wanted) == NULL) {
    fail_msg("\"%s\" does not say \"%s\"", error.message, wanted);
  }
  start_bench(bench);
}

static void settings_that_do_not_fit_are_refused(void **state) {
  (void)state;
  rig_bench bench;
  start_bench(&bench);
  bench.config.width = 3;
  refuse(&bench, "4 x 2 pixels are no whole multiple of the grid's 3 x 2");
  bench.config.width = 1;
  refuse(&bench, "8 x 4 pixels");
  bench.config.height = 0;
  refuse(&bench, "4 x 0 cells");
  bench.config.exposure_count = 9;
  refuse(&bench, "9 exposures");
  bench.config.exposures_s[1] = 1;
  refuse(&bench, "1000 ms; the camera takes 0.1 to 33.3");
  bench.config.exposures_s[1] = bench.config.exposures_s[0];
  refuse(&bench, "must ascend");
  bench.config.attempts = 0;
  refuse(&bench, "0 attempts");
  bench.config.latency_s = -1;
  refuse(&bench, "latency -1000 ms");
  bench.world.panel.channels = 1;
  refuse(&bench, "1 channels, the camera 3");
  bench.world.sensor.full_well = 0;
  refuse(&bench, "full well 0");
  open_bench(&bench);
  bench.drive.width = 3;
  assert_int_equal(observe(&bench), CLT_BAD_INPUT);
  bench.drive.width = WIDTH;
  close_bench(&bench);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(frames_belong_to_their_pattern),
      cmocka_unit_test(too_small_a_latency_shows),
      cmocka_unit_test(dropped_frames_and_silence_are_survived),
      cmocka_unit_test(lasting_silence_is_a_timeout_after_every_attempt),
      cmocka_unit_test(a_camera_that_is_gone_is_not_asked_again),
      cmocka_unit_test(a_deaf_camera_is_named_with_both_exposures),
      cmocka_unit_test(a_rounded_exposure_counts_as_what_it_was),
      cmocka_unit_test(responses_are_undone),
      cmocka_unit_test(cells_cover_their_panel_pixels),
      cmocka_unit_test(settings_that_do_not_fit_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
