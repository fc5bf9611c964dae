/* A rig opened with what calibration measured compensates as well as one opened with what is true. */
#include "counterlight/acquire.h"
#include "counterlight/solve.h"
#include "rig/photometry/photometry.h"
#include "rig/timing/flashes.h"
#include "rough_room.h"

enum { WIDTH = 16, HEIGHT = 12, CELLS = WIDTH * HEIGHT };

/* Two walls that light each other, with everything on. */
static void open_dihedral(rough_room *room, unsigned seed, const char *panel, const char *camera) {
  char text[2000];
  snprintf(
      text, sizeof text,
      "seed = %u; grid = { width = %d; height = %d; channels = 3; rays = 3; }; "
      "projector = { position = [0.0, -3.0, 0.2]; target = [0.0, 0.0, 0.0]; response = \"%s\"; latency_ms = 37; bits = "
      "10; " ROUGH_PANEL "}; camera = { cell_pixels = 3; response = \"%s\"; exposure_delay_frames = 2; }; " ROUGH_LIGHT
      "materials = ( { name = \"m\"; albedo = [0.8, 0.7, 0.6]; } ); "
      "surfaces = ( { corner = [-2, -2, -2]; u = [2, 2, 0]; v = [0, 0, 4]; material = \"m\"; }, "
      "{ corner = [0, 0, -2]; u = [2, -2, 0]; v = [0, 0, 4]; material = \"m\"; } );",
      seed, WIDTH, HEIGHT, panel, camera);
  rough_open_text(room, text);
}

static void calibrate(const rough_room *room, clt_rig_config *config) {
  clt_shots shots;
  clt_latency latency;
  clt_photometry photometry;
  clt_photometry_report report;
  clt_findings findings = {0};
  clt_error error = {0};
  clt_shots_init(&shots, room->projector, room->camera, 0.5, 5, 3);
  assert_ok(clt_latency_measure(&shots, &(clt_latency_options){0}, &latency, &findings, &error), error);
  assert_near(latency.seconds, 0.037, 2e-3);
  shots.latency_s = latency.complete_s;
  clt_photometry_options options = {.watch_s = -1};
  assert_ok(clt_photometry_measure(&shots, &options, &photometry, &report, &error), error);
  config->latency_s = latency.complete_s;
  clt_photometry_apply(&photometry, config);
}

/* A coloured picture of soft stripes. */
static void paint(clt_image *picture) {
  for (int k = 0; k < 3 * CELLS; k++) {
    int x = k % WIDTH, y = k / WIDTH % HEIGHT, c = k / CELLS;
    picture->data[k] = (float)(0.35 + 0.15 * sin(0.7 * x + 1.3 * c) * cos(0.5 * y - 0.8 * c));
  }
}

/* What the room really shows, without its drift, of a drive that a rig encodes by its panel. */
static void show(const rough_room *room, const clt_panel *panel, const char *response, const clt_image *drive,
                 clt_image *shown) {
  clt_curve curve;
  clt_error error = {0};
  float codes[3 * CELLS];
  clt_image light = {3, HEIGHT, WIDTH, codes};
  assert_int_equal(clt_curve_parse(response, &curve, NULL), CLT_OK);
  clt_panel_encode(panel, drive, 3, HEIGHT, WIDTH, codes);
  for (int k = 0; k < 3 * CELLS; k++) {
    codes[k] = (float)clt_curve_decode(&curve, rint(1023 * (double)codes[k]) / 1023);
  }
  assert_ok(clt_scene_appearance(room->scene, &light, shown, &error), error);
}

/* Error of the compensated picture in the room; *told is that of check pictures, as it is kept with T. */
static double compensated_error(rough_room *room, const clt_rig_config *config, const char *response, double *told) {
  clt_rig *rig = NULL;
  clt_transport *transport = NULL;
  clt_certificate *certificate = NULL;
  clt_image picture = {0}, drive = {0}, shown = {0}, target = {0};
  clt_image *images[] = {&picture, &drive, &shown, &target};
  clt_compensation result;
  clt_error error = {0};
  clt_white white = {.kind = CLT_WHITE_AUTO};
  double value[CLT_CHANNELS_MAX];
  assert_ok(clt_rig_open(config, room->projector, room->camera, &rig, &error), error);
  assert_ok(clt_acquire(rig, &(clt_acquire_options){.scheme = "brute", .checks = 2}, &transport, &error), error);
  *told = clt_transport_origin(transport)->error;
  assert_ok(clt_certify(transport, &certificate, &error), error);
  assert_ok(clt_image_init(&picture, 3, HEIGHT, WIDTH, &error), error);
  paint(&picture);
  assert_ok(clt_target(transport, certificate, &picture, &white, &target, value, &error), error);
  assert_ok(
      clt_compensate(transport, certificate, &picture, &white, &(clt_solve_options){0}, false, &drive, &result, &error),
      error);
  show(room, &config->projector, response, &drive, &shown);
  double after = clt_appearance_error(certificate, &shown, &target, false);
  for (int n = 0; n < 4; n++) {
    clt_image_finish(images[n]);
  }
  clt_certificate_destroy(certificate);
  clt_transport_destroy(transport);
  rig->operations->close(rig);
  return after;
}

static void check(unsigned seed, const char *panel, const char *camera) {
  rough_room room;
  clt_rig_config truth, found;
  open_dihedral(&room, seed, panel, camera);
  clt_scene_rig_config(room.scene, &truth);
  found = truth;
  calibrate(&room, &found);
  double told[2];
  double with_truth = compensated_error(&room, &truth, panel, &told[0]);
  double with_found = compensated_error(&room, &found, panel, &told[1]);
  printf("seed %u, %s seen by %s: error %.3f %% with true values, %.3f %% calibrated; check error %.3f, %.3f %%\n",
         seed, panel, camera, 100 * with_truth, 100 * with_found, 100 * told[0], 100 * told[1]);
  /* colours that the panel has no code for are not held against T */
  assert_true(told[0] >= 0 && told[0] < 0.01 && told[1] >= 0 && told[1] < 0.01);
  assert_true(with_truth < 0.01);
  assert_near(with_found, with_truth, 0.005);
  rough_close(&room);
}

static void calibrated_is_as_good_as_true(void **state) {
  (void)state;
  check(1, "srgb", "linear");
  check(2, "gamma 2.2", "gamma 2.2");
}

/* The control of the test above: it would see crosstalk that was not measured. */
static void crosstalk_matters(void **state) {
  (void)state;
  rough_room room;
  clt_rig_config config;
  open_dihedral(&room, 3, "srgb", "linear");
  clt_scene_rig_config(room.scene, &config);
  config.projector = clt_panel_of_curve(&config.projector.response[0]);
  double told;
  assert_true(compensated_error(&room, &config, "srgb", &told) > 0.01);
  assert_true(told > 0.02);
  rough_close(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(calibrated_is_as_good_as_true),
      cmocka_unit_test(crosstalk_matters),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
