/* The storages of a dense T: what becomes of entries, products against sums in double, every variant of a kernel, and
 * what a storage costs in the compensated picture. */
#include <omp.h>

#include "../solve/rooms.h"
#include "storages.h"
#include "transport/kernels.h"
#include "transport/kind.h"

enum { SEEDS = 3 };

static void check_entries(const known_transport *known, const storage_case *storage) {
  clt_transport *made = convert(known->transport, storage->name);
  const clt_transport_info info = clt_transport_describe(made);
  double *sums = calloc(info.rows, sizeof *sums), *bound = calloc(info.cols, sizeof *bound);
  for (int c = 0; c < info.channels; c++) {
    const double *wanted = known->reference + (size_t)c * info.rows * info.cols;
    double *ours = rows_of(made, c);
    clt_transport_row_sums(made, c, sums);
    for (size_t i = 0; i < info.rows; i++) {
      double sum = 0, exact = 0, size = 0;
      entry_bounds(storage, wanted + i * info.cols, info.cols, i, bound);
      for (size_t j = 0; j < info.cols; j++) {
        const size_t k = i * info.cols + j;
        assert_near(ours[k], wanted[k], bound[j] + 1e-12);
        sum += ours[k];
        exact += wanted[k];
        size += fabs(wanted[k]);
      }
      assert_near(sums[i], sum, 1e-9 * size);
      if (strcmp(storage->name, "dense8") == 0) { /* its rows keep their sums */
        assert_near(sums[i], exact, 2e-7 * size);
      }
    }
    free(ours);
  }
  clt_transport_destroy(made);
  free(sums);
  free(bound);
}

static void test_entries(void **unused) {
  (void)unused;
  for (uint64_t seed = 0; seed < SEEDS * SIZE_CASES; seed++) {
    uint64_t state = seed;
    known_transport known = (seed % 2 == 0 ? contact_dense : random_dense)(&size_cases[seed % SIZE_CASES], &state);
    for (size_t k = 0; k < STORAGES; k++) {
      check_entries(&known, &storage_cases[k]);
    }
    finish_known(&known);
  }
}

/* sum_j T_ij x_j, or with transposed sum_i T_ij x_i, and the same of magnitudes. */
static double exact_sum(const double *entries, size_t rows, size_t cols, bool transposed, size_t at, const double *x,
                        double *size) {
  double sum = 0;
  *size = 0;
  for (size_t k = 0; k < (transposed ? rows : cols); k++) {
    const double term = (transposed ? entries[k * cols + at] : entries[at * cols + k]) * x[k];
    sum += term;
    *size += fabs(term);
  }
  return sum;
}

static void check_products(const clt_transport *made, const storage_case *storage, int channel, double unit,
                           uint64_t *state) {
  const clt_transport_info info = clt_transport_describe(made);
  double *entries = rows_of(made, channel), size, left = 0, right = 0, total = 0;
  double *x = random_vector(info.cols, state), *y = random_vector(info.rows, state);
  double *seen = random_vector(info.rows, state), *back = random_vector(info.cols, state);
  for (size_t j = 0; j < info.cols; j++) {
    x[j] *= unit;
  }
  clt_transport_apply(made, channel, x, seen);
  for (size_t i = 0; i < info.rows; i++) {
    const double wanted = exact_sum(entries, info.rows, info.cols, false, i, x, &size);
    assert_near(seen[i], wanted, storage->rounding * size);
    left += seen[i] * y[i];
    total += size * fabs(y[i]);
  }
  clt_transport_apply_transposed(made, channel, y, back);
  for (size_t j = 0; j < info.cols; j++) {
    const double wanted = exact_sum(entries, info.rows, info.cols, true, j, y, &size);
    assert_near(back[j], wanted, storage->rounding * size);
    right += back[j] * x[j];
  }
  assert_near(left, right, storage->rounding * total); /* <T x, y> = <x, T' y> */
  free(entries);
  free(x);
  free(y);
  free(seen);
  free(back);
}

static void test_products(void **unused) {
  (void)unused;
  static const double units[] = {1, 1e-60, 1e60}; /* of x: beyond what a float can say */
  for (uint64_t seed = 0; seed < SEEDS * SIZE_CASES; seed++) {
    uint64_t state = seed;
    known_transport known = contact_dense(&size_cases[seed % SIZE_CASES], &state);
    for (size_t k = 0; k < STORAGES; k++) {
      clt_transport *made = convert(known.transport, storage_cases[k].name);
      for (int c = 0; c < clt_transport_describe(made).channels; c++) {
        check_products(made, &storage_cases[k], c, units[seed / SIZE_CASES], &state);
      }
      clt_transport_destroy(made);
    }
    finish_known(&known);
  }
}

/* One thread or several, gaps in y or none: the same bits. */
static void test_thread_count(void **unused) {
  (void)unused;
  const size_case size = {96, 71, 1, 300};
  const int before = omp_get_max_threads();
  uint64_t state = 7;
  known_transport known = contact_dense(&size, &state);
  const size_t most = size.rows + 96 * 71;
  double *x = random_vector(most, &state), *one = calloc(3 * most, sizeof *one), *many = calloc(3 * most, sizeof *many);
  for (size_t i = 0; i < most; i += 3) {
    x[i] = 0;
  }
  for (size_t k = 0; k < STORAGES; k++) {
    clt_transport *made = convert(known.transport, storage_cases[k].name);
    for (int threads = 1; threads <= 7; threads += 2) {
      double *out = threads == 1 ? one : many;
      omp_set_num_threads(threads);
      clt_transport_apply(made, 0, x, out);
      clt_transport_apply_transposed(made, 0, x, out + most);
      clt_transport_row_sums(made, 0, out + 2 * most);
      if (threads > 1) {
        assert_memory_equal(one, many, 3 * most * sizeof *one);
      }
    }
    clt_transport_destroy(made);
  }
  omp_set_num_threads(before);
  finish_known(&known);
  free(x);
  free(one);
  free(many);
}

/* Every variant that this processor runs gives the bits of the portable one. */
static void test_half_variants(void **unused) {
  (void)unused;
  enum { MOST = 1024 };
  static uint16_t code[4][MOST];
  static float x[MOST], first[MOST], other[MOST];
  uint64_t state = 3;
  const uint16_t *const codes[] = {code[0] + 1, code[1], code[2], code[3]};
  for (size_t count = 0; count < MOST; count += count < 70 ? 1 : 119) {
    for (size_t k = 0; k < MOST; k++) {
      x[k] = first[k] = other[k] = (float)(test_random(&state) - 0.5);
      for (int r = 0; r < 4; r++) {
        code[r][k] = clt_half_code((float)((test_random(&state) - 0.1) * exp(20 * test_random(&state) - 10)));
      }
    }
    const float y[4] = {0.3f, -0.7f, 0, 1.1f};
    const double wanted = clt_half_variants[0]->dot(code[0] + 1, x, count);
    clt_half_variants[0]->add(codes, y, count, first);
    for (size_t v = 1; clt_half_variants[v] != NULL && clt_half_variants[0]->runs_here(); v++) {
      assert_near(clt_half_variants[v]->dot(code[0] + 1, x, count), wanted, 0);
      memcpy(other, x, sizeof other);
      clt_half_variants[v]->add(codes, y, count, other);
      assert_memory_equal(first, other, sizeof first);
    }
  }
  assert_true(clt_half_choose()->runs_here());
}

static void test_plain_variants(void **unused) {
  (void)unused;
  enum { MOST = 1024 };
  static float single[4][MOST];
  static double exact[4][MOST], x[MOST], first[2][MOST], other[MOST];
  uint64_t state = 5;
  const float *const floats[] = {single[0] + 1, single[1], single[2], single[3]};
  const double *const doubles[] = {exact[0] + 1, exact[1], exact[2], exact[3]};
  const double y[4] = {0.3, -0.7, 0, 1.1};
  for (size_t count = 0; count < MOST; count += count < 70 ? 1 : 119) {
    for (size_t k = 0; k < MOST; k++) {
      x[k] = first[0][k] = first[1][k] = test_random(&state) - 0.5;
      for (int r = 0; r < 4; r++) {
        exact[r][k] = (test_random(&state) - 0.1) * exp(20 * test_random(&state) - 10);
        single[r][k] = (float)exact[r][k];
      }
    }
    double wanted[2][4], sum[4];
    clt_plain_variants[0]->dot_float(floats, x, count, wanted[0]);
    clt_plain_variants[0]->dot_double(doubles, x, count, wanted[1]);
    clt_plain_variants[0]->add_float(floats, y, count, first[0]);
    clt_plain_variants[0]->add_double(doubles, y, count, first[1]);
    for (size_t v = 1; clt_plain_variants[v] != NULL && clt_plain_variants[0]->runs_here(); v++) {
      clt_plain_variants[v]->dot_float(floats, x, count, sum);
      assert_memory_equal(sum, wanted[0], sizeof sum);
      clt_plain_variants[v]->dot_double(doubles, x, count, sum);
      assert_memory_equal(sum, wanted[1], sizeof sum);
      memcpy(other, x, sizeof other);
      clt_plain_variants[v]->add_float(floats, y, count, other);
      assert_memory_equal(other, first[0], sizeof other);
      memcpy(other, x, sizeof other);
      clt_plain_variants[v]->add_double(doubles, y, count, other);
      assert_memory_equal(other, first[1], sizeof other);
    }
  }
  assert_true(clt_plain_choose()->runs_here());
}

/* Four columns both ways at once: the bits of the two kernels that go one way each. */
static void test_pass_variants(void **unused) {
  (void)unused;
  enum { MOST = 512 };
  static float column[4][MOST];
  static double x[MOST], out[MOST], wanted[MOST];
  uint64_t state = 6;
  const float *const columns[] = {column[0] + 1, column[1], column[2], column[3]};
  const double y[4] = {0.3, -0.7, 0, 1.1};
  for (size_t count = 0; count < MOST; count += count < 40 ? 1 : 67) {
    for (size_t k = 0; k < MOST; k++) {
      x[k] = test_random(&state) - 0.5;
      for (int r = 0; r < 4; r++) {
        column[r][k] = (float)((test_random(&state) - 0.1) * exp(20 * test_random(&state) - 10));
      }
    }
    double sum[4], dots[4];
    memcpy(wanted, x, sizeof wanted);
    clt_plain_choose()->dot_float(columns, x, count, dots);
    clt_plain_choose()->add_float(columns, y, count, wanted);
    for (size_t v = 0; clt_pass_variants[v] != NULL; v++) {
      if (clt_pass_variants[v]->runs_here()) {
        memcpy(out, x, sizeof out);
        clt_pass_variants[v]->pass(columns, y, x, count, sum, out);
        assert_memory_equal(sum, dots, sizeof sum);
        assert_memory_equal(out, wanted, sizeof out);
      }
    }
  }
}

/* Spans of every length, of two parts, against plain sums; every variant to the same bits. */
static void test_leaf_variants(void **unused) {
  (void)unused;
  enum { SIDE = 32, CELLS = SIDE * (SIDE + 1) / 2, PARTS = 2 };
  static float own[CELLS], flood[CELLS], cells[CELLS];
  static double x[CELLS], y[2][CELLS], place[SIDE];
  clt_span span[SIDE];
  const int32_t leaf[PARTS] = {1, 0};
  const double f[PARTS * 4] = {0.3, -0.7, 0.1, 1.1, 0.9, 0.2, -0.4, 0.05};
  double wanted[PARTS][CLT_LEAF_SUMS] = {{0}}, sums[2][PARTS * CLT_LEAF_SUMS] = {{0}};
  uint64_t state = 7;
  for (int k = 0; k < CELLS; k++) {
    own[k] = (float)test_random(&state), flood[k] = (float)test_random(&state), cells[k] = (float)test_random(&state);
    x[k] = test_random(&state) - 0.5;
    place[k % SIDE] = (2 * (k % SIDE) + 1) / (double)SIDE - 1;
  }
  for (int s = 0, first = 0; s < SIDE; first += ++s) {
    span[s] = (clt_span){first, s % PARTS, (uint16_t)(s + 1), (uint16_t)(SIDE - 1 - s), (uint16_t)s};
    for (int k = 0; k <= s; k++) {
      const double u = place[SIDE - 1 - s + k], v = place[s], light = (double)cells[first + k] * x[first + k];
      const double term[CLT_LEAF_SUMS] = {light, u * light, v * light, u * v * light,
                                          (double)flood[first + k] * x[first + k]};
      for (int t = 0; t < CLT_LEAF_SUMS; t++) {
        wanted[s % PARTS][t] += term[t];
      }
    }
  }
  const clt_leaf_in in = {place, x, cells, flood, 1, 1};
  for (size_t v = 0; clt_leaf_variants[v] != NULL; v++) {
    if (!clt_leaf_variants[v]->runs_here()) {
      continue;
    }
    const clt_leaf_out out = {place, x, own, flood, cells, 1, 1, 0.6, leaf, f, y[1]};
    memset(sums[1], 0, sizeof sums[1]);
    clt_leaf_variants[v]->sum(&in, span, SIDE, sums[1]);
    clt_leaf_variants[v]->spread(&out, span, SIDE);
    if (v > 0 && clt_leaf_variants[0]->runs_here()) {
      assert_memory_equal(sums[1], sums[0], sizeof sums[0]);
      assert_memory_equal(y[1], y[0], sizeof y[0]);
    }
    memcpy(sums[0], sums[1], sizeof sums[0]);
    memcpy(y[0], y[1], sizeof y[0]);
    for (int k = 0; k < PARTS * CLT_LEAF_SUMS; k++) {
      assert_near(sums[1][k], wanted[k / CLT_LEAF_SUMS][k % CLT_LEAF_SUMS], 1e-13);
    }
    for (int s = 0; s < SIDE; s++) {
      for (int k = 0; k <= s; k++) {
        const int at = span[s].first + k;
        const double u = place[SIDE - 1 - s + k], w = place[s], *g = f + 4 * leaf[s % PARTS];
        const double light = g[0] + u * g[1] + w * g[2] + u * w * g[3];
        assert_near(y[1][at], (double)own[at] * x[at] + 0.6 * (double)flood[at] + (double)cells[at] * light, 1e-14);
      }
    }
  }
  assert_true(clt_leaf_choose()->runs_here());
}

static void test_byte_variants(void **unused) {
  (void)unused;
  enum { MOST = 1024, BLOCKS = MOST / CLT_BLOCK };
  static int8_t code[4][MOST];
  static float scale[4][BLOCKS], x[MOST], first[MOST], other[MOST];
  uint64_t state = 4;
  const int8_t *const codes[] = {code[0], code[1], code[2], code[3]};
  const float *const scales[] = {scale[0], scale[1], scale[2], scale[3]};
  for (size_t count = 0; count < MOST; count += count < 70 ? 1 : 119) {
    for (size_t k = 0; k < MOST; k++) {
      x[k] = first[k] = other[k] = (float)(test_random(&state) - 0.5);
      for (int r = 0; r < 4; r++) {
        code[r][k] = (int8_t)(256 * test_random(&state) - 128);
        scale[r][k / CLT_BLOCK] = (float)(0.01 * test_random(&state));
      }
    }
    const float y[4] = {0.3f, -0.7f, 0, 1.1f};
    const double wanted = clt_byte_variants[0]->dot(code[0], scale[0], x, count);
    clt_byte_variants[0]->add(codes, scales, y, count, first);
    for (size_t v = 1; clt_byte_variants[v] != NULL && clt_byte_variants[0]->runs_here(); v++) {
      assert_near(clt_byte_variants[v]->dot(code[0], scale[0], x, count), wanted, 0);
      memcpy(other, x, sizeof other);
      clt_byte_variants[v]->add(codes, scales, y, count, other);
      assert_memory_equal(first, other, sizeof first);
    }
  }
  assert_true(clt_byte_choose()->runs_here());
}

/* Units in which fp16 alone would go subnormal or overflow change nothing but the unit. */
static void case_18_fp16_subnormal_and_overflow(void **unused) {
  (void)unused;
  static const float units[] = {0x1p-60f, 0x1p-100f, 0x1p60f, 0x1p90f};
  const size_case size = {33, 17, 1, 561};
  const size_t count = 561 * 561;
  uint64_t state = 18;
  known_transport known = contact_dense(&size, &state), scaled = contact_dense(&size, &state);
  double *x = random_vector(561, &state), y[561], wanted[561];
  for (size_t u = 0; u < sizeof units / sizeof units[0]; u++) {
    for (size_t k = 0; k < count; k++) {
      clt_transport_entries(scaled.transport, 0)[k] = units[u] * clt_transport_entries(known.transport, 0)[k];
    }
    for (size_t s = 0; s < STORAGES; s++) {
      clt_transport *made = convert(known.transport, storage_cases[s].name);
      clt_transport *other = convert(scaled.transport, storage_cases[s].name);
      clt_transport_apply(made, 0, x, wanted);
      clt_transport_apply(other, 0, x, y);
      for (size_t i = 0; i < 561; i++) {
        assert_near(y[i] / (double)units[u], wanted[i], 1e-9);
      }
      clt_transport_apply_transposed(made, 0, x, wanted);
      clt_transport_apply_transposed(other, 0, x, y);
      for (size_t i = 0; i < 561; i++) {
        assert_near(y[i] / (double)units[u], wanted[i], 1e-6);
      }
      clt_transport_destroy(made);
      clt_transport_destroy(other);
    }
  }
  free(x);
  finish_known(&known);
  finish_known(&scaled);
}

/* No code is subnormal, infinite or off by more than half a step; every half is decoded as its definition says. */
static void test_half_codes(void **unused) {
  (void)unused;
  for (uint32_t code = 0; code < 0x10000; code++) {
    const int exponent = code >> 10 & 31;
    const double fraction = (double)(code & 0x3ff) / 1024, sign = code & 0x8000 ? -1 : 1;
    const double value = sign * (exponent == 0 ? ldexp(fraction, -14) : ldexp(1 + fraction, exponent - 15));
    if (exponent == 31) {
      assert_false(isfinite(clt_half_value((uint16_t)code)));
      continue;
    }
    assert_near(clt_half_value((uint16_t)code), value, 0);
    if (exponent > 0) {
      assert_int_equal(clt_half_code((float)value), code);
    }
  }
  uint64_t state = 11;
  for (int k = 0; k < 100000; k++) {
    const double value = (test_random(&state) - 0.5) * exp(25 * (test_random(&state) - 0.6));
    const uint16_t code = clt_half_code((float)value);
    assert_true((code & 0x7fff) == 0 || ((code & 0x7c00) != 0 && (code & 0x7c00) != 0x7c00));
    assert_near(clt_half_value(code), value, fmax(0x1.001p-11 * fabs(value), 0x1.001p-15));
  }
}

static void test_refusals(void **unused) {
  (void)unused;
  clt_transport *wide, *made = (clt_transport *)1;
  clt_error error = {0};
  assert_ok(clt_transport_create_dense(2, 2, 1, 4, &wide, &error), error);
  assert_int_equal(clt_transport_convert(wide, "dense4", &made, &error), CLT_BAD_INPUT);
  assert_null(made);
  for (size_t k = 0; clt_transport_storage_name(k) != NULL; k++) {
    assert_non_null(strstr(error.message, clt_transport_storage_name(k)));
  }
  clt_transport_entries(wide, 0)[6] = 1e35f;
  assert_int_equal(clt_transport_convert(wide, "dense8", &made, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "[0, 1, 2]"));
  assert_null(made);
  clt_transport_entries(wide, 0)[6] = NAN;
  for (size_t k = 0; k < STORAGES; k++) {
    assert_int_equal(clt_transport_convert(wide, storage_cases[k].name, &made, &error), CLT_BAD_INPUT);
    assert_null(made);
  }
  clt_transport_destroy(wide);
}

/* Any storage gives the same entries as dense: trees by products. Planes and provenance come along. */
static void test_from_tree(void **unused) {
  (void)unused;
  const size_case size = {9, 10, 2, 133};
  double bound[90];
  uint64_t state = 21;
  clt_error error = {0};
  known_transport known = random_tree(&size, &state);
  assert_ok(clt_transport_keep_flood(known.transport, &error), error);
  assert_ok(clt_transport_keep_sigma(known.transport, &error), error);
  for (size_t i = 0; i < size.rows; i++) {
    clt_transport_black(known.transport, 1)[i] = (float)i;
    clt_transport_flood_values(known.transport, 1)[i] = (float)(2 * i);
    clt_transport_sigma_values(known.transport, 1)[i] = (float)(3 * i);
  }
  strcpy(clt_transport_provenance(known.transport)->source, "a room");
  for (size_t s = 0; s < STORAGES; s++) {
    clt_transport *made = convert(known.transport, storage_cases[s].name);
    for (int c = 0; c < 2; c++) {
      double *entries = rows_of(made, c);
      const double *wanted = known.reference + (size_t)c * size.rows * 90;
      for (size_t i = 0; i < size.rows; i++) {
        entry_bounds(&storage_cases[s], wanted + i * 90, 90, i, bound);
        for (size_t j = 0; j < 90; j++) {
          assert_near(entries[i * 90 + j], wanted[i * 90 + j], bound[j] + 1e-12);
        }
      }
      free(entries);
    }
    assert_near(clt_transport_black(made, 1)[5], 5, 0);
    assert_near(clt_transport_flood(made, 1)[5], 10, 0);
    assert_near(clt_transport_sigma(made, 1)[5], 15, 0);
    assert_string_equal(clt_transport_origin(made)->source, "a room");
    clt_transport_destroy(made);
  }
  finish_known(&known);
}

/* Sums of 131072 terms to 1e-6 of what the storage holds, forward and backward. */
static void case_19_sums_of_131072_terms(void **unused) {
  (void)unused;
  enum { COLS = 131072, ROWS = 3 };
  clt_transport *row, *column;
  clt_error error;
  uint64_t state = 19;
  assert_ok(clt_transport_create_dense(512, 256, 1, ROWS, &row, &error), error);
  assert_ok(clt_transport_create_dense(1, 1, 1, COLS, &column, &error), error);
  double *x = random_vector(COLS, &state), *entries = calloc(COLS, sizeof *entries), y[ROWS], sums[ROWS], size;
  for (size_t k = 0; k < (size_t)ROWS * COLS; k++) {
    clt_transport_entries(row, 0)[k] = (float)exp(-20 * test_random(&state));
    clt_transport_entries(column, 0)[k / ROWS] = clt_transport_entries(row, 0)[k];
  }
  for (size_t j = 0; j < COLS; j++) {
    x[j] = fabs(x[j]);
  }
  for (size_t s = 0; s < STORAGES; s++) {
    clt_transport *made = convert(row, storage_cases[s].name);
    clt_transport_apply(made, 0, x, y);
    clt_transport_row_sums(made, 0, sums);
    for (size_t i = 0; i < ROWS; i++) {
      assert_ok(clt_transport_row(made, 0, i, entries, &error), error);
      assert_near(y[i] / exact_sum(entries, 1, COLS, false, 0, x, &size), 1, 1e-6);
      double sum = 0;
      for (size_t j = 0; j < COLS; j++) {
        sum += entries[j];
      }
      assert_near(sums[i] / sum, 1, 1e-9);
    }
    clt_transport_destroy(made);
    made = convert(column, storage_cases[s].name);
    double *held = rows_of(made, 0);
    clt_transport_apply_transposed(made, 0, x, y);
    assert_near(y[0] / exact_sum(held, COLS, 1, true, 0, x, &size), 1, 1e-6);
    free(held);
    clt_transport_destroy(made);
  }
  clt_transport_destroy(row);
  clt_transport_destroy(column);
  free(x);
  free(entries);
}

/* A room's T with entries that are no floats. */
static clt_transport *room_in_double(const test_room *room, uint64_t *state) {
  clt_transport *made = convert(room->transport, "dense64");
  double *rows = rows_of(made, 0);
  for (size_t i = 0; i < room->cells; i++) {
    double *row = rows + i * room->cells;
    for (size_t j = 0; j < room->cells; j++) {
      row[j] *= 1 + 1e-7 * (test_random(state) - 0.5);
    }
    made->kind->put_row(made, 0, i, row);
  }
  free(rows);
  return made;
}

/* ||T x - b|| / ||b|| */
static double distance(const clt_transport *exact, const double *x, const double *b, size_t n) {
  double *seen = calloc(n, sizeof *seen), off = 0, size = 0;
  clt_transport_apply(exact, 0, x, seen);
  for (size_t i = 0; i < n; i++) {
    off += (seen[i] - b[i]) * (seen[i] - b[i]);
    size += b[i] * b[i];
  }
  free(seen);
  return sqrt(off / size);
}

/* NUMERICS section 3: what solving with a storage costs in the picture that the room itself (in double) then shows. */
static void test_compensation(void **unused) {
  (void)unused;
  static const double most[STORAGES] = {1e-10, 1e-7, 3e-4, 1e-3}, least[STORAGES] = {0, 1e-10, 1e-6, 1e-5};
  for (uint64_t seed = 1; seed <= SEEDS; seed++) {
    uint64_t state = seed;
    test_room room = room_cube(8, 0.8, 0.3, seed);
    clt_transport *exact = room_in_double(&room, &state);
    double *known = random_vector(room.cells, &state), *b = calloc(room.cells, sizeof *b);
    double *x = calloc(room.cells, sizeof *x);
    for (size_t j = 0; j < room.cells; j++) {
      known[j] = fabs(known[j]);
    }
    clt_transport_apply(exact, 0, known, b);
    for (size_t s = 0; s < STORAGES; s++) {
      clt_transport *made = convert(exact, storage_cases[s].name);
      clt_solve_result result;
      clt_error error = {0};
      clt_solve_options options = {.method = "gmres", .tolerance = s < 2 ? 1e-11 : 1e-6};
      assert_ok(clt_solve(made, room.certificate, b, &options, x, &result, &error), error);
      const double off = distance(exact, x, b, room.cells);
      print_message("%s: the picture is %.2g off\n", storage_cases[s].name, off);
      assert_true(off <= most[s] && off >= least[s]);
      clt_transport_destroy(made);
    }
    clt_transport_destroy(exact);
    free(known);
    free(b);
    free(x);
    room_free(&room);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_entries),
                                     cmocka_unit_test(test_products),
                                     cmocka_unit_test(test_thread_count),
                                     cmocka_unit_test(test_half_variants),
                                     cmocka_unit_test(test_plain_variants),
                                     cmocka_unit_test(test_pass_variants),
                                     cmocka_unit_test(test_leaf_variants),
                                     cmocka_unit_test(test_byte_variants),
                                     cmocka_unit_test(case_18_fp16_subnormal_and_overflow),
                                     cmocka_unit_test(test_half_codes),
                                     cmocka_unit_test(test_refusals),
                                     cmocka_unit_test(test_from_tree),
                                     cmocka_unit_test(case_19_sums_of_131072_terms),
                                     cmocka_unit_test(test_compensation)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
