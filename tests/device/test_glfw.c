/* The projector on Xvfb: what stands on the glass is the pattern, read back by GL and from the screen. There the
 * processor paints by itself where the server shares memory; where it does not, and at 10 bits, GL draws. */
#include "device/projector/glfw.h"

#include <epoxy/gl.h>

#include "base/clock.h"
#include "display.h"

/* Steps of a panel and a picture that has all of them. */
static void draw_levels(int width, int height, int full, uint64_t seed, float *codes, uint16_t *steps) {
  size_t plane = (size_t)width * (size_t)height;
  for (size_t i = 0; i < plane; i++) {
    for (size_t c = 0; c < 3; c++) {
      size_t level =
          i < (size_t)full + 1 ? (i + c * 37) % ((size_t)full + 1) : (size_t)(test_random(&seed) * (full + 1));
      /* off the step by less than half of one */
      double off = 0.98 * (test_random(&seed) - 0.5);
      codes[c * plane + i] = (float)(((double)level + off) / full);
      steps[i * 3 + c] = (uint16_t)level;
    }
  }
}

static clt_projector *open_projector(int width, int height, bool window) {
  clt_projector_config config = {
      .driver = "glfw", .monitor = "auto", .width = width, .height = height, .window = window};
  clt_projector *projector = NULL;
  clt_error error = {0};
  assert_ok(clt_glfw_open_projector(&config, &projector, &error), error);
  return projector;
}

/* What was drawn, row 0 at the top, in its own steps. Mesa's software drawing copies it to the screen at a swap, and
 * keeps it. */
static void read_drawn(int width, int height, int full, uint16_t *out) {
  float *pixels = malloc((size_t)width * (size_t)height * 3 * sizeof *pixels);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadBuffer(GL_BACK);
  glReadPixels(0, 0, width, height, GL_RGB, GL_FLOAT, pixels);
  for (int y = 0; y < height; y++) {
    for (int i = 0; i < 3 * width; i++) {
      double value = pixels[(size_t)(height - 1 - y) * 3 * (size_t)width + (size_t)i] * full;
      out[(size_t)y * 3 * (size_t)width + (size_t)i] = (uint16_t)lround(value);
    }
  }
  free(pixels);
}

static void assert_steps(const char *read_by, const uint16_t *got, const uint16_t *wanted, int width, int height) {
  for (int i = 0; i < 3 * width * height; i++) {
    if (got[i] != wanted[i]) {
      fail_msg("%s: pixel %d,%d channel %d is %d, not %d", read_by, i / 3 % width, i / 3 / width, i % 3, got[i],
               wanted[i]);
    }
  }
}

/* On a screen of that size and depth, drawn by GL or painted. */
static void check_levels(int width, int height, int depth, bool drawn) {
  test_display display = {0};
  char screen[32];
  clt_error error = {0};
  clt_projector_info info;
  int64_t shown_ns = 0;
  snprintf(screen, sizeof screen, "%dx%dx%d", width, height, depth);
  assert_true(drawn ? test_display_unshared(screen, &display) : test_display_xvfb(screen, &display));
  clt_projector *projector = open_projector(0, 0, false);
  projector->driver->describe(projector, &info);
  assert_int_equal(info.width, width);
  assert_int_equal(info.height, height);
  assert_int_equal(info.bits, depth / 3);
  assert_int_equal(info.channels, 3);
  assert_near(info.refresh_s, 1 / 60.0, 1e-9);
  assert_true(info.waits);
  size_t values = (size_t)width * (size_t)height * 3;
  float *codes = malloc(values * sizeof *codes);
  uint16_t *steps = malloc(values * sizeof *steps), *got = malloc(values * sizeof *got);
  for (uint64_t seed = 1; seed <= 3; seed++) {
    draw_levels(width, height, (1 << info.bits) - 1, seed, codes, steps);
    assert_ok(projector->driver->present(projector, codes, &shown_ns, &error), error);
    if (drawn) {
      read_drawn(width, height, (1 << info.bits) - 1, got);
      assert_steps("glReadPixels", got, steps, width, height);
    }
    test_display_grab(&display, 0, 0, width, height, got);
    assert_steps("XGetImage", got, steps, width, height);
  }
  projector->driver->close(projector);
  free(codes);
  free(steps);
  free(got);
  test_display_stop(&display);
}

static void test_levels(void **state) {
  (void)state;
  for (int drawn = 0; drawn < 2; drawn++) {
    check_levels(1280, 800, 24, drawn);
    check_levels(641, 359, 24, drawn);
    check_levels(64, 48, 24, drawn);
  }
}

static void test_ten_bits(void **state) {
  (void)state;
  check_levels(320, 200, 30, true);
}

/* A window on the desk has the size that was asked for, and its picture is as exact. */
static void test_window(void **state) {
  (void)state;
  enum { WIDTH = 200, HEIGHT = 120 };
  test_display display = {0};
  clt_error error = {0};
  clt_projector_info info;
  int64_t shown_ns;
  assert_true(test_display_xvfb("800x600x24", &display));
  clt_projector *projector = open_projector(WIDTH, HEIGHT, true);
  projector->driver->describe(projector, &info);
  assert_int_equal(info.width, WIDTH);
  assert_int_equal(info.height, HEIGHT);
  static float codes[WIDTH * HEIGHT * 3];
  static uint16_t steps[WIDTH * HEIGHT * 3], got[WIDTH * HEIGHT * 3];
  draw_levels(WIDTH, HEIGHT, 255, 4, codes, steps);
  assert_ok(projector->driver->present(projector, codes, &shown_ns, &error), error);
  test_display_grab(&display, 0, 0, WIDTH, HEIGHT, got);
  assert_steps("XGetImage", got, steps, WIDTH, HEIGHT);
  projector->driver->close(projector);
  test_display_stop(&display);
}

/* Xvfb's swaps do not wait: the clock paces. Every picture has a refresh of its own, which is not before the picture is
 * really there (present has returned by then, and the screen shows it). */
static void test_pace(void **state) {
  (void)state;
  enum { WIDTH = 160, HEIGHT = 120, FRAMES = 120 };
  test_display display = {0};
  clt_error error = {0};
  int64_t shown_ns = 0, before_ns = 0;
  static float codes[WIDTH * HEIGHT * 3];
  static uint16_t got[3];
  assert_true(test_display_xvfb("160x120x24", &display));
  clt_projector *projector = open_projector(0, 0, false);
  const double period_ns = 1e9 / 60;
  for (int frame = 0; frame < FRAMES; frame++) {
    int64_t start_ns = clt_clock_ns();
    codes[0] = (float)(frame % 256) / 255.0F;
    assert_ok(projector->driver->present(projector, codes, &shown_ns, &error), error);
    test_display_grab(&display, 0, 0, 1, 1, got);
    assert_int_equal(got[0], frame % 256);
    assert_true(shown_ns > start_ns);
    if (frame > 0) {
      double refreshes = (double)(shown_ns - before_ns) / period_ns;
      assert_near(refreshes, round(refreshes), 1e-6);
      assert_true(refreshes > 0.5);
    }
    before_ns = shown_ns;
  }
  projector->driver->close(projector);
  test_display_stop(&display);
}

/* The desktop's screen saver is off while a projector is open and as before afterwards; wrong names are refused with
 * those that there are; there is one projector at a time. */
static void test_manners(void **state) {
  (void)state;
  test_display display = {0};
  clt_error error = {0};
  int timeout = 0, interval, blanking, exposures;
  assert_true(test_display_xvfb("320x200x24", &display));
  XSetScreenSaver(display.x, 123, 0, DontPreferBlanking, DontAllowExposures);
  XSync(display.x, False);
  clt_projector *projector = open_projector(0, 0, false), *second = NULL;
  XGetScreenSaver(display.x, &timeout, &interval, &blanking, &exposures);
  assert_int_equal(timeout, 0);
  clt_projector_config config = {.monitor = "auto"};
  assert_int_equal(clt_glfw_open_projector(&config, &second, &error), CLT_BAD_INPUT);
  projector->driver->close(projector);
  XGetScreenSaver(display.x, &timeout, &interval, &blanking, &exposures);
  assert_int_equal(timeout, 123);
  strcpy(config.monitor, "HDMI-7");
  assert_int_equal(clt_glfw_open_projector(&config, &second, &error), CLT_GONE);
  assert_non_null(strstr(error.message, "no monitor \"HDMI-7\""));
  assert_non_null(strstr(error.message, "screen 320x200 at 0,0"));
  config = (clt_projector_config){.monitor = "auto", .width = 1000, .height = 700};
  assert_int_equal(clt_glfw_open_projector(&config, &second, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "320x200"));
  test_display_stop(&display);
  setenv("DISPLAY", ":9999", 1);
  assert_int_equal(clt_glfw_open_projector(&config, &second, &error), CLT_FAILED);
  assert_non_null(strstr(error.message, "no display"));
}

enum {
  LIVE_WIDTH = 160,
  LIVE_HEIGHT = 120,
  GRID_WIDTH = 8,
  GRID_HEIGHT = 6,
  LIVE_VALUES = 3 * LIVE_WIDTH * LIVE_HEIGHT
};

/* A screen, the projector on it, and a moving picture with what stands there of it. */
typedef struct live_stage {
  uint8_t content[LIVE_VALUES];
  float gain[3 * GRID_WIDTH * GRID_HEIGHT], offset[3 * GRID_WIDTH * GRID_HEIGHT];
  float codes[LIVE_VALUES]; /* 0..1, plane after plane, as the processor computes them */
  uint16_t got[LIVE_VALUES];
  test_display display;
  clt_projector *projector;
} live_stage;

static live_stage *open_stage(bool drawn) {
  live_stage *stage = calloc(1, sizeof *stage);
  assert_non_null(stage);
  assert_true(drawn ? test_display_unshared("160x120x24", &stage->display)
                    : test_display_xvfb("160x120x24", &stage->display));
  stage->projector = open_projector(0, 0, false);
  return stage;
}

static void close_stage(live_stage *stage) {
  stage->projector->driver->close(stage->projector);
  test_display_stop(&stage->display);
  free(stage);
}

/* A moving picture of random content, correction, responses and crosstalk. */
static clt_live_picture draw_live(uint64_t seed, live_stage *stage) {
  static const double mixed[9] = {0.9, 0.08, 0.02, 0.05, 0.9, 0.05, 0.01, 0.09, 0.9};
  clt_error error = {0};
  clt_live_picture picture = {.width = LIVE_WIDTH,
                              .height = LIVE_HEIGHT,
                              .content = stage->content,
                              .grid_width = GRID_WIDTH,
                              .grid_height = GRID_HEIGHT,
                              .gain = stage->gain,
                              .offset = stage->offset};
  for (size_t i = 0; i < LIVE_VALUES; i++) {
    stage->content[i] = (uint8_t)(256 * test_random(&seed));
  }
  for (size_t i = 0; i < (size_t)3 * GRID_WIDTH * GRID_HEIGHT; i++) {
    stage->gain[i] = (float)(0.6 + 0.6 * test_random(&seed));
    stage->offset[i] = (float)(0.3 * test_random(&seed) - 0.15);
  }
  picture.panel = clt_panel_of_curve(&(clt_curve){.kind = CLT_CURVE_SRGB});
  picture.panel.response[1] = (clt_curve){.kind = CLT_CURVE_GAMMA, .gamma = 2.1};
  assert_ok(clt_panel_set_crosstalk(&picture.panel, mixed, &error), error);
  return picture;
}

static void encode_live(live_stage *stage, const clt_live_picture *picture) {
  clt_error error = {0};
  assert_ok(clt_live_encode(picture, 3, LIVE_HEIGHT, LIVE_WIDTH, stage->codes, &error), error);
}

static void show_live(live_stage *stage, const clt_live_picture *picture) {
  clt_error error = {0};
  int64_t shown_ns;
  assert_ok(stage->projector->driver->present_live(stage->projector, picture, &shown_ns, &error), error);
  test_display_grab(&stage->display, 0, 0, LIVE_WIDTH, LIVE_HEIGHT, stage->got);
}

/* By how much the i'th value on the screen, pixel after pixel, is off its code; of 255. */
static double off_by(const live_stage *stage, int i) {
  return (double)stage->got[i] - 255 * (double)stage->codes[i % 3 * LIVE_WIDTH * LIVE_HEIGHT + i / 3];
}

/* Drawn by the shader: every code is one of the two next to what the processor computes (test_live_encode has that in
 * double), and their mean over seeds comes to it. */
static void test_live(void **state) {
  (void)state;
  enum { SEEDS = 64 };
  static double mean[LIVE_VALUES];
  live_stage *stage = open_stage(true);
  clt_live_picture picture = draw_live(5, stage);
  encode_live(stage, &picture);
  for (picture.seed = 1; picture.seed <= SEEDS; picture.seed++) {
    show_live(stage, &picture);
    for (int i = 0; i < LIVE_VALUES; i++) {
      assert_true(fabs(off_by(stage, i)) < 1.05);
      mean[i] += off_by(stage, i) / SEEDS;
    }
  }
  double bias = 0, squares = 0;
  for (int i = 0; i < LIVE_VALUES; i++) {
    bias += mean[i] / LIVE_VALUES;
    squares += mean[i] * mean[i] / LIVE_VALUES;
  }
  assert_true(fabs(bias) < 0.01);
  assert_true(sqrt(squares) < 0.5 / sqrt(SEEDS) * 1.2); /* the deviation of one dithered code is at most a half */
  close_stage(stage);
}

/* Content of another size goes by a program of its own. Of one colour its light is the same however it is stretched. */
static void test_stretched(void **state) {
  (void)state;
  enum { SEEDS = 6 };
  live_stage *stage = open_stage(true);
  for (uint32_t seed = 1; seed <= SEEDS; seed++) {
    clt_live_picture picture = draw_live(seed, stage);
    picture.width = (int)(7 * seed);
    picture.height = (int)(50 / seed);
    picture.seed = seed;
    for (int i = 3; i < 3 * picture.width * picture.height; i++) {
      stage->content[i] = stage->content[i % 3];
    }
    encode_live(stage, &picture);
    show_live(stage, &picture);
    for (int i = 0; i < LIVE_VALUES; i++) {
      assert_true(fabs(off_by(stage, i)) < 1.05);
    }
  }
  close_stage(stage);
}

static long resident_kib(void) {
  FILE *file = fopen("/proc/self/statm", "r");
  long size, resident = 0;
  assert_int_equal(fscanf(file, "%ld %ld", &size, &resident), 2);
  fclose(file);
  return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

/* Painted by the processor: every code is exactly what clt_live_encode and clt_live_dither make of it, also of content
 * of another size. */
static void test_painted(void **state) {
  (void)state;
  enum { SEEDS = 12 };
  live_stage *stage = open_stage(false);
  for (uint32_t seed = 1; seed <= SEEDS; seed++) {
    clt_live_picture picture = draw_live(seed, stage);
    picture.width = seed % 3 == 0 ? (int)(7 * seed) : LIVE_WIDTH;
    picture.height = seed % 3 == 0 ? (int)(100 / seed) : LIVE_HEIGHT;
    picture.seed = seed;
    encode_live(stage, &picture);
    clt_live_dither(stage->codes, LIVE_VALUES, 8, seed);
    show_live(stage, &picture);
    for (int i = 0; i < LIVE_VALUES; i++) {
      assert_near(off_by(stage, i), 0, 1e-4);
    }
  }
  close_stage(stage);
}

/* The only window on a screen of the test's own gets another size, as from a person at the desk. */
static void resize_window(test_display *display, unsigned width, unsigned height) {
  Window root, parent, *windows = NULL;
  unsigned count = 0;
  assert_true(XQueryTree(display->x, DefaultRootWindow(display->x), &root, &parent, &windows, &count));
  XWindowAttributes about;
  for (unsigned i = 0; i < count; i++) {
    assert_true(XGetWindowAttributes(display->x, windows[i], &about));
    if (about.map_state == IsViewable) {
      XResizeWindow(display->x, windows[i], width, height);
    }
  }
  XFree(windows);
  XSync(display->x, False);
}

/* A window of another size than the panel is drawn by GL, which stretches, and painted again when it fits. */
static void test_resized(void **state) {
  (void)state;
  enum { WIDTH = 200, HEIGHT = 120, VALUES = 3 * WIDTH * HEIGHT };
  static const int sizes[][2] = {{WIDTH, HEIGHT}, {2 * WIDTH, 3 * HEIGHT}, {WIDTH, HEIGHT}};
  static float codes[VALUES];
  static uint16_t steps[VALUES], got[2 * 3 * VALUES];
  test_display display = {0};
  clt_error error = {0};
  int64_t shown_ns;
  assert_true(test_display_xvfb("800x600x24", &display));
  clt_projector *projector = open_projector(WIDTH, HEIGHT, true);
  for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
    const int width = sizes[k][0], height = sizes[k][1];
    draw_levels(WIDTH, HEIGHT, 255, k, codes, steps);
    resize_window(&display, (unsigned)width, (unsigned)height);
    for (int repeat = 0; repeat < 3; repeat++) {
      assert_ok(projector->driver->present(projector, codes, &shown_ns, &error), error);
    }
    test_display_grab(&display, 0, 0, width, height, got);
    for (int i = 0; i < 3 * width * height; i++) {
      const int x = i / 3 % width * WIDTH / width, y = i / 3 / width * HEIGHT / height;
      assert_int_equal(got[i], steps[3 * (y * WIDTH + x) + i % 3]);
    }
  }
  projector->driver->close(projector);
  test_display_stop(&display);
}

/* Pictures of both kinds one after another hold no more memory at the end than early on. */
static void check_memory(bool drawn, int frames) {
  enum { EARLY = 60, GROWTH_KIB = 1024 };
  live_stage *stage = open_stage(drawn);
  const clt_projector_driver *driver = stage->projector->driver;
  clt_error error = {0};
  int64_t shown_ns;
  long early = 0;
  const clt_live_picture picture = draw_live(6, stage);
  for (int frame = 0; frame < frames; frame++) {
    clt_status status = frame % 2 ? driver->present_live(stage->projector, &picture, &shown_ns, &error)
                                  : driver->present(stage->projector, stage->codes, &shown_ns, &error);
    assert_ok(status, error);
    early = frame == EARLY ? resident_kib() : early;
  }
  assert_true(resident_kib() - early < GROWTH_KIB);
  close_stage(stage);
}

static void test_memory(void **state) {
  (void)state;
  check_memory(true, 360);
  check_memory(false, 200);
}

int main(void) {
  test_display display = {0};
  if (!test_display_xvfb("64x64x24", &display)) {
    fprintf(stderr, "skipped: Xvfb does not start here\n");
    return TEST_SKIPPED;
  }
  test_display_stop(&display);
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_levels),    cmocka_unit_test(test_ten_bits),
                                     cmocka_unit_test(test_window),    cmocka_unit_test(test_pace),
                                     cmocka_unit_test(test_manners),   cmocka_unit_test(test_live),
                                     cmocka_unit_test(test_stretched), cmocka_unit_test(test_painted),
                                     cmocka_unit_test(test_resized),   cmocka_unit_test(test_memory)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
