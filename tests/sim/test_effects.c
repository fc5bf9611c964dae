/* What each effect does to frames, and that an effect of no strength does nothing. */
#include "rig_pair.h"

/* A scene with one channel whose frames carry no noise and no response: what is seen is light. */
#define PLAIN_PANEL "response = \"linear\"; bits = 16; black = 0.0; "
#define PLAIN_CAMERA "bits = 16; responsivity = 20.0; photon_noise = false; read_noise = 0.0; black_level = 0; "
static const int64_t SETTLED = 50000000; /* ns: more than the latency */

static float plain_entry(int channel, size_t row, size_t column) {
  return row == column ? 1.0f : 0.01f * (float)(channel + 1) / (float)(1 + row + column);
}

/* 6 x 4 cells, 3 channels, light between all cells, no ambient light. */
static rig_pair wide_open(const char *panel, const char *camera, const char *settings) {
  char text[1000];
  snprintf(text, sizeof text,
           "transport_file = \"t.h5\"; projector = { " PLAIN_PANEL "%s }; camera = { " PLAIN_CAMERA "%s }; %s", panel,
           camera, settings);
  room made;
  room_make(&made, text);
  room_add_transport(&made, 6, 4, 3, plain_entry, 0.0f);
  rig_pair pair = pair_of(room_open(&made));
  room_remove(&made);
  return pair;
}

enum { WIDE_CELLS = 24, WIDE_VALUES = 72 };

static void wide_codes(float codes[WIDE_VALUES]) {
  for (int k = 0; k < WIDE_VALUES; k++) {
    codes[k] = (float)(k * 7 % 23) / 32.0f;
  }
}

/* Signal of a pixel, 0..1. */
static double pixel(const clt_frame *frame, int x, int y, int channel) {
  return frame->samples[(y * frame->width + x) * frame->channels + channel] / 65535.0;
}

static double drive_of(float code) {
  return rint(65535.0 * (double)code) / 65535.0;
}

/* T x of a channel in double, for drive x of the whole panel; b0 is the ambient light. */
static double wide_light(const double *x, int channel, int cell) {
  double sum = 0.0;
  for (int j = 0; j < WIDE_CELLS; j++) {
    sum += (double)plain_entry(channel, (size_t)cell, (size_t)j) * x[channel * WIDE_CELLS + j];
  }
  return sum;
}

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

/* Every cell's light is mixed by the matrix before it reaches the surfaces. */
static void crosstalk_mixes_channels(void **state) {
  (void)state;
  const double matrix[3][3] = {{0.9, 0.08, 0.02}, {0.0, 1.0, 0.125}, {0.03, 0.2, 0.7}};
  rig_pair pair = wide_open("crosstalk = [0.9, 0.08, 0.02, 0.0, 1.0, 0.125, 0.03, 0.2, 0.7];", "cell_pixels = 1;",
                            "ambient = 0.0;");
  float codes[WIDE_VALUES];
  double mixed[WIDE_VALUES] = {0};
  wide_codes(codes);
  for (int k = 0; k < WIDE_VALUES; k++) {
    for (int from = 0; from < 3; from++) {
      mixed[k] += matrix[k / WIDE_CELLS][from] * drive_of(codes[from * WIDE_CELLS + k % WIDE_CELLS]);
    }
  }
  clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
  clt_image drive = {.channels = 3, .height = 4, .width = 6, .data = codes}, seen = {0};
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_scene_appearance(pair.scene, &drive, &seen, &error), error);
  for (int k = 0; k < WIDE_VALUES; k++) {
    int cell = k % WIDE_CELLS;
    double light = wide_light(mixed, k / WIDE_CELLS, cell);
    assert_near(pixel(&frame, cell % 6, cell / 6, k / WIDE_CELLS), 20.0 / 60.0 * light, 1e-5);
    assert_near(seen.data[k], light, 3e-5);
  }
  clt_image_finish(&seen);
  pair_close(&pair);
}

/* Against cos^4 of the angle whose tangent grows with the distance from the middle; the corner itself loses all of the
 * given share. */
static void vignetting_is_cos4(void **state) {
  (void)state;
  rig_pair pair = wide_open("", "cell_pixels = 5; vignetting = 0.4;", "ambient = 0.0;");
  rig_pair bare = wide_open("", "cell_pixels = 5;", "ambient = 0.0;");
  float codes[WIDE_VALUES];
  wide_codes(codes);
  clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
  clt_frame plain = pair_frame(&bare, pair_show(&bare, codes) + SETTLED);
  double corner = tan(acos(pow(0.6, 0.25))), diagonal = hypot(15.0, 10.0);
  for (int y = 0; y < 20; y++) {
    for (int x = 0; x < 30; x++) {
      double tangent = corner * hypot(x + 0.5 - 15.0, y + 0.5 - 10.0) / diagonal;
      for (int c = 0; c < 3; c++) {
        assert_near(pixel(&frame, x, y, c), pow(cos(atan(tangent)), 4.0) * pixel(&plain, x, y, c), 2e-5);
      }
    }
  }
  pair_close(&pair);
  pair_close(&bare);
}

/* An effect at strength zero: its keys, by group. */
typedef struct absence {
  const char *effect, *panel, *camera, *settings;
} absence;

static const absence absences[] = {
    {"crosstalk", "crosstalk = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];", "", ""},
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
  room_make(&made, "transport_file = \"t.h5\"; projector = { " PLAIN_PANEL " }; camera = { " PLAIN_CAMERA " };");
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
    assert_near(pixel(&frame, 2 * (cell % 6), 2 * (cell / 6), c), 20.0 / 60.0 * (0.127 + entry * drive_of(codes[k])),
                1e-5);
  }
  pair_close(&pair);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(pipeline_in_double), cmocka_unit_test(crosstalk_mixes_channels),
      cmocka_unit_test(vignetting_is_cos4), cmocka_unit_test(no_strength_no_difference),
      cmocka_unit_test(diagonal_light),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
