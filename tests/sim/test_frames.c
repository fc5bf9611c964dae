#include <omp.h>

#include "rig_pair.h"

#define PLAIN_PANEL "projector = { response = \"linear\"; bits = 16; black = 0.0; latency_ms = 30.0; }; "
static const int64_t SETTLED = 50000000; /* ns: more than the latency */

/* Mean and variance of the electrons in every cell, over frames and pixels, against the model: mean n = responsivity L
 * t full_well, variance n + read_noise^2 + a code value's rounding. Three scenes of other seeds; levels from 0 to 9000
 * electrons; bounds of 4.5 standard errors. */
static void noise_follows_the_model(void **state) {
  (void)state;
  enum { FRAMES = 60, SIDE = 16 };
  for (int seed = 1; seed <= 3; seed++) {
    char text[400];
    snprintf(text, sizeof text,
             PLAIN_PANEL "seed = %d; camera = { cell_pixels = 16; bits = 16; responsivity = 20.0; };", seed);
    rig_pair pair = pair_open(text);
    float codes[PAIR_CELLS];
    double sum[PAIR_CELLS] = {0}, squares[PAIR_CELLS] = {0};
    for (int k = 0; k < PAIR_CELLS; k++) {
      codes[k] = k == 0 ? 0.0f : powf(10.0f, -3.5f + 0.3f * (float)k);
    }
    int64_t after = pair_show(&pair, codes) + SETTLED;
    double step = 15000.0 / (65535.0 - pair.sensor.black_level), samples = FRAMES * SIDE * SIDE; /* electrons a code */
    for (int n = 0; n < FRAMES; n++) {
      clt_frame frame = pair_frame(&pair, after);
      for (int p = 0; p < 64 * 48; p++) {
        int cell = p / 64 / SIDE * 4 + p % 64 / SIDE;
        double electrons = (frame.samples[p] - pair.sensor.black_level) * step;
        sum[cell] += electrons / samples;
        squares[cell] += electrons * electrons / samples;
      }
      assert_near(frame.exposure_s, 1.0 / 60.0, 1e-12);
    }
    for (int k = 0; k < PAIR_CELLS; k++) {
      double drive = rint(65535.0 * (double)codes[k]) / 65535.0;
      double mean = 20.0 * pair_gain(k) * drive / 60.0 * 15000.0, variance = mean + 16.0 + step * step / 12.0;
      double spread = squares[k] - sum[k] * sum[k];
      assert_near(sum[k], mean, 4.5 * sqrt(variance / samples) + 1e-6 * mean);
      assert_near(spread, variance, 4.5 * sqrt((2 * variance * variance + mean) / samples));
    }
    pair_close(&pair);
  }
}

/* Above full well every sample is full scale; in the dark the pedestal keeps both signs of the noise. */
static void saturation_and_pedestal(void **state) {
  (void)state;
  rig_pair pair = pair_open(PLAIN_PANEL "camera = { responsivity = 100.0; cell_pixels = 8; };");
  clt_frame frame = pair_frame(&pair, pair_show_level(&pair, 1.0f) + SETTLED);
  assert_int_equal(frame.bits, 12);
  assert_int_equal(frame.width, 32);
  assert_int_equal(frame.height, 24);
  for (int p = 0; p < 32 * 24; p++) {
    assert_int_equal(frame.samples[p], 4095);
  }
  frame = pair_frame(&pair, pair_show_level(&pair, 0.0f) + SETTLED);
  int below = 0, above = 0;
  double mean = 0.0;
  for (int p = 0; p < 32 * 24; p++) {
    below += frame.samples[p] < 64;
    above += frame.samples[p] > 64;
    mean += frame.samples[p] / (32.0 * 24.0);
    assert_true(frame.samples[p] > 50 && frame.samples[p] < 78);
  }
  assert_true(below > 150 && above > 150);
  assert_near(mean, 64.0, 4.5 * sqrt((16.0 * 0.27 * 0.27 + 1.0 / 12) / (32 * 24)));
  pair_close(&pair);
}

/* A noiseless 8-bit camera rounds the encoded signal to whole code values. */
static void response_and_quantisation(void **state) {
  (void)state;
  rig_pair pair = pair_open(PLAIN_PANEL "camera = { responsivity = 20.0; bits = 8; response = \"gamma 2.2\"; "
                                        "full_well = 1e7; read_noise = 0.0; cell_pixels = 1; };");
  for (int level = 1; level <= 20; level++) {
    float code = 0.05f * (float)level;
    clt_frame frame = pair_frame(&pair, pair_show_level(&pair, code) + SETTLED);
    for (int cell = 0; cell < PAIR_CELLS; cell++) {
      double signal = fmin(1.0, 20.0 / 60.0 * pair_gain(cell) * rint(65535.0 * (double)code) / 65535.0);
      double sample = 4.0 + pow(signal, 1 / 2.2) * 251.0;
      double noise = 4.5 * 251.0 / 2.2 * pow(signal, 1 / 2.2 - 0.5) / sqrt(1e7);
      assert_near(frame.samples[cell], sample, 0.5 + noise);
    }
  }
  pair_close(&pair);
}

/* Panel codes are clipped, quantised to the panel's bits, decoded by its response; its black leaks. */
static void panel_codes(void **state) {
  (void)state;
  rig_pair pair =
      pair_open("projector = { response = \"srgb\"; bits = 3; black = 0.2; }; camera = { responsivity = 20.0; "
                "bits = 16; full_well = 1e7; read_noise = 0.0; };");
  float codes[PAIR_CELLS] = {-1.0f, 0.0f, 0.07f, 0.08f, 0.3f, 0.5f, 0.6f, 0.9f, 0.94f, 1.0f, 7.0f, NAN};
  const double steps[PAIR_CELLS] = {0, 0, 0, 1, 2, 4, 4, 6, 7, 7, 7, 0};
  clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
  for (int cell = 0; cell < PAIR_CELLS; cell++) {
    double v = steps[cell] / 7.0, drive = v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
    double signal = 20.0 / 60.0 * pair_gain(cell) * (drive + 0.25);
    assert_near(pair_signal(&pair, &frame, cell), fmin(signal, 1.0), 1e-3);
  }
  clt_projector_info panel;
  pair.projector->driver->describe(pair.projector, &panel);
  assert_int_equal(panel.width * 100 + panel.height * 10 + panel.channels, 431);
  assert_int_equal(panel.bits, 3);
  pair_close(&pair);
}

/* The light follows a present by the latency: a frame just before shows the old pattern. A frame over the change mixes
 * both by their shares of its time. */
static void transition_mixes(void **state) {
  (void)state;
  for (int k = 0; k < 5; k++) {
    rig_pair pair = pair_open(PLAIN_PANEL "camera = { responsivity = 1.0; bits = 16; full_well = 1e7; "
                                          "read_noise = 0.0; };");
    pair_expose(&pair, 0.1 + 0.031 * k);
    int64_t first = pair_show_level(&pair, 0.9f) + 30000000;
    int64_t change = pair_show_level(&pair, 0.2f) + 30000000;
    assert_true(change - first >= 16666666 && change - first <= 16666668);
    clt_frame frame = pair_frame(&pair, 0);
    double exposure_ns = frame.exposure_s * 1e9, start = (double)frame.exposed_ns;
    double before = fmax(0.0, (double)first - start),
           middle = fmin((double)change, start + exposure_ns) - start - before;
    double after = exposure_ns - before - middle;
    assert_true(before >= 0.0 && middle > 0.0 && after > 0.0);
    for (int cell = 0; cell < PAIR_CELLS; cell++) {
      double light = pair_gain(cell) * (0.9 * middle + 0.2 * after) * 1e-9;
      assert_near(pair_signal(&pair, &frame, cell), light, 2e-4);
    }
    pair_close(&pair);
  }
}

static void old_light_until_latency(void **state) {
  (void)state;
  rig_pair pair =
      pair_open(PLAIN_PANEL "camera = { responsivity = 50.0; bits = 16; full_well = 1e7; read_noise = 0.0; };");
  pair_expose(&pair, 0.001);
  pair_frame(&pair, pair_show_level(&pair, 0.5f) + SETTLED);
  int64_t shown = pair_show_level(&pair, 0.1f);
  clt_frame frame = pair_frame(&pair, shown);
  assert_true(frame.exposed_ns + 1000000 < shown + 30000000);
  assert_near(pair_signal(&pair, &frame, 3), 0.05 * 0.5 * pair_gain(3), 2e-4);
  frame = pair_frame(&pair, shown + 30000000);
  assert_near(pair_signal(&pair, &frame, 3), 0.05 * 0.1 * pair_gain(3), 2e-4);
  pair_close(&pair);
}

enum { RECORD_FRAMES = 3, RECORD_SAMPLES = 32 * 24 * 36 * 3 };

/* A few frames of two walls, large enough that threads share them out, under a fixed course of patterns. */
static uint16_t *record(int threads, int seed, bool effects) {
  omp_set_num_threads(threads);
  char text[900];
  snprintf(text, sizeof text,
           "seed = %d; grid = { width = 32; height = 24; }; camera = { cell_pixels = 6; %s "
           "materials = ( { name = \"m\"; albedo = 0.6; } ); "
           "surfaces = ( { corner = [-2, -2, -2]; u = [2, 2, 0]; v = [0, 0, 4]; material = \"m\"; }, "
           "{ corner = [0, 0, -2]; u = [2, -2, 0]; v = [0, 0, 4]; material = \"m\"; } );",
           seed,
           effects ? "line_us = 5.0; lens_blur = 7.0; vignetting = 0.2; faults = { dropped = 0.1; stuck = 0.1; }; }; "
                     "projector = { defocus = 8.0; drift = { per_hour = 0.5; }; }; subsurface = { share = 0.5; }; "
                     "flicker = { depth = 0.5; }; vibration = { amplitude = [0.5, 1.5]; };"
                   : "};");
  room made;
  room_make(&made, text);
  rig_pair pair = pair_of(room_open(&made));
  room_remove(&made);
  uint16_t *samples = calloc((size_t)RECORD_FRAMES * RECORD_SAMPLES, sizeof *samples);
  float codes[32 * 24 * 3];
  for (int n = 0; n < RECORD_FRAMES; n++) {
    for (int k = 0; k < 32 * 24 * 3; k++) {
      codes[k] = (float)((k * (n + 1)) % 11) / 10.0f;
    }
    clt_frame frame = pair_frame(&pair, pair_show(&pair, codes) + SETTLED);
    assert_int_equal(frame.width * frame.height * frame.channels, RECORD_SAMPLES);
    memcpy(&samples[n * RECORD_SAMPLES], frame.samples, RECORD_SAMPLES * sizeof *samples);
  }
  pair_close(&pair);
  return samples;
}

static void same_seed_same_frames(void **state) {
  (void)state;
  int threads = omp_get_max_threads();
  for (int effects = 0; effects < 2; effects++) {
    int different = 0;
    uint16_t *one = record(1, 7, effects), *four = record(4, 7, effects), *other = record(4, 8, effects);
    omp_set_num_threads(threads);
    assert_memory_equal(one, four, (size_t)RECORD_FRAMES * RECORD_SAMPLES * sizeof *one);
    for (int k = 0; k < RECORD_FRAMES * RECORD_SAMPLES; k++) {
      different += one[k] != other[k];
    }
    assert_true(different > RECORD_FRAMES * RECORD_SAMPLES / 2);
    free(one);
    free(four);
    free(other);
  }
}

/* The settings that the scene suggests: whole refresh periods, nothing saturated in the shortest at full drive. */
static void suggested_settings(void **state) {
  (void)state;
  const char *const cameras[] = {"", "camera = { responsivity = 0.3; };", "camera = { responsivity = 500.0; };"};
  for (int k = 0; k < 3; k++) {
    char text[300];
    snprintf(text, sizeof text, PLAIN_PANEL "%s", cameras[k]);
    rig_pair pair = pair_open(text);
    clt_rig_config config;
    clt_scene_rig_config(pair.scene, &config);
    assert_true(config.width == 4 && config.height == 3 && config.attempts >= 1);
    assert_near(config.latency_s, 0.03 + 1.0 / 60.0, 1e-12);
    double last = 0.0, shortest = config.exposures_s[0];
    for (int n = 0; n < config.exposure_count; n++) {
      double periods = config.exposures_s[n] * 60.0;
      assert_true(config.exposures_s[n] > last && config.exposures_s[n] <= 2.0 + 1e-9);
      assert_true(k == 2 || fabs(periods - rint(periods)) < 1e-9);
      last = config.exposures_s[n];
    }
    assert_int_equal(config.exposure_count, k == 1 ? 2 : 3);
    assert_near(last / shortest, k == 1 ? floor(2.0 / shortest) : 64.0, 1e-9);
    pair_expose(&pair, shortest);
    clt_frame frame = pair_frame(&pair, pair_show_level(&pair, 1.0f) + SETTLED);
    assert_near(pair_signal(&pair, &frame, 11), k == 1 ? 0.3 * pair_gain(11) * shortest : 0.75, 0.06);
    pair_close(&pair);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(noise_follows_the_model),   cmocka_unit_test(saturation_and_pedestal),
      cmocka_unit_test(response_and_quantisation), cmocka_unit_test(panel_codes),
      cmocka_unit_test(transition_mixes),          cmocka_unit_test(old_light_until_latency),
      cmocka_unit_test(same_seed_same_frames),     cmocka_unit_test(suggested_settings),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
