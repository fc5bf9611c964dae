#include "counterlight/image.h"
#include "support.h"

static clt_image random_image(int channels, int height, int width, uint64_t seed) {
  clt_image image;
  clt_error error = {0};
  assert_ok(clt_image_init(&image, channels, height, width, &error), error);
  for (size_t i = 0; i < clt_image_size(&image); i++) {
    image.data[i] = (float)(3 * test_random(&seed) - 1);
  }
  return image;
}

static double sample(const clt_image *image, int c, int y, int x) {
  return image->data[((size_t)c * (size_t)image->height + (size_t)y) * (size_t)image->width + (size_t)x];
}

static int between(int low, int high, uint64_t *seed) {
  return low + (int)(test_random(seed) * (high - low + 1));
}

/* Length of the part that a..b and c..d share. */
static double shared(double a, double b, double c, double d) {
  return fmax(0, fmin(b, d) - fmax(a, c));
}

/* The mean of the picture, piecewise constant over its pixels, over a rectangle: every pixel is asked for its share. */
static double mean_over(const clt_image *in, int c, double top, double bottom, double left, double right) {
  double sum = 0;
  for (int y = 0; y < in->height; y++) {
    for (int x = 0; x < in->width; x++) {
      sum += sample(in, c, y, x) * shared(top, bottom, y, y + 1) * shared(left, right, x, x + 1);
    }
  }
  return sum / ((bottom - top) * (right - left));
}

/* The centred part of the input with the output's aspect ratio. */
typedef struct crop {
  double top, left, height, width;
} crop;

static crop centre(const clt_image *in, int height, int width) {
  double scale = fmin((double)in->height / height, (double)in->width / width);
  crop part = {.height = height * scale, .width = width * scale};
  part.top = (in->height - part.height) / 2;
  part.left = (in->width - part.width) / 2;
  return part;
}

static void compare_with_brute_force(uint64_t seed) {
  int height = between(1, 9, &seed), width = between(1, 9, &seed), channels = between(1, 3, &seed);
  clt_image in = random_image(channels, between(height, 40, &seed), between(width, 40, &seed), seed), out;
  clt_error error = {0};
  assert_ok(clt_image_resize(&in, height, width, &out, &error), error);
  assert_int_equal(out.channels, channels);
  crop part = centre(&in, height, width);
  for (int c = 0; c < channels; c++) {
    for (int y = 0; y < height; y++) {
      for (int x = 0; x < width; x++) {
        double top = part.top + part.height * y / height, left = part.left + part.width * x / width;
        double wanted = mean_over(&in, c, top, top + part.height / height, left, left + part.width / width);
        assert_near(sample(&out, c, y, x), wanted, 4e-7);
      }
    }
  }
  clt_image_finish(&in);
  clt_image_finish(&out);
}

static void shrinking_takes_exact_area_averages(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 60; seed++) {
    compare_with_brute_force(seed);
  }
}

static void shrinking_conserves_energy(void **state) {
  (void)state;
  static const int sizes[][4] = {{400, 600, 32, 48}, {400, 600, 48, 64}, {97, 101, 13, 17}, {50, 70, 49, 69}};
  for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
    clt_image in = random_image(1, sizes[k][0], sizes[k][1], k + 1), out;
    clt_error error = {0};
    assert_ok(clt_image_resize(&in, sizes[k][2], sizes[k][3], &out, &error), error);
    crop part = centre(&in, out.height, out.width);
    double mean = 0;
    for (size_t i = 0; i < clt_image_size(&out); i++) {
      mean += out.data[i] / (double)clt_image_size(&out);
    }
    assert_near(mean, mean_over(&in, 0, part.top, part.top + part.height, part.left, part.left + part.width), 1e-7);
    clt_image_finish(&in);
    clt_image_finish(&out);
  }
}

static void equal_sizes_and_whole_crops_are_bit_exact(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image in = random_image(3, 20, 31, 4), out;
  assert_ok(clt_image_resize(&in, 20, 31, &out, &error), error);
  assert_memory_equal(out.data, in.data, clt_image_size(&in) * sizeof(float));
  assert_ptr_not_equal(out.data, in.data);
  clt_image_finish(&out);
  assert_ok(clt_image_resize(&in, 20, 21, &out, &error), error); /* five columns off each side */
  for (int y = 0; y < 20; y++) {
    assert_memory_equal(out.data + y * 21, in.data + y * 31 + 5, 21 * sizeof(float));
  }
  clt_image_finish(&out);
  clt_image_finish(&in);
}

/* Bilinear at a point in pixel coordinates whose whole numbers are pixel centres. */
static double interpolate(const clt_image *in, double y, double x) {
  y = fmax(0, fmin(in->height - 1, y)), x = fmax(0, fmin(in->width - 1, x));
  int top = (int)y, left = (int)x;
  int bottom = top + 1 < in->height ? top + 1 : top, right = left + 1 < in->width ? left + 1 : left;
  double v = y - top, u = x - left;
  return (1 - v) * ((1 - u) * sample(in, 0, top, left) + u * sample(in, 0, top, right)) +
         v * ((1 - u) * sample(in, 0, bottom, left) + u * sample(in, 0, bottom, right));
}

static void magnifying_is_bilinear(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 60; seed++) {
    uint64_t s = seed;
    clt_error error = {0};
    clt_image in = random_image(1, between(1, 12, &s), between(1, 12, &s), seed), out;
    assert_ok(clt_image_resize(&in, between(in.height + 1, 40, &s), between(in.width + 1, 40, &s), &out, &error),
              error);
    crop part = centre(&in, out.height, out.width);
    for (int y = 0; y < out.height; y++) {
      for (int x = 0; x < out.width; x++) {
        double at_y = part.top + part.height * (y + 0.5) / out.height - 0.5;
        double at_x = part.left + part.width * (x + 0.5) / out.width - 0.5;
        assert_near(sample(&out, 0, y, x), interpolate(&in, at_y, at_x), 4e-7);
      }
    }
    clt_image_finish(&in);
    clt_image_finish(&out);
  }
}

static void a_flat_picture_stays_flat(void **state) {
  (void)state;
  static const int sizes[][2] = {{1, 1}, {2, 9}, {17, 23}, {100, 3}, {64, 48}};
  clt_error error = {0};
  clt_image in = random_image(1, 23, 17, 1), out;
  for (size_t i = 0; i < clt_image_size(&in); i++) {
    in.data[i] = 0.7F;
  }
  for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
    assert_ok(clt_image_resize(&in, sizes[k][0], sizes[k][1], &out, &error), error);
    for (size_t i = 0; i < clt_image_size(&out); i++) {
      assert_near(out.data[i], 0.7F, 1e-7);
    }
    clt_image_finish(&out);
  }
  clt_image_finish(&in);
}

static void impossible_sizes_are_refused(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image in = random_image(1, 2, 2, 1), empty = {0}, out;
  assert_int_equal(clt_image_resize(&in, 0, 5, &out, &error), CLT_BAD_INPUT);
  assert_null(out.data);
  assert_int_equal(clt_image_resize(&in, 5, 40000, &out, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_image_resize(&empty, 5, 5, &out, &error), CLT_BAD_INPUT);
  assert_null(out.data);
  clt_image_finish(&in);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(shrinking_takes_exact_area_averages),
      cmocka_unit_test(shrinking_conserves_energy),
      cmocka_unit_test(equal_sizes_and_whole_crops_are_bit_exact),
      cmocka_unit_test(magnifying_is_bilinear),
      cmocka_unit_test(a_flat_picture_stays_flat),
      cmocka_unit_test(impossible_sizes_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
