/* Panels: what the codes of a drive give, recomputed forwards. */
#include "counterlight/panel.h"
#include "support.h"

static const double mixed[9] = {1, 0.08, 0.02, 0.1, 2, 0.06, 0.03, 0.09, 0.5};

/* Light of channel c that codes give, by the definition. */
static double light_of(const clt_panel *panel, const float *codes, size_t plane, size_t pixel, int c) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    double row = mixed[3 * c] + mixed[3 * c + 1] + mixed[3 * c + 2];
    sum += mixed[3 * c + k] / row * clt_curve_decode(&panel->response[k], (double)codes[(size_t)k * plane + pixel]);
  }
  return sum;
}

static void codes_give_the_light_that_was_asked_for(void **state) {
  (void)state;
  clt_panel panel = {
      .response = {{.kind = CLT_CURVE_GAMMA, .gamma = 2.2}, {.kind = CLT_CURVE_SRGB}, {.kind = CLT_CURVE_LINEAR}}};
  clt_error error = {0};
  clt_image drive = {0};
  float codes[3 * 60];
  uint64_t random = 4;
  assert_ok(clt_panel_set_crosstalk(&panel, mixed, &error), error);
  assert_ok(clt_image_init(&drive, 3, 3, 5, &error), error);
  for (int i = 0; i < 45; i++) { /* near grey, where every light can be made */
    drive.data[i] = 0.4f + 0.2f * (float)test_random(&random);
  }
  for (int c = 0; c < 3; c++) {
    drive.data[15 * c] = 1;
    drive.data[15 * c + 1] = 0;
  }
  clt_panel_encode(&panel, &drive, 3, 6, 10, codes);
  for (size_t p = 0; p < 60; p++) {
    for (int c = 0; c < 3; c++) {
      double wanted = (double)drive.data[15 * c + (int)(p / 20) * 5 + (int)(p % 10) / 2];
      assert_near(light_of(&panel, codes, 60, p, c), wanted, 1e-6);
    }
  }
  for (int c = 0; c < 3; c++) { /* white is the white panel */
    assert_near(codes[60 * c], 1, 1e-6);
  }
  clt_image_finish(&drive);
}

/* Pure red asks for less than no green and blue: these are clipped, red goes as far as it can. */
static void light_beyond_the_panel_is_clipped(void **state) {
  (void)state;
  clt_panel panel = {.mixes = false};
  clt_error error = {0};
  float codes[3], data[3] = {1, 0, 0};
  clt_image drive = {3, 1, 1, data};
  assert_ok(clt_panel_set_crosstalk(&panel, mixed, &error), error);
  clt_panel_encode(&panel, &drive, 3, 1, 1, codes);
  assert_near(codes[0], 1, 0);
  assert_near(codes[1], 0, 0);
  assert_near(codes[2], 0, 0);
}

/* A panel that no multiple of the grid divides: pixel p belongs to cell p * cells / pixels, as it always did. */
static void cells_share_out_any_panel(void **state) {
  (void)state;
  static const int sizes[][4] = {{4, 3, 8, 9}, {5, 4, 17, 11}, {7, 5, 7, 5}, {3, 3, 64, 100}};
  static float codes[3 * 64 * 100];
  clt_curve curve = {.kind = CLT_CURVE_GAMMA, .gamma = 2};
  clt_panel panel = clt_panel_of_curve(&curve);
  for (size_t n = 0; n < sizeof sizes / sizeof sizes[0]; n++) {
    int gw = sizes[n][0], gh = sizes[n][1], pw = sizes[n][2], ph = sizes[n][3];
    clt_error error = {0};
    clt_image drive = {0};
    assert_ok(clt_image_init(&drive, 1, gh, gw, &error), error);
    for (int i = 0; i < gw * gh; i++) {
      drive.data[i] = (float)i / (float)(gw * gh);
    }
    clt_panel_encode(&panel, &drive, 3, ph, pw, codes);
    for (int k = 0; k < 3 * pw * ph; k++) {
      int x = k % pw, y = k / pw % ph;
      double light = (double)drive.data[y * gh / ph * gw + x * gw / pw];
      assert_near(codes[k], sqrt(light), 1e-6);
    }
    clt_image_finish(&drive);
  }
}

/* Rounded to a code of `bits`, in double; what a panel gives exactly stays. */
static void what_is_shown_is_rounded(void **state) {
  (void)state;
  static const int depths[] = {1, 6, 8, 10, 16};
  const clt_curve curve = {.kind = CLT_CURVE_GAMMA, .gamma = 2.2};
  clt_panel panel = clt_panel_of_curve(&curve);
  clt_error error = {0};
  clt_image drive = {0}, shown = {0};
  assert_ok(clt_image_init(&drive, 3, 5, 20, &error), error);
  for (int i = 0; i < 300; i++) {
    drive.data[i] = (float)(i % 100) / 99;
  }
  for (size_t n = 0; n < sizeof depths / sizeof depths[0]; n++) {
    double top = (1 << depths[n]) - 1;
    assert_ok(clt_panel_shown(&panel, depths[n], &drive, &shown, &error), error);
    for (int i = 0; i < 300; i++) {
      double code = round(pow((double)drive.data[i], 1 / 2.2) * top) / top;
      assert_near(shown.data[i], pow(code, 2.2), 1e-6);
    }
    clt_image_finish(&shown);
  }
  clt_image_finish(&drive);
}

static void hopeless_panels_are_refused(void **state) {
  (void)state;
  const double grey[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1}, dark[9] = {1, 0, 0, 0, 0, 0, 0, 0, 1};
  clt_panel panel = {.mixes = false};
  clt_error error = {0};
  assert_int_equal(clt_panel_set_crosstalk(&panel, grey, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "look alike"));
  assert_false(panel.mixes);
  assert_int_equal(clt_panel_set_crosstalk(&panel, dark, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "no light in channel 1"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(codes_give_the_light_that_was_asked_for),
      cmocka_unit_test(light_beyond_the_panel_is_clipped),
      cmocka_unit_test(cells_share_out_any_panel),
      cmocka_unit_test(what_is_shown_is_rounded),
      cmocka_unit_test(hopeless_panels_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
