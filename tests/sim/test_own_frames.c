/* Frames of a camera with pixels of its own. */
#include <omp.h>

#include "counterlight/rig.h"
#include "rig_pair.h"
#include "sim/state.h"

/* libconfig 1.5 leaks the texts of a file that is refused; the leak sanitizer asks for what to ignore. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) {
  return "leak:libconfig";
}

#define GRID "grid = { width = 8; height = 6; channels = 3; rays = 4; }; "
#define PANEL "response = \"linear\"; bits = 16; tangent = [0.4, 0.3]; "
#define EXACT "bits = 16; photon_noise = false; read_noise = 0.0; black_level = 0; responsivity = 8.0; "
#define WHITE "materials = ( { name = \"white\"; albedo = [0.7, 0.6, 0.5]; }, { name = \"black\"; albedo = 0.0; } ); "
#define WALL "{ corner = [-2, 0, -2]; u = [4, 0, 0]; v = [0, 0, 4]; material = \"white\"; }"
/* Stands half way to the projector: its shadow on the wall is twice as large. */
#define SCREEN "{ corner = [-0.2, -1.5, -0.15]; u = [0.4, 0.0, 0.0]; v = [0.0, 0.0, 0.3]; material = \"black\"; }"
#define FOLD                                                                                                           \
  "{ corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"white\"; }, "             \
  "{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"white\"; }"
enum { WIDTH = 8, HEIGHT = 6, CELLS = 48, VALUES = 144, SETTLED = 50000000 };

static rig_pair open_scene(const char *panel, const char *camera, const char *settings, const char *surfaces) {
  char text[2000];
  snprintf(text, sizeof text, GRID WHITE "projector = { " PANEL "%s }; camera = { %s }; %s surfaces = ( %s );", panel,
           camera, settings, surfaces);
  room made;
  room_make(&made, text);
  rig_pair pair = pair_of(room_open(&made));
  room_remove(&made);
  return pair;
}

static void make_codes(float *codes, int seed) {
  for (int k = 0; k < VALUES; k++) {
    codes[k] = (float)((k + 3) * (seed + 7) % 23) / 23.0f;
  }
}

/* Radiance that a sample stands for, of EXACT. */
static double pixel_of(const clt_frame *frame, int x, int y, int channel) {
  return frame->samples[(y * frame->width + x) * frame->channels + channel] / 65535.0 / (8.0 * frame->exposure_s);
}
static const double STEP = 60.0 / 8.0 / 65535.0; /* of radiance, in a frame of 1/60 s */

/* Frames under a few patterns, some over a change of pattern. */
static void record(rig_pair *pair, uint16_t *samples, size_t each) {
  float codes[VALUES];
  for (int n = 0; n < 4; n++) {
    make_codes(codes, n);
    clt_frame frame = pair_frame(pair, pair_show(pair, codes) + n * 10000000);
    assert_int_equal((size_t)frame.width * (size_t)frame.height * (size_t)frame.channels, each);
    memcpy(&samples[(size_t)n * each], frame.samples, each * sizeof *samples);
  }
}

typedef struct setting {
  const char *panel, *camera, *settings;
} setting;

static const setting settings_of[] = {
    {"", "", ""},
    {"", "lens_blur = 1.3; vignetting = 0.3; response = \"srgb\"; ", "flicker = { depth = 0.5; }; ambient = 0.1; "},
    {"defocus = 0.8; drift = { amplitude = 0.3; period_s = 10.0; }; ", "line_us = 700.0; ",
     "change = { at_s = 0.1; cells = [2, 1, 3, 4]; factor = [0.5, 1.0, 2.0]; }; flicker = { depth = 0.9; }; "},
    {"", "faults = { dropped = 0.2; stuck = 0.3; }; ",
     "vibration = { amplitude = [0.8, 0.5]; hz = 31.0; }; subsurface = { share = 0.5; radius = 1.0; }; "},
};

/* Where the projector stands, with k x k pixels a cell, a camera with pixels of its own gives the frames of one whose
 * pixels are the grid's, bit by bit: noise, and every effect on light, time and pixels included. */
static void at_the_projector_as_before(void **state) {
  (void)state;
  enum { SAMPLES = 24 * 18 * 3 };
  static uint16_t grid[4 * SAMPLES], own[4 * SAMPLES];
  for (size_t k = 0; k < sizeof settings_of / sizeof settings_of[0]; k++) {
    char camera[300];
    snprintf(camera, sizeof camera, "cell_pixels = 3; %s", settings_of[k].camera);
    rig_pair pair = open_scene(settings_of[k].panel, camera, settings_of[k].settings, FOLD);
    record(&pair, grid, SAMPLES);
    pair_close(&pair);
    snprintf(camera, sizeof camera, "pixels = [24, 18]; %s", settings_of[k].camera);
    pair = open_scene(settings_of[k].panel, camera, settings_of[k].settings, FOLD);
    record(&pair, own, SAMPLES);
    pair_close(&pair);
    assert_memory_equal(grid, own, sizeof grid);
  }
}

/* Pixels that divide no cell evenly still share out the light of each one exactly: the mean over the image is the mean
 * over the cells, of every pattern. */
static void energy(void **state) {
  (void)state;
  rig_pair pair = open_scene("", "pixels = [37, 27]; rays = 8; " EXACT, "", WALL);
  for (int n = 0; n < 3; n++) {
    clt_image drive, radiance;
    clt_error error = {.status = CLT_OK};
    assert_ok(clt_image_init(&drive, 3, HEIGHT, WIDTH, &error), error);
    make_codes(drive.data, n);
    for (int k = 0; k < VALUES; k++) {
      drive.data[k] = (float)(rint(65535.0 * (double)drive.data[k]) / 65535.0);
    }
    assert_ok(clt_scene_appearance(pair.scene, &drive, &radiance, &error), error);
    clt_frame frame = pair_frame(&pair, pair_show(&pair, drive.data) + SETTLED);
    for (int c = 0; c < 3; c++) {
      double cells = 0.0, pixels = 0.0;
      for (int i = 0; i < CELLS; i++) {
        cells += (double)radiance.data[c * CELLS + i] / CELLS;
      }
      for (int k = 0; k < 37 * 27; k++) {
        pixels += pixel_of(&frame, k % 37, k / 37, c) / (37 * 27);
      }
      assert_near(pixels, cells, 0.1 * STEP); /* roundings of 999 samples */
    }
    clt_image_finish(&drive);
    clt_image_finish(&radiance);
  }
  pair_close(&pair);
}

#define ASIDE "position = [0.05, -1.4, 0.02]; target = [0.05, 0.0, 0.02]; tangent = [1.1, 0.8]; "

/* Before a screen: where the projector does not reach the wall, there is the ambient light alone, without the leak of
 * a black panel; elsewhere the cell's radiance, by plain geometry; beside the wall nothing. */
static void shadow_shows_ambient_light(void **state) {
  (void)state;
  rig_pair pair =
      open_scene("black = 0.01; ", "pixels = [60, 44]; " ASIDE EXACT, "ambient = [0.05, 0.1, 0.2]; ", WALL ", " SCREEN);
  const double ambient[3] = {0.05, 0.1, 0.2};
  clt_image drive, radiance;
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_image_init(&drive, 3, HEIGHT, WIDTH, &error), error);
  for (int k = 0; k < VALUES; k++) {
    drive.data[k] = (float)((k * 11 % 17) / 17) + 0.25f;
  }
  for (int k = 0; k < VALUES; k++) {
    drive.data[k] = (float)(rint(65535.0 * (double)drive.data[k]) / 65535.0);
  }
  assert_ok(clt_scene_appearance(pair.scene, &drive, &radiance, &error), error);
  clt_frame frame = pair_frame(&pair, pair_show(&pair, drive.data) + SETTLED);
  int lit = 0, dark = 0;
  for (int k = 0; k < 60 * 44; k++) {
    double x = 0.05 + 1.4 * 1.1 * ((2.0 * (k % 60) + 1) / 60 - 1),
           z = 0.02 + 1.4 * 0.8 * (1 - (2.0 * (k / 60) + 1) / 44);
    double column = WIDTH * 0.5 * (1 + x / 1.2), row = HEIGHT * 0.5 * (1 - z / 0.9), margin = 0.3; /* > a pixel */
    bool shadow = fabs(x) < 0.4 - 0.06 && fabs(z)<0.3 - 0.06, clear = fabs(x)> 0.46 || fabs(z) > 0.36;
    bool inside = fabs(x) < 1.2 - 0.06 && fabs(z)<0.9 - 0.06, outside = fabs(x)> 1.26 || fabs(z) > 0.96;
    bool in_cell = fabs(column - floor(column) - 0.5) < 0.5 - margin && fabs(row - floor(row) - 0.5) < 0.5 - margin;
    for (int c = 0; c < 3; c++) {
      if (shadow || outside) {
        assert_near(pixel_of(&frame, k % 60, k / 60, c), ambient[c], STEP);
        dark++;
      } else if (clear && inside && in_cell) {
        double cell = (double)radiance.data[c * CELLS + (int)row * WIDTH + (int)column];
        assert_near(pixel_of(&frame, k % 60, k / 60, c), cell, STEP);
        lit++;
      }
    }
  }
  assert_true(lit > 500 && dark > 500);
  clt_image_finish(&drive);
  clt_image_finish(&radiance);
  pair_close(&pair);
}

/* In a shadow on a wall that other walls light the picture may not be seen: the cell beside it, brought from dark to
 * full, changes what is seen there by no more than what comes back to that cell, while what the whole picture sends
 * there is its indirect light, y - F x. */
static void shadow_shows_indirect_light(void **state) {
  (void)state;
  const char *board = FOLD ", { corner = [0.3, -1.1, -0.4]; u = [0.3, 0.0, 0.0]; v = [0.0, 0.0, 0.5]; "
                           "material = \"black\"; }";
  rig_pair pair = open_scene("black = 0.0; ",
                             "pixels = [48, 36]; position = [0.7, -2.9, 0.2]; target = [0.1, 0.0, 0.0]; "
                             "tangent = [0.5, 0.4]; " EXACT,
                             "ambient = 0.0; ", board);
  const clt_view *view = &pair.scene->view;
  int pixel = -1, cell = -1;
  for (int k = 0; k < 48 * 36 && pixel < 0; k++) { /* the first that lies wholly in a shadow of the right wall */
    double column = k % 48 + 0.5, row = k / 48 + 0.5;
    int first = view->pixels.start[k];
    if (column > 20 && row > 10 && row < 26 && view->pixels.start[k + 1] == first + 1 &&
        view->pixels.element[first] >= VALUES) {
      cell = view->pixels.element[first] - VALUES;
      pixel = k;
    }
  }
  assert_true(pixel >= 0);
  float codes[VALUES];
  double seen[2], diagonal[CELLS], unit[CELLS], row[CELLS];
  for (int bright = 0; bright < 2; bright++) {
    for (int k = 0; k < VALUES; k++) {
      codes[k] = k % CELLS == cell ? (float)bright : 1.0f;
    }
    clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
    seen[bright] = pixel_of(&frame, pixel % 48, pixel / 48, 0);
  }
  const clt_transport *transport = clt_scene_transport(pair.scene);
  clt_transport_diagonal(transport, 0, diagonal);
  for (int j = 0; j < CELLS; j++) {
    unit[j] = j != cell;
  }
  clt_transport_apply(transport, 0, unit, row);
  assert_true(row[cell] > 100 * STEP);
  assert_near(seen[0], row[cell], STEP);
  double own = seen[1] - seen[0];
  assert_true(own > -STEP && own < 0.05 * diagonal[cell]);
  pair_close(&pair);
}

/* Each row of pixels sees its own time, wherever its cells are: over a change of pattern at a known time the row's
 * share of each, in closed form. The camera lies on its side, so that a row sees a column of cells. */
static void rolling_shutter(void **state) {
  (void)state;
  rig_pair pair = open_scene("black = 0.0; latency_ms = 30.0; ",
                             "pixels = [30, 40]; position = [0.0, -3.0, 0.0]; target = [0.0, 0.0, 0.0]; "
                             "up = [1.0, 0.0, 0.0]; tangent = [0.3, 0.4]; line_us = 400.0; " EXACT,
                             "ambient = 0.0; ", WALL);
  float codes[VALUES];
  for (int k = 0; k < VALUES; k++) {
    codes[k] = 0.25f;
  }
  clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
  double steady[40];
  for (int y = 0; y < 40; y++) {
    steady[y] = pixel_of(&frame, 15, y, 1);
  }
  for (int k = 0; k < VALUES; k++) {
    codes[k] = 0.75f;
  }
  double lit = 1e-9 * (double)pair_show(&pair, codes) + 0.030;
  int before = 0, over = 0, after = 0;
  for (int n = 0; n < 5; n++) {
    frame = pair_frame(&pair, 0);
    for (int y = 0; y < 40; y++) {
      double start = 1e-9 * (double)frame.exposed_ns + 400e-6 * y, end = start + frame.exposure_s;
      double share = fmin(1.0, fmax(0.0, (end - lit) / (end - start)));
      assert_near(pixel_of(&frame, 15, y, 1), steady[y] * (1.0 + 2.0 * share), 4 * STEP);
      before += share <= 0.0;
      over += share > 0.0 && share < 1.0;
      after += share >= 1.0;
    }
  }
  assert_true(before > 10 && over > 20 && after > 10);
  pair_close(&pair);
}

/* The same seed, the same frames for any number of threads. */
static void any_number_of_threads(void **state) {
  (void)state;
  enum { SAMPLES = 200 * 150 * 3 };
  uint16_t *one = calloc(4 * SAMPLES, sizeof *one), *three = calloc(4 * SAMPLES, sizeof *three);
  uint16_t *const into[] = {one, three};
  int usual = omp_get_max_threads();
  for (int k = 0; k < 2; k++) {
    omp_set_num_threads(k == 0 ? 1 : 3);
    rig_pair pair = open_scene("", "pixels = [200, 150]; distortion = [-0.2, 0.05, 0.001, -0.002, 0.0]; " ASIDE, "",
                               FOLD ", " SCREEN);
    record(&pair, into[k], SAMPLES);
    pair_close(&pair);
  }
  omp_set_num_threads(usual);
  assert_memory_equal(one, three, 4 * SAMPLES * sizeof *one);
  free(one);
  free(three);
}

/* The public map is the trace of the pixels' middles, NaN where they are not lit; a camera without pixels of its own
 * has none, and a rig takes none that has. */
static void map_and_rig(void **state) {
  (void)state;
  rig_pair pair = open_scene("", "pixels = [60, 45]; " ASIDE, "", WALL ", " SCREEN);
  clt_image map;
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_scene_pixel_map(pair.scene, &map, &error), error);
  assert_int_equal(map.channels * 10000 + map.height * 100 + map.width, 30000 + 4500 + 60);
  for (int k = 0; k < 60 * 45; k++) {
    double x = 0.05 + 1.4 * 1.1 * ((2.0 * (k % 60) + 1) / 60 - 1),
           z = 0.02 + 1.4 * 0.8 * (1 - (2.0 * (k / 60) + 1) / 45);
    float fate = map.data[2 * 60 * 45 + k];
    bool shadow = fabs(x) < 0.4 && fabs(z)<0.3, outside = fabs(x)> 1.2 || fabs(z) > 0.9;
    assert_near(fate, outside ? 3.0 : shadow ? 2.0 : 1.0, 0.0);
    if (fate == 1.0f) {
      assert_near(map.data[k], WIDTH * 0.5 * (1 + x / 1.2), 1e-5);
      assert_near(map.data[60 * 45 + k], HEIGHT * 0.5 * (1 - z / 0.9), 1e-5);
    } else {
      assert_true(isnan(map.data[k]) && isnan(map.data[60 * 45 + k]));
    }
  }
  clt_image_finish(&map);
  clt_rig_config config;
  clt_rig *rig = NULL;
  clt_scene_rig_config(pair.scene, &config);
  assert_int_equal(clt_rig_open(&config, pair.projector, pair.camera, &rig, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "this camera has pixels of its own: calibrate first"));
  clt_pixels_report report;
  assert_ok(clt_scene_pixels(pair.scene, &report, &error), error);
  assert_true(report.own && report.bytes > 60 * 45 * 4 && report.frame_ms > 0.0);
  assert_near(report.lit + report.shadowed + report.outside + report.nothing, 1.0, 1e-12);
  assert_near(report.shadowed, 0.8 * 0.6 / (4 * 1.54 * 1.12), 0.02);
  pair_close(&pair);
  pair = open_scene("", "", "", WALL);
  assert_int_equal(clt_scene_pixel_map(pair.scene, &map, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "pixels = [width, height]"));
  assert_ok(clt_scene_pixels(pair.scene, &report, &error), error);
  assert_false(report.own);
  pair_close(&pair);
}

/* A camera's keys that are refused, and what the message says. */
typedef struct refusal {
  const char *camera, *key, *why;
} refusal;

static const refusal refusals[] = {
    {"pixels = [320];", "pixels", "legal is 2 to 2"},
    {"pixels = [0, 240];", "pixels", "legal is 1 to 4096"},
    {"pixels = [320.5, 240.0];", "pixels", "whole number"},
    {"pixels = [4096, 2048];", "pixels", "at most 4194304"},
    {"pixels = [32, 24]; cell_pixels = 2;", "cell_pixels", "nothing beside pixels"},
    {"pixels = [32, 24]; rays = 17;", "rays", "legal is 1 to 16"},
    {"pixels = [32, 24]; distortion = [0.1, 0.2];", "distortion", "legal is 5 to 5"},
    {"pixels = [32, 24]; distortion = [1000.0, 0.0, 0.0, 0.0, 0.0];", "distortion", "legal is -100 to 100"},
    {"pixels = [32, 24]; distortion = [-4.0, 0.0, 0.0, 0.0, 0.0];", "distortion", "folds its image"},
    {"pixels = [32, 24]; up = [0, 0, 1];", "camera", "needs position and target"},
    {"pixels = [32, 24]; position = [0, -2, 0]; target = [0, -9, 0];", "camera", "sees nothing"},
    {"distortion = [0.1, 0.0, 0.0, 0.0, 0.0];", "distortion", "nothing without pixels"},
    {"rays = 2;", "rays", "nothing without pixels"},
};

static void mistakes_are_refused(void **state) {
  (void)state;
  for (size_t k = 0; k < sizeof refusals / sizeof refusals[0]; k++) {
    char text[1000];
    room made;
    clt_scene *scene = NULL;
    clt_error error = {.status = CLT_OK};
    snprintf(text, sizeof text, GRID WHITE "surfaces = ( " WALL " );\ncamera = { %s };", refusals[k].camera);
    room_make(&made, text);
    clt_status status = clt_scene_open(made.scene_path, &scene, &error);
    room_remove(&made);
    if (status != CLT_BAD_INPUT || strstr(error.message, refusals[k].key) == NULL ||
        strstr(error.message, refusals[k].why) == NULL || strstr(error.message, "scene.cfg:2") == NULL) {
      fail_msg("%s gave %s: %s", refusals[k].camera, clt_status_name(status), error.message);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(at_the_projector_as_before),
      cmocka_unit_test(energy),
      cmocka_unit_test(shadow_shows_ambient_light),
      cmocka_unit_test(shadow_shows_indirect_light),
      cmocka_unit_test(rolling_shutter),
      cmocka_unit_test(any_number_of_threads),
      cmocka_unit_test(map_and_rig),
      cmocka_unit_test(mistakes_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
