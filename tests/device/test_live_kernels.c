/* Every variant of the loops that encode a row of a moving picture, against the formula in double. */
#include "device/live_kernels.h"
#include "support.h"

enum { MOST = 131, COLOURS = CLT_LIVE_COLOURS };

static void fill(float *values, size_t count, double low, double high, uint64_t *random) {
  for (size_t k = 0; k < count; k++) {
    values[k] = (float)(low + (high - low) * test_random(random));
  }
}

static void check_split(const clt_live_row_kernels *variant, size_t count, uint64_t *random) {
  uint8_t codes[COLOURS * MOST], plane[COLOURS * MOST];
  for (size_t k = 0; k < COLOURS * count; k++) {
    codes[k] = (uint8_t)(256 * test_random(random));
  }
  variant->split(codes, count, plane);
  for (size_t k = 0; k < COLOURS * count; k++) {
    assert_int_equal(plane[k % COLOURS * count + k / COLOURS], codes[k]);
  }
}

/* Columns between cells that lie close together, and far apart. */
static void check_expand(const clt_live_row_kernels *variant, size_t count, uint64_t *random) {
  const double cells_a_column = count % 3 == 0 ? 1.9 : test_random(random);
  float own[2 * MOST + CLT_LIVE_PAD], part[MOST], out[MOST + 1];
  int32_t at[MOST];
  fill(own, 2 * MOST + CLT_LIVE_PAD, -1, 1, random);
  fill(part, count, 0, 1, random);
  for (size_t x = 0; x < count; x++) {
    at[x] = (int32_t)(cells_a_column * (double)x);
  }
  out[count] = 9;
  variant->expand(own, at, part, count, out);
  for (size_t x = 0; x < count; x++) {
    const double value = (double)own[at[x]], next = (double)own[at[x] + 1];
    assert_near(out[x], value + (double)part[x] * (next - value), 4e-7);
  }
  assert_near(out[count], 9, 0);
}

static void check_interpolate(const clt_live_row_kernels *variant, size_t count, uint64_t *random) {
  enum { PIECES = 17 };
  clt_live_piece piece[PIECES];
  int32_t at[MOST];
  float part[MOST], out[MOST + 1];
  fill(&piece[0].value, 2 * PIECES, -1, 1, random);
  fill(part, count, 0, 1, random);
  for (size_t x = 0; x < count; x++) {
    at[x] = (int32_t)(PIECES * test_random(random));
  }
  out[count] = 9;
  variant->interpolate(piece, at, part, count, out);
  for (size_t x = 0; x < count; x++) {
    const clt_live_piece own = piece[at[x]];
    assert_near(out[x], (double)own.value + (double)part[x] * (double)own.step, 2e-7);
  }
  assert_near(out[count], 9, 0);
}

static void check_drive(const clt_live_row_kernels *variant, size_t count, uint64_t *random) {
  float gains[2][MOST], offsets[2][MOST], light[MOST], drive[MOST];
  const float down = (float)test_random(random);
  fill(light, count, 0, 1, random);
  for (int k = 0; k < 2; k++) {
    fill(gains[k], count, 0, 1.5, random);
    fill(offsets[k], count, -0.6, 0.6, random);
  }
  gains[0][0] = NAN;
  const clt_live_field gain = {gains[0], gains[1]}, offset = {offsets[0], offsets[1]};
  variant->drive(&gain, &offset, down, light, count, drive);
  assert_near(drive[0], 0, 0);
  for (size_t x = 1; x < count; x++) {
    const double lower = (double)down, upper = 1 - lower;
    const double by = upper * (double)gains[0][x] + lower * (double)gains[1][x];
    const double more = upper * (double)offsets[0][x] + lower * (double)offsets[1][x];
    assert_near(drive[x], fmin(fmax(by * (double)light[x] + more, 0), 1), 5e-7);
  }
}

/* A piece begins at 2^octave (1 + k / 64) - 2^-20; the ends of light lie in the first and the last. */
static void check_place(const clt_live_row_kernels *variant, size_t count, uint64_t *random) {
  float light[MOST], part[MOST];
  int32_t at[MOST];
  for (size_t x = 0; x < count; x++) {
    light[x] = (float)pow(10, -7 * test_random(random));
  }
  light[0] = 1;
  light[count - 1] = count > 1 ? 0 : light[count - 1];
  variant->place(light, count, at, part);
  for (size_t x = 0; x < count; x++) {
    assert_true(at[x] >= 0 && at[x] < CLT_LIVE_PIECES && part[x] >= 0 && part[x] < 1);
    const double found = ldexp(1 + (at[x] % 64 + (double)part[x]) / 64, at[x] / 64 - 20) - 0x1p-20;
    assert_near(found, light[x], 1e-7 * (double)light[x] + 1e-13);
  }
  assert_int_equal(at[0], CLT_LIVE_PIECES - 1);
}

/* Codes over light of any brightness, for responses from straight to steep. */
static void tables_are_those_of_responses(void **state) {
  (void)state;
  enum { COUNT = 20000 };
  const clt_live_row_kernels *rows = clt_live_row_choose();
  static float light[COUNT], part[COUNT], code[COUNT];
  static int32_t at[COUNT];
  for (int n = 0; n < 13; n++) {
    const clt_curve response =
        n == 12 ? (clt_curve){.kind = CLT_CURVE_SRGB} : (clt_curve){.kind = CLT_CURVE_GAMMA, .gamma = 1 + 0.2 * n};
    clt_live_piece piece[CLT_LIVE_PIECES];
    uint64_t random = 3 + (uint64_t)n;
    for (int k = 0; k < COUNT; k++) {
      light[k] = (float)(k % 2 ? test_random(&random) : pow(10, -7 * test_random(&random)));
    }
    light[0] = 0, light[1] = 1;
    clt_live_tabulate(&response, piece);
    rows->place(light, COUNT, at, part);
    rows->interpolate(piece, at, part, COUNT, code);
    for (int k = 0; k < COUNT; k++) {
      assert_near(code[k], clt_curve_encode(&response, (double)light[k]), 1e-5);
    }
  }
}

/* One of the two steps beside a code, the same by every variant and wherever a run begins. */
static void check_dither(const clt_live_row_kernels *variant, size_t count, uint64_t *random) {
  const float full = 255;
  const uint32_t start = (uint32_t)(4e9 * test_random(random));
  const size_t from = count / 3;
  float codes[MOST], own[MOST], first[MOST];
  size_t last = 0;
  while (clt_live_row_variants[last + 1] != NULL) {
    last++;
  }
  fill(codes, count, 0, 1, random);
  memcpy(own, codes, sizeof own);
  memcpy(first, codes, sizeof first);
  variant->dither(own, from, full, start);
  variant->dither(own + from, count - from, full, start + (uint32_t)from);
  clt_live_row_variants[last]->dither(first, count, full, start);
  for (size_t k = 0; k < count; k++) {
    assert_near(own[k], first[k], 0);
    assert_near((double)(own[k] * full), rint((double)(own[k] * full)), 1e-4);
    assert_true(fabs((double)(own[k] - codes[k])) * (double)full < 1.0001);
  }
}

/* Steps of dither, put together. */
static void check_paint(const clt_live_row_kernels *variant, size_t count, uint64_t *random) {
  const uint32_t start[COLOURS] = {(uint32_t)(4e9 * test_random(random)), 7, UINT32_MAX - 5};
  float codes[COLOURS][MOST];
  uint32_t pixels[MOST + 1];
  fill(codes[0], COLOURS * MOST, 0, 1, random);
  codes[0][0] = 1, codes[1][0] = 0;
  pixels[count] = 9;
  variant->paint((const float *const[COLOURS]){codes[0], codes[1], codes[2]}, start, count, pixels);
  for (size_t c = 0; c < COLOURS; c++) {
    variant->dither(codes[c], count, 255, start[c]);
  }
  for (size_t x = 0; x < count; x++) {
    const long red = lround(255 * (double)codes[0][x]), green = lround(255 * (double)codes[1][x]);
    assert_int_equal(pixels[x], red << 16 | green << 8 | lround(255 * (double)codes[2][x]));
  }
  assert_int_equal(pixels[count], 9);
}

static void variants_are_those_of_the_formula(void **state) {
  (void)state;
  for (size_t v = 0; clt_live_row_variants[v] != NULL; v++) {
    uint64_t random = 5;
    for (size_t count = 1; clt_live_row_variants[v]->runs_here() && count <= MOST; count++) {
      check_split(clt_live_row_variants[v], count, &random);
      check_expand(clt_live_row_variants[v], count, &random);
      check_interpolate(clt_live_row_variants[v], count, &random);
      check_drive(clt_live_row_variants[v], count, &random);
      check_place(clt_live_row_variants[v], count, &random);
      check_dither(clt_live_row_variants[v], count, &random);
      check_paint(clt_live_row_variants[v], count, &random);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(variants_are_those_of_the_formula),
                                     cmocka_unit_test(tables_are_those_of_responses)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
