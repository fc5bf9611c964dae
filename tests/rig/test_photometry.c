/* Photometry of simulated rooms with everything on, against what the scene file says of them. */
#include "rig/photometry/photometry.h"
#include "rough_room.h"

typedef struct rough_case {
  const char *projector, *camera;
  double full_well, read_noise;
  int bits;
} rough_case;

static const rough_case cases[] = {
    {"srgb", "linear", 15000, 4, 12}, {"gamma 2.2", "gamma 2.2", 15000, 4, 12}, {"gamma 1.8", "srgb", 30000, 8, 12}};

/* Sample code to light as the calibration has it, and as it is. */
static double largest_error(const clt_photometry *found, const rough_case *truth) {
  clt_curve curve;
  assert_int_equal(clt_curve_parse(truth->camera, &curve, NULL), CLT_OK);
  double top = (1 << truth->bits) - 1, black = 1 << (truth->bits - 6), most = 0;
  for (int sample = (int)black; sample <= (int)top; sample++) {
    double exact = clt_curve_decode(&curve, (sample - black) / (top - black));
    double got = clt_curve_decode(&found->camera, (sample - found->black_level) / (top - found->black_level));
    most = fmax(most, fabs(got - exact));
  }
  return most;
}

/* The flicker is seen and is all there is to say; exposures are whole refresh periods, and of the flicker where long.
 */
static void check_report(const clt_photometry *found, const clt_photometry_report *report) {
  assert_near(report->flicker.hz, 100, 0);
  assert_int_equal(report->findings.count, 1);
  assert_non_null(strstr(report->findings.item[0].text, "flickers by"));
  assert_false(report->findings.item[0].serious);
  assert_int_equal(report->lit, ROUGH_CELLS * 4);
  assert_true(found->exposure_count >= 2 && found->exposure_count <= CLT_EXPOSURES_MAX);
  for (int k = 0; k < found->exposure_count; k++) {
    double periods = found->exposures_s[k] * 60, cycles = found->exposures_s[k] * 100;
    assert_near(periods, rint(periods), 1e-6);
    assert_true(k == 0 || fabs(cycles - rint(cycles)) < 1e-6);
  }
  assert_true(report->exposures.snr >= 40);
}

static void measure(unsigned seed, const rough_case *truth, const char *faults) {
  char projector[300], camera[300];
  snprintf(projector, sizeof projector, "response = \"%s\"; latency_ms = 37; " ROUGH_PANEL, truth->projector);
  snprintf(camera, sizeof camera, "response = \"%s\"; full_well = %g; read_noise = %g; bits = %d; %s", truth->camera,
           truth->full_well, truth->read_noise, truth->bits, faults);
  rough_room room;
  rough_open(&room, seed, (rough_settings){projector, camera, ROUGH_LIGHT});
  room.shots.sensor.full_well = 1; /* none of these is to be taken from the driver */
  room.shots.sensor.read_noise = 1;
  room.shots.sensor.black_level = 0;
  clt_photometry found;
  clt_photometry_report report;
  clt_error error = {0};
  assert_ok(clt_photometry_measure(&room.shots, &(clt_photometry_options){0}, &found, &report, &error), error);
  double camera_error = largest_error(&found, truth), well_error = found.full_well / truth->full_well - 1,
         noise_error = found.read_noise / truth->read_noise - 1;
  clt_curve exact;
  assert_int_equal(clt_curve_parse(truth->projector, &exact, NULL), CLT_OK);
  double panel_error = 0, crosstalk_error = 0, black_error = 0;
  for (int c = 0; c < 3; c++) {
    for (int code = 0; code <= 255; code++) {
      double off = clt_curve_decode(&found.panel.response[c], code / 255.0) - clt_curve_decode(&exact, code / 255.0);
      panel_error = fmax(panel_error, fabs(off));
    }
    for (int k = 0; k < 3; k++) {
      crosstalk_error = fmax(crosstalk_error, fabs(found.panel.crosstalk[c][k] - rough_crosstalk[c][k]));
    }
    black_error = fmax(black_error, fabs(found.black[c] - rough_black(&room, c)));
  }
  printf(
      "seed %u, %s seen by %s: of full scale panel %.1e, camera %.1e; crosstalk %.1e, black %.1e of white; full well "
      "%+.1f %%, read noise %+.1f %%; %ld frames\n",
      seed, truth->projector, truth->camera, panel_error, camera_error, crosstalk_error, black_error, 100 * well_error,
      100 * noise_error, report.frames);
  assert_true(panel_error <= 0.002 && camera_error <= 0.002);
  assert_true(crosstalk_error <= 0.001 && black_error <= 5e-5);
  assert_true(fabs(well_error) <= 0.03 && fabs(noise_error) <= 0.05);
  assert_int_equal(found.camera.kind, strcmp(truth->camera, "linear") == 0 ? CLT_CURVE_LINEAR : CLT_CURVE_TABLE);
  assert_true(faults[0] != 0 || report.camera.residual < 0.0015); /* half of what is a finding */
  check_report(&found, &report);
  rough_close(&room);
}

static void rough_rooms_are_measured(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 2; seed++) {
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
      measure(seed, &cases[n], "");
    }
  }
}

/* Frames that are dropped, stuck and torn change none of it. */
static void rough_rooms_are_measured_by_faulty_cameras(void **state) {
  (void)state;
  measure(3, &cases[0], "faults = { dropped = 0.03; stuck = 0.03; torn = 0.03; };");
  measure(4, &cases[1], "faults = { dropped = 0.03; stuck = 0.03; torn = 0.03; };");
}

static bool stop_at_seven(void *context, int done, int total) {
  *(int *)context = done;
  return done < 7 && total > 100;
}

static void it_stops_where_it_is_told_to(void **state) {
  (void)state;
  rough_room room;
  int fields = 0;
  clt_photometry found;
  clt_photometry_report report;
  clt_error error = {0};
  const clt_photometry_options options = {.progress = stop_at_seven, .context = &fields};
  rough_open(&room, 1, (rough_settings){"latency_ms = 37; " ROUGH_PANEL, "", ROUGH_LIGHT});
  assert_int_equal(clt_photometry_measure(&room.shots, &options, &found, &report, &error), CLT_CANCELLED);
  assert_string_equal(error.message, "photometry was stopped after 7 fields");
  assert_int_equal(fields, 7);
  rough_close(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(rough_rooms_are_measured),
      cmocka_unit_test(rough_rooms_are_measured_by_faulty_cameras),
      cmocka_unit_test(it_stops_where_it_is_told_to),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
