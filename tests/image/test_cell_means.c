/* sRGB codes averaged over cells, and the kernels that do it, against the definition in double. */
#include "image/cell_means.h"
#include "image/light_kernels.h"
#include "support.h"

enum { COLOURS = 3 };

static double linear(uint8_t code) {
  double v = code / 255.0;
  return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

/* Dark as well as bright codes: a relative error shows in both. */
static uint8_t *random_codes(size_t count, uint64_t seed) {
  uint8_t *codes = malloc(count);
  for (size_t k = 0; k < count; k++) {
    codes[k] = (uint8_t)(test_random(&seed) < 0.5 ? 256 * test_random(&seed) : 12 * test_random(&seed));
  }
  return codes;
}

/* Mean over [left, right) x [top, bottom), in pixels of the content. */
static double area_mean(const uint8_t *content, int width, int c, double left, double right, double top,
                        double bottom) {
  double sum = 0;
  for (int y = (int)top; y < bottom; y++) {
    for (int x = (int)left; x < right; x++) {
      double across = fmin(right, x + 1) - fmax(left, x), down = fmin(bottom, y + 1) - fmax(top, y);
      sum += across * down * linear(content[(y * width + x) * COLOURS + c]);
    }
  }
  return sum / ((right - left) * (bottom - top));
}

static void check_means(int content_width, int content_height, int width, int height, uint64_t seed) {
  uint8_t *content = random_codes((size_t)(content_width * content_height * COLOURS), seed);
  float *means = malloc((size_t)(width * height) * COLOURS * sizeof *means);
  clt_error error = {0};
  assert_ok(clt_cell_means(content, content_width, content_height, width, height, means, &error), error);
  for (int k = 0; k < width * height * COLOURS; k++) {
    int x = k % width, y = k / width % height;
    double left = (double)(x * content_width) / width, right = (double)((x + 1) * content_width) / width;
    double top = (double)(y * content_height) / height, bottom = (double)((y + 1) * content_height) / height;
    double mean = area_mean(content, content_width, k / (width * height), left, right, top, bottom);
    assert_near(means[k], mean, 1e-6 * mean);
  }
  free(content);
  free(means);
}

/* Of whole pixels, of parts, of less than one, and of pictures that threads share. */
static void means_are_those_of_the_area(void **state) {
  (void)state;
  static const int sizes[][4] = {{64, 48, 16, 12}, {67, 31, 16, 12}, {23, 17, 23, 17},   {5, 3, 11, 8},
                                 {1, 1, 3, 2},     {129, 64, 1, 1},  {241, 137, 64, 36}, {40, 700, 13, 299}};
  for (uint64_t seed = 1; seed <= 3; seed++) {
    for (size_t n = 0; n < sizeof sizes / sizeof sizes[0]; n++) {
      check_means(sizes[n][0], sizes[n][1], sizes[n][2], sizes[n][3], 100 * seed + n);
    }
  }
}

/* The rounded light of every code, whatever the count and wherever codes and light begin. */
static void variants_look_up_the_light(void **state) {
  (void)state;
  enum { MOST = 300 };
  clt_light_table table;
  clt_light_fill(&table);
  for (size_t v = 0; clt_light_variants[v] != NULL; v++) {
    for (size_t count = 0; clt_light_variants[v]->runs_here() && count <= MOST; count++) {
      uint8_t *codes = random_codes(count + 1, count);
      float light[MOST + 2];
      light[count + 1] = -1;
      for (size_t k = 0; k < count && count == MOST; k++) {
        codes[k + 1] = (uint8_t)k;
      }
      clt_light_variants[v]->look_up(&table, codes + 1, count, light + 1);
      for (size_t k = 0; k < count; k++) {
        assert_near(light[k + 1], linear(codes[k + 1]), 0x1p-24 * linear(codes[k + 1]));
      }
      assert_near(light[count + 1], -1, 0);
      free(codes);
    }
  }
}

static void check_sums(const clt_light_kernels *variant, const clt_light_table *table, size_t count, size_t rows,
                       uint64_t seed) {
  const size_t stride = count + 3;
  uint8_t *codes = random_codes(stride * (rows + 1), seed);
  const clt_light_rows of = {codes + stride, stride, rows, (float)test_random(&seed), (float)test_random(&seed)};
  float *kept = malloc((count + 1) * sizeof *kept), *sums = malloc((count + 1) * sizeof *sums);
  variant->look_up(table, codes, count, kept);
  kept[count] = sums[count] = -1;
  variant->add_rows(table, &of, count, kept, sums);
  for (size_t k = 0; k < count; k++) {
    double sum = (double)of.before * linear(codes[k]);
    for (size_t r = 1; r <= rows; r++) {
      sum += (r < rows ? 1 : (double)of.after) * linear(codes[r * stride + k]);
    }
    assert_near(sums[k], sum, 4e-7 * sum);
    assert_near(kept[k], linear(codes[rows * stride + k]), 1e-7 * linear(codes[rows * stride + k]));
  }
  assert_near(kept[count], -1, 0);
  assert_near(sums[count], -1, 0);
  free(codes);
  free(kept);
  free(sums);
}

static void variants_add_rows(void **state) {
  (void)state;
  clt_light_table table;
  clt_light_fill(&table);
  for (size_t v = 0; clt_light_variants[v] != NULL; v++) {
    for (size_t n = 0; clt_light_variants[v]->runs_here() && n < 160; n++) {
      check_sums(clt_light_variants[v], &table, n % 2 ? n : 8 * n, n % 6, 7 + n);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(means_are_those_of_the_area),
      cmocka_unit_test(variants_look_up_the_light),
      cmocka_unit_test(variants_add_rows),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
