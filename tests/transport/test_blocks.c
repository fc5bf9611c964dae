/* Blocks storage against a far light whose entries are known in closed form: M = f g' + g f' with g even in every block
 * has no part that is uneven from uneven, so that the columns of the blocks determine T = near + M W. */
#include <omp.h>
#include <stdbool.h>

#include "products.h"

enum { NEAR = 3 };

/* A transport of random blocks and its entries. Block 0 has no flux: it must give and take nothing. */
typedef struct known_blocks {
  int32_t *block, *cell;
  int64_t *start;
  float *flux, *column, *value;
  clt_block_parts parts;
} known_blocks;

/* Near entries lie up to `reach` cells apart. */
static void draw_cells(known_blocks *own, int cells, int count, int reach, uint64_t *state) {
  for (int j = 0; j < cells; j++) {
    own->block[j] = (int32_t)(count * test_random(state));
    own->flux[j] = own->block[j] == 0 ? 0 : (float)(0.2 + test_random(state));
    own->start[j + 1] = own->start[j] + (j % (NEAR + 1));
  }
  for (int j = 0; j < cells; j++) {
    for (int64_t e = own->start[j]; e < own->start[j + 1]; e++) {
      const int most = cells - 1, at = j - reach + (int)((2 * reach + 1) * test_random(state));
      own->cell[e] = at < 0 ? 0 : at > most ? most : at;
    }
  }
}

static void fill_channel(known_blocks *own, int cells, int count, int channel, uint64_t *state, double *entries) {
  double *f = random_vector((size_t)cells, state), *level = random_vector((size_t)count, state);
  const int64_t near = own->start[cells];
  for (int i = 0; i < cells; i++) {
    const double fi = f[i], gi = own->block[i] == 0 ? 0 : level[own->block[i]];
    for (int j = 0; j < cells; j++) {
      const double far = own->block[i] == 0 || own->block[j] == 0 ? 0 : fi * level[own->block[j]] + gi * f[j];
      entries[i * cells + j] = far * (double)own->flux[j];
      own->column[((size_t)channel * (size_t)count + (size_t)own->block[j]) * (size_t)cells + (size_t)i] +=
          (float)entries[i * cells + j];
    }
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      float value = (float)test_random(state);
      own->value[channel * near + e] = value;
      entries[i * cells + own->cell[e]] += (double)value;
    }
  }
  free(f);
  free(level);
}

static known_blocks make_blocks(const size_case *size, int count, uint64_t *state, double *entries) {
  const size_t cells = (size_t)size->width * (size_t)size->height, channels = (size_t)size->channels;
  known_blocks own = {.block = calloc(cells, sizeof(int32_t)),
                      .cell = calloc(NEAR * cells, sizeof(int32_t)),
                      .start = calloc(cells + 1, sizeof(int64_t)),
                      .flux = calloc(cells, sizeof(float)),
                      .column = calloc(channels * (size_t)count * cells, sizeof(float)),
                      .value = calloc(channels * NEAR * cells, sizeof(float))};
  draw_cells(&own, (int)cells, count, count % 2 == 0 ? (int)cells : count / 2, state);
  for (int c = 0; c < size->channels; c++) {
    fill_channel(&own, (int)cells, count, c, state, entries + (size_t)c * cells * cells);
  }
  own.parts = (clt_block_parts){count, own.block, own.flux, own.column, own.start, own.cell, own.value};
  return own;
}

static void free_blocks(known_blocks *own) {
  free(own->block);
  free(own->cell);
  free(own->start);
  free(own->flux);
  free(own->column);
  free(own->value);
}

/* The columns are floats: that bounds what products can be off by. */
static const allowance OFF_BY = {2e-6, 1e-5};

/* As made and as read from a file. */
static void test_products(void **unused) {
  (void)unused;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/blocks.h5", test_folder(folder));
  for (uint64_t seed = 1; seed <= 6; seed++) {
    const size_case size = {seed % 2 ? 31 : 48, seed % 2 ? 9 : 23, 1 + (int)(seed % 3), 0};
    const size_t cells = (size_t)size.width * (size_t)size.height;
    uint64_t state = seed;
    double *entries = calloc((size_t)size.channels * cells * cells, sizeof *entries);
    known_blocks own = make_blocks(&size, 2 + (int)seed * 3, &state, entries);
    clt_transport *made = NULL, *read = NULL;
    clt_error error = {0};
    assert_ok(clt_transport_create_blocks(size.width, size.height, size.channels, &own.parts, &made, &error), error);
    free_blocks(&own);
    assert_ok(clt_transport_save(made, path, &error), error);
    assert_ok(clt_transport_load(path, &read, &error), error);
    assert_string_equal(clt_transport_describe(read).storage, "blocks");
    assert_int_equal(clt_transport_describe(read).bytes, clt_transport_describe(made).bytes);
    for (int c = 0; c < size.channels; c++) {
      check_products(made, c, entries + (size_t)c * cells * cells, OFF_BY, &state);
      check_products(read, c, entries + (size_t)c * cells * cells, OFF_BY, &state);
    }
    clt_transport_destroy(made);
    clt_transport_destroy(read);
    free(entries);
  }
  unlink(path);
  rmdir(folder);
}

/* The same bits with any number of threads. */
static void test_thread_count(void **unused) {
  (void)unused;
  const size_case size = {61, 40, 1, 0};
  const size_t cells = 61 * 40;
  const int before = omp_get_max_threads();
  uint64_t state = 9;
  double *entries = calloc(cells * cells, sizeof *entries), *x = random_vector(cells, &state);
  double *one = calloc(4 * cells, sizeof *one), *out = one + 2 * cells;
  known_blocks own = make_blocks(&size, 40, &state, entries);
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_blocks(61, 40, 1, &own.parts, &made, &error), error);
  for (int threads = 1; threads <= 5; threads += 2) {
    omp_set_num_threads(threads);
    double *to = threads == 1 ? one : out;
    clt_transport_apply(made, 0, x, to);
    clt_transport_apply_transposed(made, 0, x, to + cells);
    assert_true(threads == 1 || memcmp(one, out, 2 * cells * sizeof *one) == 0);
  }
  omp_set_num_threads(before);
  clt_transport_destroy(made);
  free_blocks(&own);
  free(entries);
  free(x);
  free(one);
}

static void refuse(const clt_block_parts *parts, const char *word) {
  clt_transport *made = (clt_transport *)1;
  clt_error error = {0};
  assert_int_equal(clt_transport_create_blocks(2, 1, 1, parts, &made, &error), CLT_BAD_INPUT);
  assert_null(made);
  if (strstr(error.message, word) == NULL) {
    fail_msg("\"%s\" does not name %s", error.message, word);
  }
}

static void test_refusals(void **unused) {
  (void)unused;
  const int32_t share[] = {0, 1}, beyond[] = {0, 2}, cell[] = {1}, far[] = {2};
  const float flux[] = {1, 1}, negative[] = {1, -1}, column[] = {1, 2, 3, 4}, broken[] = {1, 2, NAN, 4}, value[] = {1};
  const int64_t start[] = {0, 1, 1}, falling[] = {0, 2, 1};
  const clt_block_parts good = {2, share, flux, column, start, cell, value};
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_blocks(2, 1, 1, &good, &made, &error), error);
  clt_transport_destroy(made);
  clt_block_parts bad = good;
  bad.count = 3;
  refuse(&bad, "3 blocks");
  bad = good;
  bad.block = beyond;
  refuse(&bad, "/blocks/block[1]");
  bad = good;
  bad.flux = negative;
  refuse(&bad, "/blocks/flux[1]");
  bad = good;
  bad.column = broken;
  refuse(&bad, "/blocks/column[0, 1, 0]");
  bad = good;
  bad.start = falling;
  refuse(&bad, "/blocks/start[1]");
  bad = good;
  bad.cell = far;
  refuse(&bad, "/blocks/cell[0]");
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_products), cmocka_unit_test(test_thread_count),
                                     cmocka_unit_test(test_refusals)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
