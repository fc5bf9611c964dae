#include "counterlight/image.h"
#include "support.h"

static void an_image_is_black_and_its_size_is_checked(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image image;
  assert_ok(clt_image_init(&image, 3, 5, 7, &error), error);
  assert_int_equal(clt_image_size(&image), 105);
  for (size_t i = 0; i < 105; i++) {
    assert_true(image.data[i] == 0);
  }
  clt_image_finish(&image);
  assert_null(image.data);
  assert_int_equal(clt_image_size(&image), 0);
  clt_image_finish(&image);
  clt_image_finish(NULL);
  static const int wrong[][3] = {{0, 1, 1}, {5, 1, 1}, {1, 0, 1}, {1, 1, 0}, {1, 32769, 1}, {1, 1, 32769}, {-1, 1, 1}};
  for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
    assert_int_equal(clt_image_init(&image, wrong[k][0], wrong[k][1], wrong[k][2], &error), CLT_BAD_INPUT);
    assert_null(image.data);
  }
}

static void fill(clt_image *image, uint64_t seed) {
  for (size_t i = 0; i < clt_image_size(image); i++) {
    image->data[i] = (float)(2 * test_random(&seed));
  }
}

static void channels_are_repeated_averaged_or_kept(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image grey, colour, back, same;
  assert_ok(clt_image_init(&grey, 1, 4, 6, &error), error);
  fill(&grey, 1);
  assert_ok(clt_image_convert(&grey, 3, &colour, &error), error);
  for (int c = 0; c < 3; c++) {
    assert_memory_equal(colour.data + 24 * c, grey.data, 24 * sizeof(float));
  }
  assert_ok(clt_image_convert(&colour, 1, &back, &error), error);
  for (int i = 0; i < 24; i++) {
    assert_near(back.data[i], grey.data[i], 3e-7); /* the three weights sum to 1 */
  }
  clt_image_finish(&back);
  fill(&colour, 2);
  assert_ok(clt_image_convert(&colour, 1, &back, &error), error);
  for (int i = 0; i < 24; i++) {
    double luminance = 0.2126 * colour.data[i] + 0.7152 * colour.data[24 + i] + 0.0722 * colour.data[48 + i];
    assert_near(back.data[i], luminance, 2e-7);
  }
  assert_ok(clt_image_convert(&colour, 3, &same, &error), error);
  assert_memory_equal(same.data, colour.data, 72 * sizeof(float));
  clt_image_finish(&same);
  assert_int_equal(clt_image_convert(&colour, 2, &same, &error), CLT_BAD_INPUT);
  assert_null(same.data);
  assert_int_equal(clt_image_convert(&grey, 5, &same, &error), CLT_BAD_INPUT);
  clt_image_finish(&grey);
  clt_image_finish(&colour);
  clt_image_finish(&back);
}

/* CIE 1976 lightness of linear sRGB. */
static double lightness(const clt_image *image, int i) {
  int plane = image->width;
  double y = 0.2126 * image->data[i] + 0.7152 * image->data[plane + i] + 0.0722 * image->data[2 * plane + i];
  return y > 216 / 24389.0 ? 116 * cbrt(y) - 16 : y * 24389 / 27;
}

static void a_heat_map_is_brighter_where_values_are_larger(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image values, map;
  enum { STEPS = 1001 };
  const double top = 0.37;
  assert_ok(clt_image_init(&values, 1, 1, STEPS, &error), error);
  for (int i = 0; i < STEPS; i++) {
    values.data[i] = (float)(top * i / (STEPS - 1));
  }
  assert_ok(clt_image_heatmap(&values, top, &map, &error), error);
  assert_int_equal(map.channels, 3);
  for (int i = 1; i < STEPS; i++) {
    assert_true(lightness(&map, i) > lightness(&map, i - 1));
  }
  assert_true(lightness(&map, 0) < 1 && lightness(&map, STEPS - 1) > 95);
  for (int i = 0; i < STEPS; i++) { /* even steps of value are even steps of lightness */
    assert_near(lightness(&map, i), 100.0 * i / (STEPS - 1), 8);
  }
  clt_image_finish(&map);
  clt_image_finish(&values);
}

static void a_heat_map_clips(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image values, map;
  assert_ok(clt_image_init(&values, 1, 1, 6, &error), error);
  memcpy(values.data, (const float[]){0, -1, NAN, 2, 3, INFINITY}, 6 * sizeof(float));
  assert_ok(clt_image_heatmap(&values, 2, &map, &error), error);
  for (int c = 0; c < 3; c++) {
    for (int i = 1; i < 6; i++) {
      assert_true(map.data[6 * c + i] == map.data[6 * c + (i < 3 ? 0 : 3)]);
    }
  }
  clt_image_finish(&map);
  static const double wrong[] = {0, -1, NAN, INFINITY};
  for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
    assert_int_equal(clt_image_heatmap(&values, wrong[k], &map, &error), CLT_BAD_INPUT);
    assert_null(map.data);
  }
  clt_image_finish(&values);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(an_image_is_black_and_its_size_is_checked),
      cmocka_unit_test(channels_are_repeated_averaged_or_kept),
      cmocka_unit_test(a_heat_map_is_brighter_where_values_are_larger),
      cmocka_unit_test(a_heat_map_clips),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
