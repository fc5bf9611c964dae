/* Moving pictures on the processor, against the formula in double. */
#include "counterlight/device.h"
#include "device/live_encode.h"
#include "support.h"

enum { COLOURS = 3 };

typedef struct sizes {
  int width, height, grid_width, grid_height, panel_width, panel_height, channels;
} sizes;

static double linear(uint8_t code) {
  double v = code / 255.0;
  return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

/* Mean over [from, to) x [top, bottom) of the content, in its pixels. */
static double area_mean(const clt_live_picture *picture, int c, const double box[4]) {
  double sum = 0;
  for (int y = (int)box[1]; y < picture->height && y < box[3]; y++) {
    for (int x = (int)box[0]; x < picture->width && x < box[2]; x++) {
      double across = fmin(box[2], x + 1) - fmax(box[0], x), down = fmin(box[3], y + 1) - fmax(box[1], y);
      sum += across > 0 && down > 0 ? across * down * linear(picture->content[(y * picture->width + x) * 3 + c]) : 0;
    }
  }
  return sum / ((box[2] - box[0]) * (box[3] - box[1]));
}

static double bilinear(const float *field, int width, int height, double x, double y) {
  x = fmin(fmax(x, 0), width - 1), y = fmin(fmax(y, 0), height - 1);
  double sum = 0;
  for (int j = 0; j < height; j++) {
    for (int i = 0; i < width; i++) {
      sum += fmax(0, 1 - fabs(x - i)) * fmax(0, 1 - fabs(y - j)) * field[j * width + i];
    }
  }
  return sum;
}

/* The light that pixel (x, y) should give. */
static void wanted_light(const clt_live_picture *picture, const sizes *s, int x, int y, double light[COLOURS]) {
  double across = (double)picture->width / s->panel_width, down = (double)picture->height / s->panel_height;
  const double box[4] = {x * across, y * down, (x + 1) * across, (y + 1) * down};
  double content[COLOURS];
  for (int c = 0; c < COLOURS; c++) {
    content[c] = area_mean(picture, c, box);
  }
  if (s->channels == 1) {
    content[0] = 0.2126 * content[0] + 0.7152 * content[1] + 0.0722 * content[2];
  }
  for (int c = 0; c < s->channels; c++) {
    size_t plane = (size_t)c * (size_t)(s->grid_width * s->grid_height);
    double u = (x + 0.5) * s->grid_width / s->panel_width - 0.5, v = (y + 0.5) * s->grid_height / s->panel_height - 0.5;
    double drive = bilinear(picture->gain + plane, s->grid_width, s->grid_height, u, v) * content[c] +
                   bilinear(picture->offset + plane, s->grid_width, s->grid_height, u, v);
    light[c] = fmin(fmax(drive, 0), 1);
  }
}

/* In one pass: the same codes, dithered, as bytes. */
static void compare_painted(const clt_live_picture *picture, const sizes *s, float *codes) {
  clt_error error = {0};
  const size_t plane = (size_t)s->panel_width * (size_t)s->panel_height;
  uint32_t *pixels = malloc(plane * sizeof *pixels);
  assert_ok(clt_live_paint(picture, s->panel_height, s->panel_width, pixels, &error), error);
  clt_live_dither(codes, COLOURS * plane, 8, picture->seed);
  for (size_t k = 0; k < plane; k++) {
    const unsigned step[COLOURS] = {pixels[k] >> 16, pixels[k] >> 8 & 255, pixels[k] & 255};
    for (size_t c = 0; c < COLOURS; c++) {
      assert_near(step[c], 255 * (double)codes[c * plane + k], 1e-4);
    }
  }
  free(pixels);
}

static void compare(const clt_live_picture *picture, const sizes *s) {
  clt_error error = {0};
  size_t plane = (size_t)s->panel_width * (size_t)s->panel_height;
  float *codes = malloc(COLOURS * plane * sizeof *codes);
  assert_ok(clt_live_encode(picture, s->channels, s->panel_height, s->panel_width, codes, &error), error);
  const clt_panel *panel = &picture->panel;
  for (int y = 0; y < s->panel_height; y++) {
    for (int x = 0; x < s->panel_width; x++) {
      double light[COLOURS];
      wanted_light(picture, s, x, y, light);
      for (int k = 0; k < s->channels; k++) {
        double own = light[k];
        if (panel->mixes && s->channels == COLOURS) {
          own = panel->unmix[k][0] * light[0] + panel->unmix[k][1] * light[1] + panel->unmix[k][2] * light[2];
        }
        double code = clt_curve_encode(&panel->response[k], own);
        assert_near(codes[(size_t)k * plane + (size_t)(y * s->panel_width + x)], code, 1e-4);
      }
    }
  }
  if (s->channels == COLOURS) {
    compare_painted(picture, s, codes);
  }
  free(codes);
}

static void codes_are_those_of_the_formula(void **state) {
  (void)state;
  static const sizes cases[] = {{24, 18, 6, 5, 24, 18, 3}, {37, 29, 8, 6, 16, 12, 3},   {7, 5, 4, 3, 20, 15, 3},
                                {16, 9, 16, 9, 16, 9, 3},  {1, 1, 1, 1, 5, 4, 3},       {21, 13, 5, 4, 10, 9, 1},
                                {19, 11, 8, 9, 19, 5, 3},  {37, 29, 8, 6, 201, 113, 3}, /* of threads */
                                {9, 8, 16, 9, 10, 8, 3}};
  const double mix[9] = {0.9, 0.07, 0.03, 0.05, 0.9, 0.05, 0.02, 0.08, 0.9};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    const sizes *s = &cases[n];
    uint64_t random = 11 + n;
    uint8_t content[37 * 29 * 3];
    float gain[3 * 16 * 9], offset[3 * 16 * 9];
    for (int i = 0; i < s->width * s->height * 3; i++) {
      content[i] = (uint8_t)(256 * test_random(&random));
    }
    for (int i = 0; i < 3 * s->grid_width * s->grid_height; i++) {
      gain[i] = (float)(1.5 * test_random(&random));
      offset[i] = (float)(0.6 * test_random(&random) - 0.4);
    }
    clt_live_picture picture = {.width = s->width,
                                .height = s->height,
                                .content = content,
                                .grid_width = s->grid_width,
                                .grid_height = s->grid_height,
                                .gain = gain,
                                .offset = offset,
                                .seed = (uint32_t)n};
    clt_error error = {0};
    picture.panel = clt_panel_of_curve(&(clt_curve){.kind = CLT_CURVE_GAMMA, .gamma = 1.8 + 0.2 * (double)n});
    compare(&picture, s);
    picture.panel = clt_panel_of_curve(&(clt_curve){.kind = n % 2 ? CLT_CURVE_SRGB : CLT_CURVE_LINEAR});
    assert_ok(clt_panel_set_crosstalk(&picture.panel, mix, &error), error);
    compare(&picture, s);
  }
}

/* Steps only, and the mean of many seeds is the code: within 5 standard errors, sd at most half a step. */
static void dither_keeps_the_mean(void **state) {
  (void)state;
  enum { SEEDS = 4000, CODES = 9 };
  const float codes[CODES] = {0, 0.001F, 0.1F, 0.25F, 0.5F, 0.7512F, 0.9F, 0.9999F, 1};
  double sums[CODES] = {0};
  for (uint32_t seed = 0; seed < SEEDS; seed++) {
    float out[CODES];
    memcpy(out, codes, sizeof out);
    clt_live_dither(out, CODES, 8, seed);
    for (int k = 0; k < CODES; k++) {
      double step = 255.0 * (double)out[k];
      assert_near(step, rint(step), 1e-4);
      assert_near(out[k], codes[k], 1.0001 / 255);
      sums[k] += (double)out[k];
    }
  }
  for (int k = 0; k < CODES; k++) {
    assert_near(sums[k] / SEEDS, codes[k], 5 * 0.5 / 255 / sqrt(SEEDS));
  }
  assert_near(sums[0], 0, 0);
  assert_near(sums[CODES - 1], SEEDS, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(codes_are_those_of_the_formula),
      cmocka_unit_test(dither_keeps_the_mean),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
