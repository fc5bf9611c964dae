/* Two monitors of Xorg's dummy driver: the picture is on the right one, leaves the other alone, and follows its monitor
 * when that goes, comes back, moves or changes its mode. */
#include "device/projector/glfw.h"

#include "display.h"

enum { DESK_WIDTH = 800, DESK_HEIGHT = 600, BEAM_WIDTH = 640, BEAM_HEIGHT = 360, TRIES = 900 };

static const char server_settings[] = "Section \"ServerFlags\"\n"
                                      "  Option \"AutoAddDevices\" \"false\"\n"
                                      "  Option \"AutoAddGPU\" \"false\"\n"
                                      "EndSection\n"
                                      "Section \"Device\"\n"
                                      "  Identifier \"card\"\n"
                                      "  Driver \"dummy\"\n"
                                      "EndSection\n"
                                      "Section \"Monitor\"\n"
                                      "  Identifier \"monitor\"\n"
                                      "  HorizSync 5-1000\n"
                                      "  VertRefresh 5-200\n"
                                      "EndSection\n"
                                      "Section \"Screen\"\n"
                                      "  Identifier \"screen\"\n"
                                      "  Device \"card\"\n"
                                      "  Monitor \"monitor\"\n"
                                      "  DefaultDepth 24\n"
                                      "EndSection\n";

/* What xrandr is told; false where it refuses, or is not there. Only a query makes the dummy driver look which of its
 * monitors are connected. */
static bool arrange(const char *how) {
  char command[256];
  snprintf(command, sizeof command, "(xrandr %s && xrandr --query) >/dev/null 2>&1", how);
  return system(command) == 0;
}

/* The desk's monitor is the primary one at 0,0; the beam's stands to its right. */
static bool plug_in(void) {
  return arrange("--output DUMMY0 --mode 800x600 --primary --output DUMMY1 --mode 640x360 --pos 800x0");
}

/* Xorg with two monitors. False where it does not start here: there is no dummy driver, or this user may not. */
static bool start(test_display *display) {
  char settings[] = "/tmp/counterlight-monitors-XXXXXX";
  int file = mkstemp(settings);
  assert_true(file >= 0);
  assert_int_equal(write(file, server_settings, sizeof server_settings - 1), (ssize_t)sizeof server_settings - 1);
  close(file);
  char *const arguments[] = {"Xorg",     "-displayfd", "3",   "-config",   settings,      "-logfile",  "/dev/null",
                             "-noreset", "-nolisten",  "tcp", "-sharevts", "-novtswitch", "-nocursor", NULL};
  bool started = test_display_start(arguments, display);
  unlink(settings);
  return started && arrange("--addmode DUMMY1 640x360 --addmode DUMMY1 800x600") && plug_in();
}

static clt_projector *open_on(const char *monitor) {
  clt_projector_config config = {.driver = "glfw"};
  clt_projector *projector = NULL;
  clt_error error = {0};
  snprintf(config.monitor, sizeof config.monitor, "%s", monitor);
  assert_ok(clt_glfw_open_projector(&config, &projector, &error), error);
  return projector;
}

/* A picture that no other place or number of a picture has. */
static int step_at(int picture, int x, int y, int c) {
  return (3 * x + 5 * y + 37 * c + 91 * picture) % 256;
}

static void present(clt_projector *projector, int picture) {
  clt_projector_info info;
  clt_error error = {0};
  int64_t shown_ns = 0;
  projector->driver->describe(projector, &info);
  size_t plane = (size_t)info.width * (size_t)info.height;
  float *codes = malloc(3 * plane * sizeof *codes);
  for (size_t i = 0; i < 3 * plane; i++) {
    int x = (int)(i % plane % (size_t)info.width), y = (int)(i % plane / (size_t)info.width);
    codes[i] = (float)step_at(picture, x, y, (int)(i / plane)) / 255.0F;
  }
  assert_ok(projector->driver->present(projector, codes, &shown_ns, &error), error);
  free(codes);
}

/* How many of the samples are the picture's, whose corner is there. */
static int count_right(test_display *display, int picture, int left, int top, int width, int height) {
  uint16_t *seen = malloc((size_t)width * (size_t)height * 3 * sizeof *seen);
  int right = 0;
  test_display_grab(display, left, top, width, height, seen);
  for (int i = 0; i < 3 * width * height; i++) {
    right += seen[i] == step_at(picture, i / 3 % width, i / 3 / width, i % 3);
  }
  free(seen);
  return right;
}

static bool stands_at(test_display *display, int picture, int left, int top, int width, int height) {
  return count_right(display, picture, left, top, width, height) == 3 * width * height;
}

/* Presents until the picture is there; what happened to the monitor takes its time. */
static bool comes_to(test_display *display, clt_projector *projector, int picture, int left, int top) {
  bool there = false;
  for (int k = 0; k < TRIES && !there; k++) {
    present(projector, picture);
    there = k % 10 == 9 && stands_at(display, picture, left, top, BEAM_WIDTH, BEAM_HEIGHT);
  }
  return there;
}

/* "auto" is not the primary one; a name and a corner are that monitor. */
static void test_choice(void **state) {
  test_display *display = *state;
  static const struct {
    const char *monitor;
    int left, width, height;
  } cases[] = {{"auto", DESK_WIDTH, BEAM_WIDTH, BEAM_HEIGHT},
               {"DUMMY1", DESK_WIDTH, BEAM_WIDTH, BEAM_HEIGHT},
               {"800,0", DESK_WIDTH, BEAM_WIDTH, BEAM_HEIGHT},
               {"DUMMY0", 0, DESK_WIDTH, DESK_HEIGHT},
               {"0,0", 0, DESK_WIDTH, DESK_HEIGHT}};
  for (int k = 0; k < (int)(sizeof cases / sizeof cases[0]); k++) {
    clt_projector_info info;
    clt_projector *projector = open_on(cases[k].monitor);
    projector->driver->describe(projector, &info);
    assert_int_equal(info.width, cases[k].width);
    assert_int_equal(info.height, cases[k].height);
    present(projector, k);
    assert_true(stands_at(display, k, cases[k].left, 0, info.width, info.height));
    int other = cases[k].left == 0 ? DESK_WIDTH : 0;
    assert_true(count_right(display, k, other, 0, BEAM_WIDTH, BEAM_HEIGHT) < BEAM_WIDTH * BEAM_HEIGHT / 4);
    projector->driver->close(projector);
  }
}

/* While the monitor is away pictures are taken as before and none is on the desk; it comes back and so does the
 * picture, also at another place. */
static void test_return(void **state) {
  test_display *display = *state;
  clt_projector *projector = open_on("auto");
  static const struct {
    const char *back;
    int left, top;
  } returns[] = {{"--output DUMMY1 --mode 640x360 --pos 800x0", DESK_WIDTH, 0},
                 {"--output DUMMY1 --mode 640x360 --pos 800x200", DESK_WIDTH, 200},
                 {"--output DUMMY1 --mode 640x360 --pos 0x600", 0, DESK_HEIGHT}};
  for (int k = 0; k < (int)(sizeof returns / sizeof returns[0]); k++) {
    assert_true(arrange("--output DUMMY1 --off"));
    for (int frame = 0; frame < 60; frame++) {
      present(projector, k);
    }
    assert_true(count_right(display, k, 0, 0, DESK_WIDTH, DESK_HEIGHT) < DESK_WIDTH * DESK_HEIGHT / 4);
    assert_true(arrange(returns[k].back));
    assert_true(comes_to(display, projector, k + 3, returns[k].left, returns[k].top));
  }
  projector->driver->close(projector);
  assert_true(plug_in());
}

/* Moved while it is on, set to another mode by somebody else, and the primary one's going: the picture stays on its
 * monitor. */
static void test_moves(void **state) {
  test_display *display = *state;
  clt_projector *projector = open_on("auto");
  present(projector, 1);
  assert_true(stands_at(display, 1, DESK_WIDTH, 0, BEAM_WIDTH, BEAM_HEIGHT));
  assert_true(arrange("--output DUMMY1 --pos 800x100"));
  assert_true(comes_to(display, projector, 2, DESK_WIDTH, 100));
  assert_true(arrange("--output DUMMY1 --mode 800x600 --pos 800x0"));
  assert_true(comes_to(display, projector, 3, DESK_WIDTH, 0));
  assert_true(arrange("--output DUMMY0 --off --output DUMMY1 --mode 640x360 --pos 0x0"));
  assert_true(comes_to(display, projector, 4, 0, 0));
  projector->driver->close(projector);
  assert_true(plug_in());
}

int main(void) {
  test_display display = {0};
  if (!start(&display)) {
    fprintf(stderr, "skipped: Xorg with two monitors of its dummy driver does not start here\n");
    return TEST_SKIPPED;
  }
  const struct CMUnitTest tests[] = {cmocka_unit_test_prestate(test_choice, &display),
                                     cmocka_unit_test_prestate(test_return, &display),
                                     cmocka_unit_test_prestate(test_moves, &display)};
  int failed = cmocka_run_group_tests(tests, NULL, NULL);
  test_display_stop(&display);
  return failed;
}
