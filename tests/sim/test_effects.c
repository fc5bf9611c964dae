/* What each effect does to frames, and that an effect of no strength does nothing. */
#include "wide.h"

static const int64_t SETTLED = WIDE_SETTLED;

/* The documented way from codes to samples, step by step in double. */
static void pipeline_in_double(void **state) {
  (void)state;
  rig_pair pair = pair_open("projector = { response = \"gamma 2.0\"; bits = 5; black = 0.125; }; camera = { "
                            "responsivity = 24.0; bits = 10; response = \"gamma 2.2\"; photon_noise = false; "
                            "read_noise = 0.0; black_level = 40; cell_pixels = 3; };");
  float codes[PAIR_CELLS];
  for (int k = 0; k < PAIR_CELLS; k++) {
    codes[k] = 0.083f * (float)k;
  }
  clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
  assert_int_equal(frame.width, 12);
  for (int p = 0; p < 12 * 9; p++) {
    int cell = p / 12 / 3 * 4 + p % 12 / 3;
    double code = rint(31.0 * (double)codes[cell]) / 31.0, drive = code * code;
    double radiance = pair_gain(cell) * (drive + 0.125 / 0.875);
    double signal = fmin(24.0 * radiance / 60.0, 1.0);
    double sample = 40.0 + pow(signal, 1.0 / 2.2) * (1023.0 - 40.0);
    assert_near(frame.samples[p], sample, 0.5 + 1e-3);
  }
  pair_close(&pair);
}

/* A frame of codes, settled, and the drive of the codes in double. */
static clt_frame photograph(rig_pair *pair, float codes[WIDE_VALUES], double drive[WIDE_VALUES]) {
  wide_codes(codes);
  for (int k = 0; k < WIDE_VALUES; k++) {
    drive[k] = wide_drive(codes[k]);
  }
  return pair_frame(pair, pair_show(pair, codes) + SETTLED);
}

/* The frame and the scene's own account show T drive (and no ambient light). */
static void assert_shows(rig_pair *pair, const clt_frame *frame, float *codes, const double drive[WIDE_VALUES]) {
  clt_image panel = {.channels = 3, .height = WIDE_HEIGHT, .width = WIDE_WIDTH, .data = codes}, seen = {0};
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_scene_appearance(pair->scene, &panel, &seen, &error), error);
  for (int k = 0; k < WIDE_VALUES; k++) {
    double light = wide_light(drive, k / WIDE_CELLS, k % WIDE_CELLS);
    assert_near(wide_seen(frame, k), light, 3e-5);
    assert_near(seen.data[k], light, 3e-5);
  }
  clt_image_finish(&seen);
}

/* Every cell's light is mixed by the matrix before it reaches the surfaces. */
static void crosstalk_mixes_channels(void **state) {
  (void)state;
  const double matrix[3][3] = {{0.9, 0.08, 0.02}, {0.0, 1.0, 0.125}, {0.03, 0.2, 0.7}};
  rig_pair pair = wide_open("crosstalk = [0.9, 0.08, 0.02, 0.0, 1.0, 0.125, 0.03, 0.2, 0.7];", "", "ambient = 0.0;");
  float codes[WIDE_VALUES];
  double drive[WIDE_VALUES], mixed[WIDE_VALUES] = {0};
  clt_frame frame = photograph(&pair, codes, drive);
  for (int k = 0; k < WIDE_VALUES; k++) {
    for (int from = 0; from < 3; from++) {
      mixed[k] += matrix[k / WIDE_CELLS][from] * drive[from * WIDE_CELLS + k % WIDE_CELLS];
    }
  }
  assert_shows(&pair, &frame, codes, mixed);
  pair_close(&pair);
}

/* Share of a point's light k cells further on: the integral of the normal density over that cell. */
static double spread(double sigma, int k) {
  return 0.5 * (erf((k + 0.5) / (sigma * sqrt(2.0))) - erf((k - 0.5) / (sigma * sqrt(2.0))));
}

/* Light from value `from` of a line of count values to value `to`, reflected at both ends. */
static double spread_within(double sigma, int count, int from, int to) {
  double sum = 0.0;
  for (int image = -9; image <= 9; image++) {
    int there = 2 * count * image;
    sum += spread(sigma, there + to - from) + spread(sigma, there + 2 * count - 1 - to - from);
  }
  return sum;
}

/* A plane blurred by the sum over mirror images, in double. */
static void blur(double sigma, int width, int height, const double *in, double *out) {
  for (int k = 0; k < width * height; k++) {
    out[k] = 0.0;
    for (int j = 0; j < width * height; j++) {
      out[k] += in[j] * spread_within(sigma, width, j % width, k % width) *
                spread_within(sigma, height, j / width, k / width);
    }
  }
}

static void defocus_spreads_drive(void **state) {
  (void)state;
  const double sigmas[] = {0.3, 0.8, 2.5};
  for (int n = 0; n < 3; n++) {
    char panel[60];
    snprintf(panel, sizeof panel, "defocus = %.1f;", sigmas[n]);
    rig_pair pair = wide_open(panel, "", "ambient = 0.0;");
    float codes[WIDE_VALUES];
    double drive[WIDE_VALUES], blurred[WIDE_VALUES], before = 0.0, after = 0.0;
    clt_frame frame = photograph(&pair, codes, drive);
    for (int c = 0; c < 3; c++) {
      blur(sigmas[n], WIDE_WIDTH, WIDE_HEIGHT, &drive[c * WIDE_CELLS], &blurred[c * WIDE_CELLS]);
    }
    for (int k = 0; k < WIDE_VALUES; k++) {
      before += drive[k];
      after += blurred[k];
    }
    assert_near(after, before, 1e-12 * before);
    for (int k = 0; k < WIDE_VALUES; k++) {
      double light = wide_light(blurred, k / WIDE_CELLS, k % WIDE_CELLS);
      assert_near(wide_seen(&frame, k), light, 3e-4 * light + 3e-5); /* cut off at 4 sigma: 1e-4 */
    }
    pair_close(&pair);
  }
}

static void subsurface_spreads_radiance(void **state) {
  (void)state;
  rig_pair pair = wide_open("", "", "ambient = 0.0; subsurface = { share = 0.4; radius = 1.2; };");
  float codes[WIDE_VALUES];
  double drive[WIDE_VALUES], sharp[WIDE_VALUES], blurred[WIDE_VALUES];
  clt_frame frame = photograph(&pair, codes, drive);
  wide_radiance(codes, sharp);
  for (int c = 0; c < 3; c++) {
    blur(1.2, WIDE_WIDTH, WIDE_HEIGHT, &sharp[c * WIDE_CELLS], &blurred[c * WIDE_CELLS]);
  }
  for (int k = 0; k < WIDE_VALUES; k++) {
    assert_near(wide_seen(&frame, k), 0.6 * sharp[k] + 0.4 * blurred[k], 2e-4);
  }
  pair_close(&pair);
}

static void lens_blur_spreads_pixels(void **state) {
  (void)state;
  enum { SIDE = 3, ACROSS = WIDE_WIDTH * SIDE, DOWN = WIDE_HEIGHT * SIDE };
  rig_pair pair = wide_open("", "cell_pixels = 3; lens_blur = 1.7;", "ambient = 0.0;");
  float codes[WIDE_VALUES];
  double drive[WIDE_VALUES], radiance[WIDE_VALUES], sharp[ACROSS * DOWN], blurred[ACROSS * DOWN];
  clt_frame frame = photograph(&pair, codes, drive);
  wide_radiance(codes, radiance);
  for (int c = 0; c < 3; c++) {
    for (int p = 0; p < ACROSS * DOWN; p++) {
      sharp[p] = radiance[c * WIDE_CELLS + p / ACROSS / SIDE * WIDE_WIDTH + p % ACROSS / SIDE];
    }
    blur(1.7, ACROSS, DOWN, sharp, blurred);
    for (int p = 0; p < ACROSS * DOWN; p++) {
      assert_near(wide_pixel(&frame, p % ACROSS, p / ACROSS, c), blurred[p], 2e-4);
    }
  }
  pair_close(&pair);
}

/* Against cos^4 of the angle whose tangent grows with the distance from the middle; the corner itself loses all of the
 * given share. */
static void vignetting_is_cos4(void **state) {
  (void)state;
  rig_pair pair = wide_open("", "cell_pixels = 5; vignetting = 0.4;", "ambient = 0.0;");
  float codes[WIDE_VALUES];
  double drive[WIDE_VALUES], radiance[WIDE_VALUES];
  clt_frame frame = photograph(&pair, codes, drive);
  wide_radiance(codes, radiance);
  double corner = tan(acos(pow(0.6, 0.25))), diagonal = hypot(15.0, 10.0);
  for (int y = 0; y < 20; y++) {
    for (int x = 0; x < 30; x++) {
      double tangent = corner * hypot(x + 0.5 - 15.0, y + 0.5 - 10.0) / diagonal;
      for (int c = 0; c < 3; c++) {
        double light = radiance[c * WIDE_CELLS + y / 5 * WIDE_WIDTH + x / 5];
        assert_near(wide_pixel(&frame, x, y, c), pow(cos(atan(tangent)), 4.0) * light, 3e-5);
      }
    }
  }
  pair_close(&pair);
}

/* An effect at strength zero: its keys, by group. */
typedef struct absence {
  const char *effect, *panel, *camera, *settings;
} absence;

static const absence absences[] = {
    {"crosstalk", "crosstalk = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];", "", ""},
    {"defocus", "defocus = 0.0;", "", ""},
    {"subsurface", "", "", "subsurface = { share = 0.0; radius = 2.0; };"},
    {"flicker", "", "", "flicker = { mains_hz = 60.0; depth = 0.0; };"},
    {"drift", "drift = { per_hour = 0.0; amplitude = 0.0; period_s = 20.0; };", "", ""},
    {"vibration", "", "", "vibration = { amplitude = [0.0, 0.0]; hz = 7.0; };"},
    {"change", "", "", "change = { at_s = 0.05; cells = [1, 1, 2, 2]; factor = [1.0, 1.0, 1.0]; };"},
    {"rolling-shutter", "", "line_us = 0.0;", ""},
    {"faults", "", "faults = { dropped = 0.0; stuck = 0.0; late = 0.0; late_ms = 70.0; };", ""},
    {"lens-blur", "", "lens_blur = 0.0;", ""},
    {"vignetting", "", "vignetting = 0.0;", ""},
};

/* Frames over a few patterns, some of them exposed over a change of pattern. */
static void record(rig_pair *pair, uint16_t samples[4 * WIDE_VALUES]) {
  float codes[WIDE_VALUES];
  for (int n = 0; n < 4; n++) {
    for (int k = 0; k < WIDE_VALUES; k++) {
      codes[k] = (float)((k + 1) * (n + 3) % 17) / 20.0f;
    }
    int64_t shown = pair_show(pair, codes);
    clt_frame frame = pair_frame(pair, shown + n * 10000000);
    memcpy(&samples[n * WIDE_VALUES], frame.samples, WIDE_VALUES * sizeof *samples);
  }
}

/* An effect that is off: not prepared, not run, and why not is said. */
static void assert_off(clt_scene *scene, const char *name) {
  clt_effect_report reports[CLT_EFFECTS];
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_scene_effects(scene, reports, &error), error);
  int found = 0;
  for (int k = 0; k < CLT_EFFECTS; k++) {
    if (strcmp(reports[k].name, name) == 0) {
      found++;
      assert_false(reports[k].on);
      assert_true(strlen(reports[k].why) > 10 && reports[k].bytes == 0);
      assert_near(reports[k].prepare_ms + reports[k].frame_ms, 0.0, 0.0);
    }
  }
  assert_int_equal(found, 1);
}

static void no_strength_no_difference(void **state) {
  (void)state;
  uint16_t bare[4 * WIDE_VALUES], absent[4 * WIDE_VALUES];
  rig_pair pair = wide_open("", "cell_pixels = 1; ", "");
  record(&pair, bare);
  pair_close(&pair);
  for (size_t k = 0; k < sizeof absences / sizeof absences[0]; k++) {
    char camera[200];
    snprintf(camera, sizeof camera, "cell_pixels = 1; %s", absences[k].camera);
    pair = wide_open(absences[k].panel, camera, absences[k].settings);
    record(&pair, absent);
    assert_memory_equal(bare, absent, sizeof bare);
    assert_off(pair.scene, absences[k].effect);
    pair_close(&pair);
  }
}

/* A T without light from cell to cell is applied as a diagonal: the same frames as from the whole of it. */
static float diagonal_entry(int channel, size_t row, size_t column) {
  return row == column ? 0.3f + 0.01f * (float)row + 0.1f * (float)channel : 0.0f;
}

static void diagonal_light(void **state) {
  (void)state;
  room made;
  room_make(&made, "transport_file = \"t.h5\"; projector = { " WIDE_PANEL " }; camera = { " WIDE_CAMERA " };");
  room_add_transport(&made, 6, 4, 3, diagonal_entry, 0.125f);
  rig_pair pair = pair_of(room_open(&made));
  room_remove(&made);
  assert_off(pair.scene, "interreflection");
  float codes[WIDE_VALUES];
  wide_codes(codes);
  clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
  for (int k = 0; k < WIDE_VALUES; k++) {
    int cell = k % WIDE_CELLS, c = k / WIDE_CELLS;
    double entry = (double)diagonal_entry(c, (size_t)cell, (size_t)cell);
    assert_near(wide_seen(&frame, k), 0.127 + entry * wide_drive(codes[k]), 3e-5);
  }
  pair_close(&pair);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(pipeline_in_double),        cmocka_unit_test(crosstalk_mixes_channels),
      cmocka_unit_test(defocus_spreads_drive),     cmocka_unit_test(subsurface_spreads_radiance),
      cmocka_unit_test(lens_blur_spreads_pixels),  cmocka_unit_test(vignetting_is_cos4),
      cmocka_unit_test(no_strength_no_difference), cmocka_unit_test(diagonal_light),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
