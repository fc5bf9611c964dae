/* Parts of photometry by themselves, and devices that it must find fault with. */
#include "rig/photometry/monotone.h"
#include "rig/photometry/photometry.h"
#include "rough_room.h"
#include "wrapped_camera.h"

/* Against the definition: of all ascending sequences the nearest, found by projecting onto every face in turn
 * (Dykstra 1983). */
static void monotone_fits_are_the_nearest(void **state) {
  (void)state;
  enum { N = 12, SWEEPS = 4000 };
  uint64_t random = 3;
  for (int round = 0; round < 20; round++) {
    double y[N], weight[N], nearest[N], correction[N][2];
    memset(correction, 0, sizeof correction);
    for (int i = 0; i < N; i++) {
      nearest[i] = y[i] = 0.1 * i + test_random(&random);
      weight[i] = 0.2 + test_random(&random);
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
      for (int i = 0; i + 1 < N; i++) {
        double a = nearest[i] + correction[i][0], b = nearest[i + 1] + correction[i][1];
        double mean = (weight[i] * a + weight[i + 1] * b) / (weight[i] + weight[i + 1]);
        nearest[i] = a > b ? mean : a;
        nearest[i + 1] = a > b ? mean : b;
        correction[i][0] = a - nearest[i];
        correction[i][1] = b - nearest[i + 1];
      }
    }
    clt_monotone_fit(y, weight, N);
    for (int i = 0; i < N; i++) {
      assert_near(y[i], nearest[i], 1e-6);
      assert_true(i == 0 || y[i] >= y[i - 1]);
    }
  }
}

/* Every promise of clt_exposures_choose, over a range of cameras, rooms and panels. */
static void exposures_keep_their_promises(void **state) {
  (void)state;
  uint64_t random = 8;
  for (int round = 0; round < 300; round++) {
    double refresh_hz = round % 3 == 0 ? 50 : 60;
    clt_exposure_needs needs = {.brightest = 0.2 * pow(10, 2 * test_random(&random)),
                                .snr = 10 + 40 * test_random(&random),
                                .full_well = 3000 * pow(10, test_random(&random)),
                                .read_noise = 1 + 9 * test_random(&random),
                                .refresh_s = 1 / refresh_hz,
                                .flicker_hz = round % 2 == 0 ? 100 : 0,
                                .least_s = 1e-5,
                                .most_s = 4};
    needs.darkest = needs.brightest * pow(10, -1 - 2 * test_random(&random));
    clt_exposure_choice choice;
    clt_exposures_choose(&needs, &choice);
    assert_true(choice.count >= 1 && choice.count <= CLT_EXPOSURES_MAX);
    assert_true(needs.brightest * choice.seconds[0] <= 0.8 + 1e-9);
    double last = choice.seconds[choice.count - 1];
    double electrons = needs.darkest * last * needs.full_well;
    double snr = electrons / sqrt(electrons + needs.read_noise * needs.read_noise);
    assert_near(choice.snr, snr, 1e-9 * snr);
    assert_true(snr >= needs.snr * 0.999 || choice.count == CLT_EXPOSURES_MAX || last > 3.9);
    for (int k = 0; k < choice.count; k++) {
      double periods = choice.seconds[k] * refresh_hz, cycles = choice.seconds[k] * needs.flicker_hz;
      assert_true(periods < 1 || fabs(periods - rint(periods)) < 1e-6 || last > 3.9);
      assert_true(choice.seconds[k] < 0.05 || last > 3.9 || fabs(cycles - rint(cycles)) < 1e-6);
      assert_true(k == 0 || choice.seconds[k] > choice.seconds[k - 1]);
      assert_true(choice.reason[k][0] != '\0');
    }
  }
}

static const char grey[] =
    "grid = { width = 32; height = 24; channels = 1; rays = 2; }; camera = { response = \"gamma 2.2\"; %s }; ambient = "
    "0.003; projector = { position = [0.5, -2.0, 0.3]; response = \"gamma 1.8\"; %s }; "
    "materials = ( { name = \"m\"; albedo = 0.6; } ); "
    "surfaces = ( { corner = [-4, 0, -4]; u = [8, 0, 0]; v = [0, 0, 8]; material = \"m\"; } );";

static void open_grey(rough_room *room, const char *camera, const char *projector) {
  char text[1500];
  snprintf(text, sizeof text, grey, camera, projector);
  rough_open_text(room, text);
}

/* One channel; a camera so sensitive that a refresh period saturates it, and one so dull that it needs several. */
static void bright_dim_and_grey_rooms_are_measured(void **state) {
  (void)state;
  static const double sensitive[] = {1, 6, 0.1};
  clt_curve exact = {.kind = CLT_CURVE_GAMMA, .gamma = 1.8};
  for (int n = 0; n < 3; n++) {
    rough_room room;
    char camera[100];
    open_grey(&room, "", "");
    snprintf(camera, sizeof camera, "responsivity = %.9g;", sensitive[n] * room.shots.sensor.responsivity);
    rough_close(&room);
    open_grey(&room, camera, "");
    clt_photometry found;
    clt_photometry_report report;
    clt_error error = {0};
    assert_ok(clt_photometry_measure(&room.shots, &(clt_photometry_options){.watch_s = -1}, &found, &report, &error),
              error);
    for (int code = 0; code <= 255; code++) {
      assert_near(clt_curve_decode(&found.panel.response[0], code / 255.0), clt_curve_decode(&exact, code / 255.0),
                  2e-3);
    }
    assert_near(found.full_well / 15000, 1, 0.03);
    assert_false(found.panel.mixes);
    assert_true(n != 0 || report.base_s == 1 / 60.0);
    assert_true(n != 1 || (report.base_s < 1 / 60.0 && report.findings.count == 1 &&
                           strstr(report.findings.item[0].text, "refresh period of 16.67 ms saturates") != NULL));
    assert_true(n != 2 || report.base_s > 4 / 60.0);
    rough_close(&room);
  }
}

/* A projector that adds a white segment of a fifth where all channels are bright. */
typedef struct boosting_projector {
  clt_projector base;
  clt_projector *inner;
} boosting_projector;

static void boost_describe(const clt_projector *projector, clt_projector_info *info) {
  const clt_projector *inner = ((const boosting_projector *)projector)->inner;
  inner->driver->describe(inner, info);
}

static clt_status boost_present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  clt_projector *inner = ((boosting_projector *)projector)->inner;
  static float boosted[3 * ROUGH_CELLS];
  for (int i = 0; i < ROUGH_CELLS; i++) {
    float white = fminf(codes[i], fminf(codes[ROUGH_CELLS + i], codes[2 * ROUGH_CELLS + i]));
    for (int c = 0; c < 3; c++) {
      boosted[c * ROUGH_CELLS + i] = (codes[c * ROUGH_CELLS + i] + 0.2f * white) / 1.2f;
    }
  }
  return inner->driver->present(inner, boosted, shown_ns, error);
}

static void a_white_boost_is_named(void **state) {
  (void)state;
  static const clt_projector_driver driver = {.name = "boosting", .describe = boost_describe, .present = boost_present};
  rough_room room;
  rough_open(&room, 1, (rough_settings){"response = \"linear\"; bits = 12;", "", ""});
  boosting_projector projector = {{&driver}, room.projector};
  clt_photometry found;
  clt_photometry_report report;
  clt_error error = {0};
  clt_shots_init(&room.shots, &projector.base, room.camera, room.shots.latency_s, 10, 3);
  assert_ok(clt_photometry_measure(&room.shots, &(clt_photometry_options){.watch_s = -1}, &found, &report, &error),
            error);
  assert_int_equal(report.findings.count, 1);
  assert_true(report.findings.item[0].serious);
  assert_non_null(strstr(report.findings.item[0].text, "white is 20.0 % brighter than red, green and blue together"));
  rough_close(&room);
}

/* A gain that wanders by chance from frame to frame. */
static void wander(wrapped_camera *self, clt_frame *frame) {
  double gain = 1 + self->strength * (2 * test_random(&self->random) - 1);
  for (int c = 0; c < 3; c++) {
    wrapped_scale(self, frame, c, gain);
  }
}

static void a_wandering_gain_is_named(void **state) {
  (void)state;
  static wrapped_camera camera;
  rough_room room;
  clt_photometry found;
  clt_photometry_report report;
  clt_error error = {0};
  rough_open(&room, 1, (rough_settings){"", "cell_pixels = 2;", ""});
  wrapped_init(&camera, room.camera, wander, 0.045, 5);
  clt_shots_init(&room.shots, room.projector, &camera.base, room.shots.latency_s, 10, 3);
  assert_ok(clt_photometry_measure(&room.shots, &(clt_photometry_options){.watch_s = -1}, &found, &report, &error),
            error);
  bool named = false;
  for (int n = 0; n < report.findings.count; n++) {
    named = named || strstr(report.findings.item[n].text, "samples are no function of light times exposure") != NULL;
  }
  assert_true(named);
  rough_close(&room);
}

/* A shutter that is closed is said to be. */
static void darkness_is_named(void **state) {
  (void)state;
  rough_room room;
  clt_photometry found;
  clt_photometry_report report;
  clt_error error = {0};
  rough_open(&room, 1, (rough_settings){"intensity = 1e-6;", "responsivity = 1.0;", ""});
  assert_int_equal(clt_photometry_measure(&room.shots, &(clt_photometry_options){0}, &found, &report, &error),
                   CLT_FAILED);
  assert_non_null(strstr(error.message, "hardly brighter to the camera than the dark one"));
  rough_close(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(monotone_fits_are_the_nearest),
      cmocka_unit_test(exposures_keep_their_promises),
      cmocka_unit_test(bright_dim_and_grey_rooms_are_measured),
      cmocka_unit_test(a_white_boost_is_named),
      cmocka_unit_test(a_wandering_gain_is_named),
      cmocka_unit_test(darkness_is_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
