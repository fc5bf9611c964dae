/* Structured light through devices: measured, recorded and replayed. */
#include "counterlight/replay.h"
#include "rig/geometry/geometry.h"
#include "structured.h"

/* A panel and a camera that looks at it; the codes say which picture is shown. */
typedef struct world {
  clt_projector projector;
  clt_camera camera;
  seen_scene scene;
  clt_gray gray;
  int shown; /* picture on the panel */
  int64_t now_ns;
  uint16_t samples[SEEN_PIXELS];
  float drawn[PANEL_WIDTH * PANEL_HEIGHT];
} world;

static world *of_camera(const clt_camera *camera) {
  return (world *)((char *)(uintptr_t)camera - offsetof(world, camera));
}

static void describe_projector(const clt_projector *projector, clt_projector_info *info) {
  (void)projector;
  *info = (clt_projector_info){PANEL_WIDTH, PANEL_HEIGHT, 1, 8, 1 / 60.0, false};
}

static void describe_camera(const clt_camera *camera, clt_camera_info *info) {
  *info = seen_sensor(&of_camera(camera)->scene);
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  world *w = (world *)projector;
  for (int k = 0; k < clt_gray_pictures(&w->gray); k++) {
    clt_gray_draw(&w->gray, k, 1, w->drawn);
    if (memcmp(codes, w->drawn, sizeof w->drawn) == 0) {
      w->shown = k;
      *shown_ns = w->now_ns += 16000000;
      return CLT_OK;
    }
  }
  return clt_fail(error, CLT_BAD_INPUT, "no Gray code picture");
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  (void)camera;
  (void)error;
  assert_true(seconds == 0.01);
  return CLT_OK;
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  (void)timeout_s;
  (void)error;
  world *w = of_camera(camera);
  *frame = seen_frame(&w->scene, &w->gray, w->shown, w->samples);
  frame->exposed_ns = w->now_ns = (not_before_ns > w->now_ns ? not_before_ns : w->now_ns) + 1000;
  return CLT_OK;
}

static void world_init(world *w) {
  static const clt_projector_driver projector_driver = {
      .name = "seen", .describe = describe_projector, .present = present};
  static const clt_camera_driver camera_driver = {"seen", describe_camera, set_exposure, next, NULL};
  clt_error error = {0};
  *w = (world){.projector = {&projector_driver}, .camera = {&camera_driver}, .scene = seen_wall(50)};
  assert_ok(clt_gray_init(&w->gray, PANEL_WIDTH, PANEL_HEIGHT, &error), error);
}

static bool stop_at_seven(void *context, int done, int total) {
  assert_int_equal(total, 32);
  *(int *)context = done;
  return done < 7;
}

static clt_status measure(clt_projector *projector, clt_camera *camera, clt_geometry_options *how, clt_geometry *out,
                          clt_findings *findings, clt_error *error) {
  clt_shots shots;
  clt_shots_init(&shots, projector, camera, 0.001, 1, 1);
  how->exposure_s = 0.01;
  clt_status status = clt_geometry_measure(&shots, how, out, findings, error);
  assert_true(status != CLT_OK || shots.shown == clt_gray_pictures(&how->gray));
  return status;
}

static void a_replayed_measurement_gives_the_same_map(void **state) {
  (void)state;
  static world w;
  char folder[64], recording[80], command[128];
  clt_projector *projector;
  clt_camera *camera;
  clt_geometry live, again;
  clt_findings findings = {0};
  clt_error error = {0};
  world_init(&w);
  clt_geometry_options how = {.gray = w.gray};
  snprintf(recording, sizeof recording, "%s/recording", test_folder(folder));
  assert_ok(clt_recording_open(recording, &w.projector, &w.camera, &projector, &camera, &error), error);
  assert_ok(measure(projector, camera, &how, &live, &findings, &error), error);
  projector->driver->close(projector);
  camera->driver->close(camera);
  assert_int_equal(findings.count, 0);
  assert_true(live.decode.count[CLT_PIXEL_DECODED] > SEEN_PIXELS * 9 / 10);
  assert_ok(clt_replay_open(recording, &projector, &camera, &error), error);
  assert_ok(measure(projector, camera, &how, &again, &findings, &error), error);
  assert_memory_equal(again.map.x, live.map.x, SEEN_PIXELS * sizeof *live.map.x);
  assert_memory_equal(again.map.y, live.map.y, SEEN_PIXELS * sizeof *live.map.y);
  assert_memory_equal(again.map.fate, live.map.fate, SEEN_PIXELS);
  clt_geometry_finish(&again);
  assert_int_equal(measure(projector, camera, &how, &again, &findings, &error), CLT_GONE);
  assert_non_null(strstr(error.message, "picture 1 of 32"));
  projector->driver->close(projector);
  camera->driver->close(camera);
  clt_geometry_finish(&live);
  snprintf(command, sizeof command, "rm -r '%s'", folder);
  assert_int_equal(system(command), 0);
}

static void stopping_and_other_panels_end_it(void **state) {
  (void)state;
  static world w;
  clt_geometry geometry;
  clt_findings findings = {0};
  clt_error error = {0};
  int done = 0;
  world_init(&w);
  clt_geometry_options how = {.gray = w.gray, .progress = stop_at_seven, .context = &done};
  assert_int_equal(measure(&w.projector, &w.camera, &how, &geometry, &findings, &error), CLT_CANCELLED);
  assert_int_equal(done, 7);
  assert_ok(clt_gray_init(&how.gray, PANEL_WIDTH + 1, PANEL_HEIGHT, &error), error);
  assert_int_equal(measure(&w.projector, &w.camera, &how, &geometry, &findings, &error), CLT_BAD_INPUT);
  assert_null(geometry.map.x);
}

static void darkness_is_a_finding(void **state) {
  (void)state;
  static world w;
  clt_geometry geometry;
  clt_findings findings = {0};
  clt_error error = {0};
  world_init(&w);
  w.scene.shadow = 3;
  clt_geometry_options how = {.gray = w.gray};
  assert_ok(measure(&w.projector, &w.camera, &how, &geometry, &findings, &error), error);
  assert_int_equal(findings.count, 1);
  assert_true(findings.item[0].serious);
  assert_non_null(strstr(findings.item[0].text, "no camera pixel was decoded"));
  clt_geometry_finish(&geometry);
}

/* Half of the picture sees a second place of the panel by a mirror: told where that is as bright as to make pixels
 * double, not where it is faint. */
static void a_map_of_holes_is_a_finding(void **state) {
  (void)state;
  static world w;
  static const double mirrors[] = {0.05, 0.8, 1.0};
  for (size_t m = 0; m < sizeof mirrors / sizeof mirrors[0]; m++) {
    clt_geometry geometry;
    clt_findings findings = {0};
    clt_error error = {0};
    char counted[80];
    int told = 0;
    world_init(&w);
    w.scene.light = 0.2;
    w.scene.mirror = mirrors[m];
    clt_geometry_options how = {.gray = w.gray};
    assert_ok(measure(&w.projector, &w.camera, &how, &geometry, &findings, &error), error);
    const long lit = SEEN_PIXELS - geometry.decode.count[CLT_PIXEL_UNLIT];
    const double decoded = 100.0 * (double)geometry.decode.count[CLT_PIXEL_DECODED] / (double)lit;
    snprintf(counted, sizeof counted, "only %.1f %% of the %ld lit pixels were decoded", decoded, lit);
    for (int k = 0; k < findings.count; k++) {
      told += findings.item[k].serious && strstr(findings.item[k].text, counted) != NULL;
    }
    assert_true(m == 0 ? decoded > 90 : decoded < 60);
    assert_int_equal(told, m > 0);
    clt_geometry_finish(&geometry);
  }
}

/* Neighbouring columns and rows differ in one bit; each pair is a picture and its inverse; codes are unique. */
static void pictures_are_a_gray_code(void **state) {
  (void)state;
  enum { WIDTH = 21, HEIGHT = 9, PICTURES = 2 * (5 + 4) };
  static float codes[PICTURES][3 * WIDTH * HEIGHT];
  clt_gray gray;
  clt_error error = {0};
  assert_ok(clt_gray_init(&gray, WIDTH, HEIGHT, &error), error);
  assert_int_equal(clt_gray_pictures(&gray), PICTURES);
  for (int k = 0; k < PICTURES; k++) {
    clt_gray_draw(&gray, k, 3, codes[k]);
    for (int i = 0; i < 3 * WIDTH * HEIGHT; i++) {
      assert_true(codes[k][i] == codes[k][i % (WIDTH * HEIGHT)] && (codes[k][i] == 0 || codes[k][i] == 1));
      assert_true(k % 2 == 0 || codes[k][i] == 1 - codes[k - 1][i]);
    }
  }
  for (int i = 0; i < WIDTH * HEIGHT; i++) {
    for (int j = 0; j < i; j++) {
      int differ = 0, distance = abs(i % WIDTH - j % WIDTH) + abs(i / WIDTH - j / WIDTH);
      for (int k = 0; k < PICTURES; k += 2) {
        differ += codes[k][i] != codes[k][j];
      }
      assert_true(distance == 1 ? differ == 1 : differ >= 1);
    }
  }
  assert_ok(clt_gray_init_counted(&gray, 1280, 720, 44, &error), error);
  assert_int_equal(gray.bits[1], 11);
  assert_int_equal(clt_gray_init_counted(&gray, 1280, 720, 43, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_gray_init(&gray, 1, 720, &error), CLT_BAD_INPUT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_replayed_measurement_gives_the_same_map),
      cmocka_unit_test(stopping_and_other_panels_end_it),
      cmocka_unit_test(darkness_is_a_finding),
      cmocka_unit_test(a_map_of_holes_is_a_finding),
      cmocka_unit_test(pictures_are_a_gray_code),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
