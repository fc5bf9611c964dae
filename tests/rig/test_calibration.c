/* Calibration as a whole, on a camera with pixels of its own and everything on: against what is true of the room, to
 * and from its file, and as the geometry of a rig. */
#include "counterlight/calibration.h"

#include "rig/calibration.h"
#include "rig/internal.h"
#include "rough_room.h"

enum { GRID_WIDTH = 32, GRID_HEIGHT = 24, PIXELS_WIDTH = 240, PIXELS_HEIGHT = 180 };

/* Two walls seen from beside through a bending lens. */
static void open_room(rough_room *room, unsigned seed) {
  char text[2400];
  snprintf(
      text, sizeof text,
      "seed = %u; grid = { width = %d; height = %d; channels = 3; rays = 3; }; "
      "projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.4, 0.3]; "
      "intensity = 40.0; response = \"gamma 2.2\"; latency_ms = 37; jitter_ms = 2; bits = 10; " ROUGH_PANEL "}; "
      "camera = { pixels = [%d, %d]; position = [0.75, -3.1, 0.35]; target = [-0.08, 0.0, -0.05]; "
      "tangent = [0.46, 0.345]; distortion = [-0.12, 0.02, 0.0005, -0.0004, 0.0]; response = \"gamma 1.8\"; "
      "exposure_delay_frames = 2; }; " ROUGH_LIGHT "materials = ( { name = \"m\"; albedo = [0.7, 0.6, 0.5]; } ); "
      "surfaces = ( { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"m\"; }, "
      "{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"m\"; } );",
      seed, GRID_WIDTH, GRID_HEIGHT, PIXELS_WIDTH, PIXELS_HEIGHT);
  rough_open_text(room, text);
}

/* What the progress said: of each phase the first estimate, and the last count. */
typedef struct witness {
  int phases, first_total[4], last_done[4], last_total[4];
} witness;

static bool bear_witness(void *context, const char *phase, int done, int total) {
  static const char *const phases[] = {"latency", "photometry", "structured light"};
  witness *self = context;
  if (done == 0) {
    assert_true(total == 0 && self->phases < 3);
    self->phases++;
    return true;
  }
  const int at = self->phases - 1;
  assert_string_equal(phase, phases[at]);
  assert_true(done == self->last_done[at] + 1 && done <= total);
  self->first_total[at] = done == 1 ? total : self->first_total[at];
  self->last_done[at] = done;
  self->last_total[at] = total;
  return true;
}

static clt_calibration *calibrate(const rough_room *room) {
  clt_calibration *made = NULL;
  clt_error error = {0};
  witness seen = {.phases = 0};
  const clt_calibrate_options options = {.watch_s = 4, .timeout_s = 5, .progress = bear_witness, .context = &seen};
  assert_ok(clt_calibrate(room->projector, room->camera, &options, "a rough room", &made, &error), error);
  assert_int_equal(seen.phases, 3);
  for (int k = 0; k < 3; k++) {
    printf("%d of %d, at first %d; ", seen.last_done[k], seen.last_total[k], seen.first_total[k]);
    assert_true(seen.last_total[k] - seen.last_done[k] <= 5);
    assert_near(seen.first_total[k], seen.last_done[k], 0.25 * seen.last_done[k]);
  }
  return made;
}

static int compare_numbers(const void *left, const void *right) {
  double a = *(const double *)left, b = *(const double *)right;
  return (a > b) - (a < b);
}

/* The map as it truly is. */
static clt_pixel_map true_map(const rough_room *room) {
  clt_image truth = {0};
  clt_pixel_map map = {0};
  clt_error error = {0};
  size_t pixels = PIXELS_WIDTH * PIXELS_HEIGHT;
  assert_ok(clt_scene_pixel_map(room->scene, &truth, &error), error);
  assert_ok(clt_pixel_map_init(&map, PIXELS_WIDTH, PIXELS_HEIGHT, GRID_WIDTH, GRID_HEIGHT, &error), error);
  for (size_t i = 0; i < pixels; i++) {
    bool lit = truth.data[2 * pixels + i] == 1.0f;
    map.fate[i] = lit ? CLT_PIXEL_DECODED : CLT_PIXEL_UNLIT;
    map.x[i] = truth.data[i];
    map.y[i] = truth.data[pixels + i];
    map.confidence[i] = lit ? 1 : 0;
  }
  clt_image_finish(&truth);
  return map;
}

static bool lit_beside(const clt_pixel_map *truth, int x, int y) {
  for (int k = 0; k < 9; k++) {
    int u = x + k % 3 - 1, v = y + k / 3 - 1;
    if (u >= 0 && u < truth->width && v >= 0 && v < truth->height &&
        truth->fate[v * truth->width + u] == CLT_PIXEL_DECODED) {
      return true;
    }
  }
  return false;
}

/* Distances of decoded pixels from where they truly look, panel pixels. A pixel whose middle lies just beyond the
 * picture is half lit, and may be decoded; and so may a few farther out, where walls meet and light each other. */
static void check_map(const clt_pixel_map *map, const clt_pixel_map *truth) {
  size_t pixels = PIXELS_WIDTH * PIXELS_HEIGHT, count = 0, lit = 0, beyond = 0;
  double *away = calloc(pixels, sizeof *away);
  assert_non_null(away);
  for (size_t i = 0; i < pixels; i++) {
    bool seen = truth->fate[i] == CLT_PIXEL_DECODED, decoded = map->fate[i] == CLT_PIXEL_DECODED;
    lit += seen;
    beyond += decoded && !lit_beside(truth, (int)(i % PIXELS_WIDTH), (int)(i / PIXELS_WIDTH));
    if (decoded && seen) {
      away[count++] = hypot((double)map->x[i] - (double)truth->x[i], (double)map->y[i] - (double)truth->y[i]);
    }
  }
  qsort(away, count, sizeof *away, compare_numbers);
  printf("%zu of %zu lit pixels decoded; off by %.3f panel pixels (median), %.3f (99 %%)\n", count, lit,
         away[count / 2], away[count * 99 / 100]);
  assert_true((double)count > 0.95 * (double)lit);
  assert_true(away[count / 2] < 0.05 && beyond < count / 200);
  free(away);
}

static void centroid(const clt_footprints *footprints, size_t cell, double at[2]) {
  double whole = 0;
  at[0] = at[1] = 0;
  for (int64_t k = footprints->start[cell]; k < footprints->start[cell + 1]; k++) {
    double weight = footprints->weight != NULL ? (double)footprints->weight[k] : 1;
    at[0] += weight * (footprints->pixel[k] % PIXELS_WIDTH);
    at[1] += weight * (footprints->pixel[k] / PIXELS_WIDTH);
    whole += weight;
  }
  at[0] /= whole;
  at[1] /= whole;
}

/* Distances of footprints' centroids from the true ones, camera pixels. Cells at the picture's edge also have pixels
 * that are half lit. */
static void check_footprints(const clt_calibration *made, const clt_pixel_map *truth) {
  clt_footprints found = {0}, real = {0};
  clt_footprint_report report;
  clt_error error = {0};
  double away[GRID_WIDTH * GRID_HEIGHT];
  size_t count = 0, seen = 0;
  assert_ok(clt_footprints_map(&made->map, made->info.pitch, GRID_WIDTH, GRID_HEIGHT, &found, NULL, &report, &error),
            error);
  assert_ok(clt_footprints_map(truth, made->info.pitch, GRID_WIDTH, GRID_HEIGHT, &real, NULL, &report, &error), error);
  for (size_t i = 0; i < GRID_WIDTH * GRID_HEIGHT; i++) {
    double a[2], b[2];
    int x = (int)i % GRID_WIDTH, y = (int)i / GRID_WIDTH;
    bool inner = x > 0 && y > 0 && x < GRID_WIDTH - 1 && y < GRID_HEIGHT - 1;
    seen += found.start[i + 1] > found.start[i];
    if (inner && found.start[i + 1] > found.start[i] && real.start[i + 1] > real.start[i]) {
      centroid(&found, i, a);
      centroid(&real, i, b);
      away[count++] = hypot(a[0] - b[0], a[1] - b[1]);
    }
  }
  qsort(away, count, sizeof *away, compare_numbers);
  printf("%zu footprints; centroids off by %.3f camera pixels (median), %.3f (90 %%), %.3f (99 %%)\n", count,
         away[count / 2], away[count * 9 / 10], away[count * 99 / 100]);
  assert_true(seen > GRID_WIDTH * GRID_HEIGHT * 98 / 100);
  assert_true(away[count / 2] < 0.1 && away[count * 9 / 10] < 0.2);
  clt_footprints_finish(&found);
  clt_footprints_finish(&real);
}

static void check_curve(const clt_curve *found, const char *text) {
  clt_curve truth;
  assert_int_equal(clt_curve_parse(text, &truth, NULL), CLT_OK);
  for (int k = 0; k <= 100; k++) {
    assert_near(clt_curve_decode(found, k / 100.0), clt_curve_decode(&truth, k / 100.0), 0.005);
  }
}

static void check_values(const clt_calibration *made) {
  clt_calibration_info info = clt_calibration_describe(made);
  bool serious = false;
  for (int c = 0; c < 3; c++) {
    check_curve(&info.panel.response[c], "gamma 2.2");
    for (int k = 0; k < 3; k++) {
      assert_near(info.panel.crosstalk[c][k], rough_crosstalk[c][k], 0.005);
    }
  }
  check_curve(&info.camera, "gamma 1.8");
  assert_near(info.latency_s, 0.037, 0.017);
  assert_true(info.complete_s > info.latency_s && info.complete_s < info.latency_s + 0.05);
  assert_true(info.exposure_count >= 1 && info.covered > 0.95);
  for (int k = 0; clt_calibration_finding(made, k, &serious) != NULL; k++) {
    printf("finding: %s\n", clt_calibration_finding(made, k, &serious));
    assert_false(serious);
  }
}

/* Every value of a loaded calibration is that which was saved. */
static void check_same(const clt_calibration *a, const clt_calibration *b) {
  size_t pixels = PIXELS_WIDTH * PIXELS_HEIGHT;
  assert_memory_equal(a->map.x, b->map.x, pixels * sizeof(float));
  assert_memory_equal(a->map.y, b->map.y, pixels * sizeof(float));
  assert_memory_equal(a->map.confidence, b->map.confidence, pixels * sizeof(float));
  assert_memory_equal(a->map.fate, b->map.fate, pixels);
  for (int k = 0; k <= 256; k++) {
    assert_near(clt_curve_decode(&a->info.camera, k / 256.0), clt_curve_decode(&b->info.camera, k / 256.0), 1e-12);
    assert_near(clt_curve_decode(&a->info.panel.response[1], k / 256.0),
                clt_curve_decode(&b->info.panel.response[1], k / 256.0), 1e-12);
  }
  for (int k = 0; k < 9; k++) {
    assert_near(a->info.panel.crosstalk[k / 3][k % 3], b->info.panel.crosstalk[k / 3][k % 3], 1e-15);
  }
  assert_memory_equal(a->info.exposures_s, b->info.exposures_s, sizeof a->info.exposures_s);
  assert_int_equal(a->info.decoded, b->info.decoded);
  assert_true(a->info.latency_s == b->info.latency_s && a->info.complete_s == b->info.complete_s);
  assert_true(a->info.full_well == b->info.full_well && a->info.pitch == b->info.pitch);
  assert_string_equal(a->info.source, b->info.source);
}

/* What the room really shows, without its drift and flicker, of a drive that a rig encodes by its panel. */
static void show(const rough_room *room, const clt_panel *panel, const clt_image *drive, clt_image *shown) {
  clt_curve curve;
  clt_error error = {0};
  float codes[3 * GRID_WIDTH * GRID_HEIGHT];
  clt_image light = {3, GRID_HEIGHT, GRID_WIDTH, codes};
  assert_int_equal(clt_curve_parse("gamma 2.2", &curve, NULL), CLT_OK);
  clt_panel_encode(panel, drive, 3, GRID_HEIGHT, GRID_WIDTH, codes);
  for (int k = 0; k < 3 * GRID_WIDTH * GRID_HEIGHT; k++) {
    codes[k] = (float)clt_curve_decode(&curve, rint(1023 * (double)codes[k]) / 1023);
  }
  assert_ok(clt_scene_appearance(room->scene, &light, shown, &error), error);
}

/* Means over footprints of what the camera sees are the light of the cells, but where walls of unlike brightness meet
 * in a cell, and for half-lit pixels at the picture's edge. */
static void check_rig(const rough_room *room, const clt_calibration *calibration) {
  clt_rig_config config;
  clt_rig *rig = NULL;
  clt_image drive = {0}, seen = {0}, deviation = {0}, truth = {0};
  clt_image *images[] = {&drive, &seen, &deviation, &truth};
  clt_error error = {0};
  size_t values = 3 * GRID_WIDTH * GRID_HEIGHT, count = 0;
  double off = 0, whole = 0;
  clt_scene_rig_config(room->scene, &config);
  clt_calibration_apply(calibration, &config);
  config.verify = true; /* exposures of cells with unlike pixels must not seem to contradict */
  assert_ok(clt_rig_open(&config, room->projector, room->camera, &rig, &error), error);
  for (int k = 0; k < 3; k++) {
    assert_ok(clt_image_init(images[k], 3, GRID_HEIGHT, GRID_WIDTH, &error), error);
  }
  for (size_t k = 0; k < values; k++) {
    drive.data[k] = (float)(0.5 + 0.3 * sin(0.35 * (double)(k % GRID_WIDTH)) * cos(0.01 * (double)k));
  }
  assert_ok(rig->operations->observe(rig, &drive, &seen, &deviation, &error), error);
  show(room, &config.projector, &drive, &truth);
  for (size_t i = 0; i < values; i++) {
    int x = (int)i % GRID_WIDTH, y = (int)i / GRID_WIDTH % GRID_HEIGHT;
    bool inner = x > 0 && y > 0 && x < GRID_WIDTH - 1 && y < GRID_HEIGHT - 1;
    count += isfinite(deviation.data[i]);
    if (inner && isfinite(deviation.data[i])) {
      off += pow((double)seen.data[i] - (double)truth.data[i], 2);
      whole += pow((double)truth.data[i], 2);
    }
  }
  assert_int_equal(((clt_camera_rig *)rig)->torn, 0);
  printf("%zu of %zu values seen, off by %.2f %%\n", count, values, 100 * sqrt(off / whole));
  assert_true(count > values * 95 / 100 && sqrt(off / whole) < 0.025);
  for (int k = 0; k < 4; k++) {
    clt_image_finish(images[k]);
  }
  rig->operations->close(rig);
}

static void a_room_is_calibrated(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 2; seed++) {
    rough_room room;
    clt_calibration *loaded = NULL;
    clt_error error = {0};
    char folder[64], path[96];
    open_room(&room, seed);
    clt_calibration *made = calibrate(&room);
    clt_pixel_map truth = true_map(&room);
    check_map(&made->map, &truth);
    check_footprints(made, &truth);
    clt_pixel_map_finish(&truth);
    check_values(made);
    test_folder(folder);
    snprintf(path, sizeof path, "%s/calibration.h5", folder);
    assert_ok(clt_calibration_save(made, path, &error), error);
    assert_ok(clt_calibration_load(path, &loaded, &error), error);
    check_same(made, loaded);
    check_rig(&room, loaded);
    unlink(path);
    rmdir(folder);
    clt_calibration_destroy(made);
    clt_calibration_destroy(loaded);
    rough_close(&room);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_room_is_calibrated)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
