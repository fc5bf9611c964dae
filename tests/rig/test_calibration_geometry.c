/* The geometry measured again after the camera was knocked: against what its pixels truly see, and what is refused. */
#include "counterlight/calibration.h"

#include "base/order.h"
#include "rig/calibration.h"
#include "rough_room.h"
#include "wrapped_camera.h"

enum {
  PANEL_WIDTH = 16,
  PANEL_HEIGHT = 12,
  PIXELS_WIDTH = 96,
  PIXELS_HEIGHT = 72,
  PIXELS = PIXELS_WIDTH * PIXELS_HEIGHT
};

/* Two walls; the camera looks at (x, 0, z). */
static void open_room(rough_room *room, double x, double z, int pixels_width) {
  char text[1600];
  snprintf(
      text, sizeof text,
      "seed = 5; grid = { width = %d; height = %d; channels = 3; }; "
      "projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.4, 0.3]; "
      "intensity = 40.0; latency_ms = 20; bits = 10; black = 0.002; }; "
      "camera = { pixels = [%d, %d]; position = [0.75, -3.1, 0.35]; target = [%g, 0.0, %g]; "
      "tangent = [0.46, 0.345]; response = \"gamma 1.8\"; }; "
      "materials = ( { name = \"m\"; albedo = [0.7, 0.6, 0.5]; } ); "
      "surfaces = ( { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"m\"; }, "
      "{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"m\"; } );",
      PANEL_WIDTH, PANEL_HEIGHT, pixels_width, PIXELS_HEIGHT, x, z);
  rough_open_text(room, text);
}

/* What a calibration of the straight room would say of all but its geometry, from what is true of it; the geometry is
 * then measured. */
static clt_calibration *first_calibration(const rough_room *room) {
  clt_calibration known = {.info = {.panel_width = PANEL_WIDTH,
                                    .panel_height = PANEL_HEIGHT,
                                    .camera_width = PIXELS_WIDTH,
                                    .camera_height = PIXELS_HEIGHT,
                                    .channels = 3,
                                    .black_level = room->shots.sensor.black_level,
                                    .full_well = room->shots.sensor.full_well,
                                    .read_noise = room->shots.sensor.read_noise,
                                    .exposures_s = {0.01},
                                    .exposure_count = 1,
                                    .latency_s = 0.02,
                                    .complete_s = 0.04}};
  clt_calibration *made = NULL;
  clt_error error = {0};
  assert_int_equal(clt_curve_parse("gamma 1.8", &known.info.camera, NULL), CLT_OK);
  assert_ok(clt_calibrate_geometry(&known, room->projector, room->camera, NULL, &made, &error), error);
  assert_true(made->info.covered > 0.95);
  return made;
}

/* Median distance of a map from what the pixels truly see, panel pixels. */
static double off_truth(const rough_room *room, const clt_pixel_map *map) {
  clt_image truth = {0};
  clt_error error = {0};
  static double away[PIXELS];
  size_t count = 0;
  assert_ok(clt_scene_pixel_map(room->scene, &truth, &error), error);
  for (size_t i = 0; i < PIXELS; i++) {
    if (map->fate[i] == CLT_PIXEL_DECODED && truth.data[2 * PIXELS + i] == 1.0f) {
      away[count++] =
          hypot((double)map->x[i] - (double)truth.data[i], (double)map->y[i] - (double)truth.data[PIXELS + i]);
    }
  }
  clt_image_finish(&truth);
  assert_true(count > PIXELS / 3);
  clt_sort_doubles(away, count);
  return away[count / 2];
}

static void a_knocked_camera_is_found_where_it_is(void **state) {
  (void)state;
  static const double looks_at[][2] = {{-0.12, -0.05}, {-0.08, -0.11}, {-0.02, 0.01}};
  rough_room straight;
  clt_error error = {0};
  open_room(&straight, -0.08, -0.05, PIXELS_WIDTH);
  clt_calibration *known = first_calibration(&straight);
  for (size_t k = 0; k < sizeof looks_at / sizeof looks_at[0]; k++) {
    rough_room knocked;
    clt_calibration *made = NULL;
    double moved = 0;
    open_room(&knocked, looks_at[k][0], looks_at[k][1], PIXELS_WIDTH);
    assert_ok(clt_calibrate_geometry(known, knocked.projector, knocked.camera, NULL, &made, &error), error);
    assert_ok(clt_calibration_moved(known, made, &moved, &error), error);
    double before = off_truth(&knocked, &known->map), after = off_truth(&knocked, &made->map);
    printf("moved by %.2f camera pixels; off by %.3f panel pixels, before by %.3f\n", moved, after, before);
    assert_true(after < 0.06 && before > 4 * after);
    assert_near(moved, before / known->info.pitch, 0.15 * moved + 0.1);
    assert_true(made->info.full_well == known->info.full_well && made->info.complete_s == known->info.complete_s);
    clt_calibration_destroy(made);
    rough_close(&knocked);
  }
  clt_calibration_destroy(known);
  rough_close(&straight);
}

/* The gain falls from frame to frame: what automatic exposure does. */
static void fade(wrapped_camera *camera, clt_frame *frame) {
  size_t count = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
  for (size_t k = 0; k < count; k++) {
    camera->samples[k] = (uint16_t)((double)camera->samples[k] * (1 - 0.008 * (double)(camera->frames % 60)));
  }
}

static void refused(const clt_calibration *known, clt_projector *projector, clt_camera *camera, clt_status status,
                    const char *says) {
  clt_calibration *made = NULL;
  clt_error error = {0};
  assert_int_equal(clt_calibrate_geometry(known, projector, camera, NULL, &made, &error), status);
  assert_null(made);
  if (strstr(error.message, says) == NULL) {
    fail_msg("\"%s\" does not say \"%s\"", error.message, says);
  }
}

static void a_worse_geometry_is_refused(void **state) {
  (void)state;
  static wrapped_camera fading;
  rough_room straight, away, other;
  open_room(&straight, -0.08, -0.05, PIXELS_WIDTH);
  open_room(&away, 1.2, 0.9, PIXELS_WIDTH);
  open_room(&other, -0.08, -0.05, PIXELS_WIDTH - 8);
  clt_calibration *known = first_calibration(&straight);
  refused(known, away.projector, away.camera, CLT_FAILED, "of the panel where it saw");
  refused(known, other.projector, other.camera, CLT_BAD_INPUT, "88 x 72");
  wrapped_init(&fading, straight.camera, fade, 1, 1);
  refused(known, straight.projector, &fading.base, CLT_FAILED, "set the camera to manual");
  clt_calibration_destroy(known);
  rough_close(&straight);
  rough_close(&away);
  rough_close(&other);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_knocked_camera_is_found_where_it_is),
                                     cmocka_unit_test(a_worse_geometry_is_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
