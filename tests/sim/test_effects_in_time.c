/* What effects do that depend on when a frame is taken. */
#include "wide.h"

/* The ambient light integrated over the exposure: depth (cos(w a) - cos(w b)) / (w (b - a)), w = 2 pi 2 mains. */
static void flicker_is_integrated(void **state) {
  (void)state;
  const double exposures[] = {1.0 / 60.0, 0.01, 0.0007, 0.0213};
  rig_pair pair = wide_open("", "", "ambient = [0.5, 0.25, 0.0]; flicker = { mains_hz = 50.0; depth = 0.6; };");
  double w = 2.0 * M_PI * 100.0, lowest = 1.0, highest = 0.0;
  for (int n = 0; n < 4; n++) {
    pair_expose(&pair, exposures[n]);
    for (int k = 0; k < 7; k++) {
      clt_frame frame = pair_frame(&pair, 0);
      double a = 1e-9 * (double)frame.exposed_ns, b = a + frame.exposure_s;
      double mean = 1.0 + 0.6 * (cos(w * a) - cos(w * b)) / (w * (b - a));
      double step = 1.0 / 65535.0 / (20.0 * frame.exposure_s);
      assert_near(wide_seen(&frame, 3), 0.5 * mean, 1e-6 + step);
      assert_near(wide_seen(&frame, WIDE_CELLS + 7), 0.25 * mean, 1e-6 + step);
      assert_near(wide_seen(&frame, 2 * WIDE_CELLS + 23), 0.0, 1e-6);
      lowest = fmin(lowest, mean);
      highest = fmax(highest, mean);
    }
  }
  assert_true(lowest < 0.7 && highest > 1.3);
  pair_close(&pair);
}

/* Lamp and leak follow the law, the ambient light does not. */
static void drift_dims_the_lamp(void **state) {
  (void)state;
  rig_pair pair =
      wide_open("drift = { per_hour = -0.125; amplitude = 0.05; period_s = 500.0; };", "", "ambient = 0.25;");
  float codes[WIDE_VALUES];
  double radiance[WIDE_VALUES];
  wide_codes(codes);
  wide_radiance(codes, radiance);
  pair_show(&pair, codes);
  for (int n = 0; n < 12; n++) {
    clt_frame frame = pair_frame(&pair, WIDE_SETTLED + (int64_t)n * 1000000000 * 777);
    double t = 1e-9 * (double)frame.exposed_ns + 0.5 * frame.exposure_s;
    double gain = 1.0 - 0.125 * t / 3600.0 + 0.05 * sin(2.0 * M_PI * t / 500.0);
    for (int k = 0; k < WIDE_VALUES; k++) {
      assert_near(wide_seen(&frame, k), 0.25 + fmax(gain, 0.0) * radiance[k], 3e-5);
    }
  }
  pair_close(&pair);
}

/* Every row of pixels has its own window of time; one that lies over a change of pattern mixes both. */
static void rows_follow_each_other(void **state) {
  (void)state;
  rig_pair pair = wide_open("", "cell_pixels = 4; line_us = 900.0;", "ambient = 0.0;");
  float dark[WIDE_VALUES] = {0}, codes[WIDE_VALUES];
  double radiance[WIDE_VALUES];
  wide_codes(codes);
  wide_radiance(codes, radiance);
  pair_frame(&pair, pair_show(&pair, dark) + WIDE_SETTLED);
  int64_t lit = pair_show(&pair, codes) + 30000000; /* the latency */
  clt_frame frame = pair_frame(&pair, lit - 16000000);
  int whole = 0, partly = 0;
  for (int y = 0; y < 16; y++) {
    double start = (double)(frame.exposed_ns - lit) + 900e3 * y, end = start + 1e9 * frame.exposure_s;
    double share = fmin(1.0, fmax(0.0, end) / (end - start));
    whole += share >= 1.0;
    partly += share > 0.0 && share < 1.0;
    for (int x = 0; x < 24; x++) {
      for (int c = 0; c < 3; c++) {
        double light = radiance[c * WIDE_CELLS + y / 4 * WIDE_WIDTH + x / 4];
        assert_near(wide_pixel(&frame, x, y, c), share * light, 3e-5);
      }
    }
  }
  assert_true(partly > 5 && whole + partly > 10);
  pair_close(&pair);
}

/* Frames are dropped as often as the probability says (4.5 standard errors), at any seed. */
static void faults_by_chance(void **state) {
  (void)state;
  enum { FRAMES = 1500 };
  for (int seed = 1; seed <= 3; seed++) {
    char settings[60];
    snprintf(settings, sizeof settings, "ambient = 0.5; seed = %d;", seed);
    rig_pair pair = wide_open("", "faults = { dropped = 0.2; stuck = 0.1; };", settings);
    int64_t last_ns = -1;
    int missing = 0;
    uint32_t first = pair_frame(&pair, 0).sequence, last = first;
    for (int n = 0; n < FRAMES; n++) {
      clt_frame frame = pair_frame(&pair, 0);
      assert_true(frame.exposed_ns > last_ns);
      missing += (int)(frame.sequence - last) - 1;
      last = frame.sequence;
      last_ns = frame.exposed_ns;
    }
    double all = FRAMES + missing;
    assert_near(missing / all, 0.2, 4.5 * sqrt(0.2 * 0.8 / all));
    pair_close(&pair);
  }
}

/* Torn frames carry no light from some row on, a quarter to three quarters of them, and are whole above it. */
static void torn_frames_are_dark_below(void **state) {
  (void)state;
  enum { FRAMES = 600, ROWS = 4 * WIDE_HEIGHT };
  rig_pair pair = wide_open("", "cell_pixels = 4; vignetting = 0.01; faults = { torn = 0.2; };", "ambient = 0.5;");
  int torn = 0, least = ROWS, most = 0;
  for (int n = 0; n < FRAMES; n++) {
    clt_frame frame = pair_frame(&pair, 0);
    int lit = 0;
    for (int y = 0; y < ROWS; y++) {
      bool dark = frame.samples[y * frame.width * 3] == 0;
      assert_true(dark || lit == y);
      lit += !dark;
    }
    torn += lit < ROWS;
    least = lit < least ? lit : least;
    most = lit < ROWS && lit > most ? lit : most;
  }
  assert_near((double)torn / FRAMES, 0.2, 4.5 * sqrt(0.2 * 0.8 / FRAMES));
  assert_true(least >= ROWS / 4 && least <= ROWS / 4 + 2 && most <= 3 * ROWS / 4 && most >= 3 * ROWS / 4 - 2);
  pair_close(&pair);
}

/* The light of successive pictures is late by latency +- jitter, evenly: share of a frame that the new picture has. */
static void latency_varies_by_chance(void **state) {
  (void)state;
  enum { PICTURES = 400 };
  rig_pair pair = wide_open("latency_ms = 20.0; jitter_ms = 6.0; ", "fps = 100.0;", "ambient = 0.0;");
  double sum = 0, square = 0, least = 1, most = 0;
  pair_expose(&pair, 0.05);
  for (int n = 0; n < PICTURES; n++) {
    int64_t shown = pair_show(&pair, (float[WIDE_VALUES]){0});
    pair_frame(&pair, shown + WIDE_SETTLED);
    float codes[WIDE_VALUES];
    wide_codes(codes);
    double radiance[WIDE_VALUES];
    wide_radiance(codes, radiance);
    shown = pair_show(&pair, codes);
    clt_frame frame = pair_frame(&pair, shown - 20000000);
    double begin = 1e-9 * (double)(frame.exposed_ns - shown);
    double late = begin + frame.exposure_s * (1 - wide_seen(&frame, 3) / radiance[3]);
    sum += late / PICTURES;
    square += late * late / PICTURES;
    least = fmin(least, late);
    most = fmax(most, late);
  }
  assert_near(sum, 0.02, 4.5 * 0.006 / sqrt(3.0 * PICTURES));
  assert_near(sqrt(square - sum * sum), 0.006 / sqrt(3.0), 0.0003);
  assert_true(least >= 0.014 - 1e-5 && least < 0.0145 && most <= 0.026 + 1e-5 && most > 0.0255);
  pair_close(&pair);
}

static void stuck_frames_repeat(void **state) {
  (void)state;
  enum { FRAMES = 800 };
  rig_pair pair =
      wide_open("", "cell_pixels = 3; faults = { stuck = 0.25; };", "ambient = 0.5; flicker = { depth = 0.9; };");
  uint16_t before[9 * WIDE_VALUES] = {0};
  int stuck = 0;
  for (int n = 0; n < FRAMES; n++) {
    clt_frame frame = pair_frame(&pair, 0);
    stuck += memcmp(before, frame.samples, sizeof before) == 0;
    memcpy(before, frame.samples, sizeof before);
  }
  assert_near((double)stuck / FRAMES, 0.25, 4.5 * sqrt(0.25 * 0.75 / FRAMES));
  pair_close(&pair);
}

/* A late frame keeps its time stamp, but the clock is further on when it is there: the next picture shows later. */
static void late_frames_move_the_clock(void **state) {
  (void)state;
  rig_pair pair = wide_open("", "faults = { late = 1.0; late_ms = 400.0; };", "");
  clt_frame frame = pair_frame(&pair, 0);
  float codes[WIDE_VALUES] = {0};
  int64_t there = frame.exposed_ns + llround(1e9 * frame.exposure_s) + 400000000;
  int64_t shown = pair_show(&pair, codes);
  assert_true(shown > there && shown <= there + 16666667);
  pair_close(&pair);
}

/* Inside the picture a straight slope shifts by the mean displacement over the exposure, in closed form. */
static void vibration_shifts_slopes(void **state) {
  (void)state;
  rig_pair pair = pair_open("projector = { response = \"linear\"; bits = 16; black = 0.0; }; vibration = { amplitude = "
                            "[0.9, -0.8]; hz = 11.0; }; camera = { " WIDE_CAMERA " cell_pixels = 3; };");
  float codes[PAIR_CELLS];
  for (int k = 0; k < PAIR_CELLS; k++) { /* radiance 0.2 + 0.1 x + 0.05 y */
    codes[k] = (float)((0.2 + 0.1 * (k % 4) + 0.05 * (double)(k / 4)) / pair_gain(k));
  }
  int64_t settled = pair_show(&pair, codes) + WIDE_SETTLED;
  double w = 2.0 * M_PI * 11.0, most = 0.0;
  for (int n = 0; n < 9; n++) {
    clt_frame frame = pair_frame(&pair, settled);
    double a = 1e-9 * (double)frame.exposed_ns, b = a + frame.exposure_s;
    double mean = (cos(w * a) - cos(w * b)) / (w * (b - a));
    for (int x = 1; x < 3; x++) {
      double light = 0.2 + 0.1 * (x - 0.9 * mean) + 0.05 * (1.0 + 0.8 * mean);
      assert_near(pair_signal(&pair, &frame, 4 + x), 20.0 / 60.0 * light, 4e-5);
    }
    most = fmax(most, fabs(mean));
  }
  assert_true(most > 0.6);
  pair_close(&pair);
}

/* Repainted cells send out another share of the light from a moment on; a frame over it sees both. */
static void change_repaints_cells(void **state) {
  (void)state;
  rig_pair pair = wide_open("", "",
                            "ambient = 0.125; change = { at_s = 0.2; cells = [1, 2, 3, 1]; factor = [0.5, 1.0, "
                            "1.25]; };");
  const double factor[3] = {0.5, 1.0, 1.25};
  float codes[WIDE_VALUES];
  double radiance[WIDE_VALUES];
  wide_codes(codes);
  wide_radiance(codes, radiance);
  int64_t settled = pair_show(&pair, codes) + WIDE_SETTLED;
  int before = 0, over = 0, after = 0;
  for (int n = 0; n < 15; n++) {
    clt_frame frame = pair_frame(&pair, settled);
    double a = 1e-9 * (double)frame.exposed_ns, b = a + frame.exposure_s;
    double share = fmin(1.0, fmax(0.0, (b - 0.2) / (b - a)));
    before += share <= 0.0;
    after += share >= 1.0;
    over += share > 0.0 && share < 1.0;
    for (int k = 0; k < WIDE_VALUES; k++) {
      int x = k % WIDE_WIDTH, y = k % WIDE_CELLS / WIDE_WIDTH;
      double gain = y == 2 && x >= 1 && x < 4 ? 1.0 + share * (factor[k / WIDE_CELLS] - 1.0) : 1.0;
      assert_near(wide_seen(&frame, k), gain * (0.125 + radiance[k]), 4e-5);
    }
  }
  assert_true(before > 2 && after > 2 && over >= 1);
  pair_close(&pair);
}

/* Something passes again and again: each exposure sees it where it is in its middle, for the part that it is there. */
static void what_passes_by_comes_and_goes(void **state) {
  (void)state;
  rig_pair pair = wide_open("", "",
                            "ambient = 0.125; change = { at_s = 0.2; for_s = 0.15; every_s = 0.4; cells = [0, 1, 2, "
                            "2]; speed = [40.0, -10.0]; factor = 0.5; };");
  float codes[WIDE_VALUES];
  double radiance[WIDE_VALUES];
  wide_codes(codes);
  wide_radiance(codes, radiance);
  int64_t settled = pair_show(&pair, codes) + WIDE_SETTLED;
  int there = 0, partly = 0, gone = 0, moved = 0;
  for (int n = 0; n < 60; n++) {
    clt_frame frame = pair_frame(&pair, settled);
    double a = 1e-9 * (double)frame.exposed_ns, b = a + frame.exposure_s, share = 0, since = 0;
    for (int k = 0; k < 20; k++) {
      double start = 0.2 + 0.4 * k, overlap = fmin(b, start + 0.15) - fmax(a, start);
      since = overlap > 0 ? fmax((a + b) / 2 - start, 0) : since;
      share += fmax(overlap, 0) / (b - a);
    }
    int left = (int)floor(40 * since), top = 1 + (int)floor(-10 * since);
    there += share >= 1;
    partly += share > 0 && share < 1;
    gone += share <= 0;
    moved += share > 0 && left > 0;
    for (int k = 0; k < WIDE_VALUES; k++) {
      int x = k % WIDE_WIDTH, y = k % WIDE_CELLS / WIDE_WIDTH;
      bool covered = x >= left && x < left + 2 && y >= top && y < top + 2;
      assert_near(wide_seen(&frame, k), (covered ? 1 - 0.5 * share : 1) * (0.125 + radiance[k]), 4e-5);
    }
  }
  assert_true(there > 5 && partly > 2 && gone > 5 && moved > 5);
  pair_close(&pair);
}

static clt_status ask(rig_pair *pair, int64_t not_before_ns) {
  clt_frame frame;
  return pair->camera->driver->next(pair->camera, not_before_ns, 1e3, &frame, NULL);
}

/* A camera that was unplugged, seen or not, gives no frame until it is opened again, and opens while it is plugged in
 * only. */
static void an_unplugged_camera_must_be_opened_again(void **state) {
  (void)state;
  const int64_t second = 1000000000;
  rig_pair pair = wide_open("", "faults = { gone_at_s = 2.0; gone_s = 3.0; gone_every_s = 10.0; };", "");
  const float dark[WIDE_VALUES] = {0};
  clt_error error = {0};
  const struct {
    int64_t within, behind; /* both in s: a time while it is away, and one at which it is back */
  } gaps[] = {{4, 6}, {13, 17}, {23, 28}};
  for (int n = 0; n < 3; n++) {
    assert_int_equal(ask(&pair, (gaps[n].within - 3) * second), CLT_OK);
    assert_int_equal(ask(&pair, (n == 1 ? gaps[n].behind : gaps[n].within) * second), CLT_GONE);
    assert_int_equal(ask(&pair, 0), CLT_GONE);
    pair.camera->driver->close(pair.camera);
    pair.camera = NULL;
    assert_int_equal(clt_scene_open_camera(pair.scene, &pair.camera, &error), n == 1 ? CLT_OK : CLT_GONE);
    while (pair_show(&pair, dark) < gaps[n].behind * second) {
    }
    if (pair.camera == NULL) {
      assert_ok(clt_scene_open_camera(pair.scene, &pair.camera, &error), error);
    }
  }
  pair_close(&pair);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(flicker_is_integrated),         cmocka_unit_test(drift_dims_the_lamp),
      cmocka_unit_test(rows_follow_each_other),        cmocka_unit_test(faults_by_chance),
      cmocka_unit_test(torn_frames_are_dark_below),    cmocka_unit_test(latency_varies_by_chance),
      cmocka_unit_test(stuck_frames_repeat),           cmocka_unit_test(late_frames_move_the_clock),
      cmocka_unit_test(vibration_shifts_slopes),       cmocka_unit_test(change_repaints_cells),
      cmocka_unit_test(what_passes_by_comes_and_goes), cmocka_unit_test(an_unplugged_camera_must_be_opened_again),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
