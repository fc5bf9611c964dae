/* Rows of far light in floats and codes, against sums in double, and factors that channels share, against matrices. */
#include "cases.h"
#include "transport/hierarchy_share.h"
#include "transport/leaf_rows.h"

enum { TERMS = CLT_LEAF_TERMS, LEAVES = 5 };

static clt_leaf_rows make_rows(int sets, size_t rank, uint64_t *state) {
  clt_leaf_rows rows;
  assert_true(clt_leaf_rows_reserve(&rows, 32, (size_t)sets, LEAVES, rank));
  for (size_t k = 0; k < (size_t)sets * TERMS * LEAVES * rank; k++) {
    const double size = k / rank % 7 == 6 ? 0 : ldexp(1, -(int)(k / rank % 5) * 20 - (int)(k % rank / 16));
    rows.value[k] = (float)(size * (2 * test_random(state) - 1));
  }
  return rows;
}

/* The largest of the neighbours in a row that share a scale. */
static double scale_of(const clt_leaf_rows *rows, size_t row, size_t k, int bits) {
  const size_t first = bits == 8 ? k / CLT_BLOCK * CLT_BLOCK : 0;
  const size_t end = bits == 8 && first + CLT_BLOCK < rows->rank ? first + CLT_BLOCK : rows->rank;
  double largest = 0;
  for (size_t j = first; j < end; j++) {
    largest = fmax(largest, fabs((double)rows->value[row * rows->rank + j]));
  }
  return largest;
}

/* Half precision is off by 2^-11 of a number, or 2^-30 of its row's largest; int8 by 1/254 of its block's. */
static void test_codes(void **unused) {
  (void)unused;
  static const size_t RANKS[] = {1, 31, 32, 77, 160};
  uint64_t state = 4;
  for (size_t r = 0; r < 5; r++) {
    clt_leaf_rows rows = make_rows(2, RANKS[r], &state), codes;
    float *read = calloc(TERMS * RANKS[r], sizeof *read);
    for (int bits = 16; bits >= 8; bits /= 2) {
      assert_true(clt_leaf_rows_pack(&rows, bits, &codes));
      assert_true(clt_leaf_rows_bytes(&codes) * 32 / (size_t)bits < clt_leaf_rows_bytes(&rows) * 2 + 4096);
      for (int set = 0; set < 2; set++) {
        for (size_t leaf = 0; leaf < LEAVES; leaf++) {
          clt_leaf_rows_read(&codes, set, leaf, read);
          for (size_t k = 0; k < TERMS * RANKS[r]; k++) {
            const size_t row = TERMS * ((size_t)set * LEAVES + leaf) + k / RANKS[r];
            const double value = (double)rows.value[row * RANKS[r] + k % RANKS[r]];
            const double largest = scale_of(&rows, row, k % RANKS[r], bits);
            const double allowed = bits == 16 ? fmax(ldexp(fabs(value), -11), ldexp(largest, -29)) : largest / 253;
            assert_near((double)read[k], value, allowed);
          }
        }
      }
      clt_leaf_rows_finish(&codes);
    }
    free(read);
    clt_leaf_rows_finish(&rows);
  }
}

/* Sums over the first columns of a leaf's rows as they are read, in double. */
static void check_sums(const clt_leaf_rows *rows, int channel, size_t leaf, size_t count, uint64_t *state) {
  const size_t rank = rows->rank;
  float *read = calloc(TERMS * rank + 2 * rank, sizeof *read), *in = read + TERMS * rank, *out = in + rank;
  float term[TERMS], sum[TERMS];
  clt_leaf_rows_read(rows, channel, leaf, read);
  for (size_t k = 0; k < rank; k++) {
    in[k] = out[k] = (float)(2 * test_random(state) - 1);
  }
  for (size_t t = 0; t < TERMS; t++) {
    term[t] = (float)(2 * test_random(state) - 1);
  }
  clt_leaf_rows_add(rows, channel, leaf, term, count, out);
  clt_leaf_rows_dot(rows, channel, leaf, in, count, sum);
  for (size_t k = 0; k < count; k++) {
    double wanted = (double)in[k], size = fabs(wanted);
    for (size_t t = 0; t < TERMS; t++) {
      wanted += (double)term[t] * (double)read[t * rank + k];
      size += fabs((double)term[t] * (double)read[t * rank + k]);
    }
    assert_near((double)out[k], wanted, 1e-6 * size);
  }
  for (size_t t = 0; t < TERMS; t++) {
    double wanted = 0, size = 0;
    for (size_t k = 0; k < count; k++) {
      wanted += (double)read[t * rank + k] * (double)in[k];
      size += fabs((double)read[t * rank + k] * (double)in[k]);
    }
    assert_near((double)sum[t], wanted, 2e-6 * size);
  }
  free(read);
}

static void test_sums(void **unused) {
  (void)unused;
  static const size_t RANKS[] = {1, 29, 64, 101}, COUNTS[] = {1, 8, 32, 40, 64};
  uint64_t state = 12;
  for (size_t r = 0; r < 4; r++) {
    for (int sets = 1; sets <= 3; sets += 2) {
      clt_leaf_rows rows = make_rows(sets, RANKS[r], &state), codes[2];
      assert_true(clt_leaf_rows_pack(&rows, 16, &codes[0]) && clt_leaf_rows_pack(&rows, 8, &codes[1]));
      const clt_leaf_rows *all[] = {&rows, &codes[0], &codes[1]};
      for (size_t k = 0; k < 3 * LEAVES * 5; k++) {
        const size_t count = COUNTS[k % 5] < RANKS[r] ? COUNTS[k % 5] : RANKS[r];
        check_sums(all[k % 3], 2, k / 5 % LEAVES, count, &state);
      }
      for (size_t k = 0; k < 3; k++) {
        clt_leaf_rows_finish((clt_leaf_rows *)all[k]);
      }
    }
  }
}

/* The same bits whatever the processor. */
static void test_variants(void **unused) {
  (void)unused;
  enum { MOST = 77 };
  uint64_t state = 8;
  clt_leaf_rows rows = make_rows(1, MOST, &state), half, byte;
  float in[MOST], sum[2][TERMS], out[2][MOST];
  const float term[TERMS] = {0.3f, -1.7f, 0.9f, 2.2f};
  assert_true(clt_leaf_rows_pack(&rows, 16, &half) && clt_leaf_rows_pack(&rows, 8, &byte));
  for (size_t k = 0; k < MOST; k++) {
    in[k] = (float)(2 * test_random(&state) - 1);
  }
  clt_leaf_rows *forms[] = {&rows, &half, &byte};
  for (size_t f = 0; f < 3; f++) {
    for (size_t count = 1; count <= MOST; count++) {
      for (int portable = 0; portable < 2; portable++) {
        clt_leaf_rows_choose(forms[f]);
        if (portable) {
          size_t last[3] = {0};
          for (; clt_float_variants[last[0] + 1] != NULL; last[0]++) {
          }
          for (; clt_half_variants[last[1] + 1] != NULL; last[1]++) {
          }
          for (; clt_byte_variants[last[2] + 1] != NULL; last[2]++) {
          }
          forms[f]->floats = clt_float_variants[last[0]];
          forms[f]->halves = clt_half_variants[last[1]];
          forms[f]->bytes = clt_byte_variants[last[2]];
        }
        memcpy(out[portable], in, sizeof in);
        clt_leaf_rows_add(forms[f], 0, 1, term, count, out[portable]);
        clt_leaf_rows_dot(forms[f], 0, 1, in, count, sum[portable]);
      }
      assert_memory_equal(out[0], out[1], sizeof in);
      assert_memory_equal(sum[0], sum[1], sizeof sum[0]);
    }
    clt_leaf_rows_finish(forms[f]);
  }
}

enum { NODES = 60, COUNT = 12, CHANNELS = 3 };

/* Gram and Schmidt. */
static void make_orthonormal(double columns[COUNT][NODES]) {
  for (size_t k = 0; k < COUNT; k++) {
    double norm = 0;
    for (size_t before = 0; before < k; before++) {
      double along = 0;
      for (size_t m = 0; m < NODES; m++) {
        along += columns[k][m] * columns[before][m];
      }
      for (size_t m = 0; m < NODES; m++) {
        columns[k][m] -= along * columns[before][m];
      }
    }
    for (size_t m = 0; m < NODES; m++) {
      norm += columns[k][m] * columns[k][m];
    }
    for (size_t m = 0; m < NODES; m++) {
      columns[k][m] /= sqrt(norm);
    }
  }
}

static void draw_columns(uint64_t *state, double size, double around[COUNT][NODES], double columns[COUNT][NODES]) {
  for (size_t at = 0; at < COUNT * NODES; at++) {
    columns[at / NODES][at % NODES] =
        (around != NULL ? around[at / NODES][at % NODES] : 0) + size * (test_random(state) - 0.5);
  }
  make_orthonormal(columns);
}

typedef struct channels {
  clt_singular of[CHANNELS];
  double sides[CHANNELS][2][COUNT][NODES], value[CHANNELS][COUNT];
} channels;

/* Far light whose singular values halve from column to column; the channels' spaces are turned against each other by
 * about `apart`. */
static void make_channels(channels *all, double apart, uint64_t *state) {
  double common[2][COUNT][NODES];
  draw_columns(state, 1, NULL, common[0]);
  draw_columns(state, 1, NULL, common[1]);
  for (int c = 0; c < CHANNELS; c++) {
    for (int side = 0; side < 2; side++) {
      draw_columns(state, apart, common[side], all->sides[c][side]);
    }
    for (size_t k = 0; k < COUNT; k++) {
      all->value[c][k] = ldexp(0.5 + 0.1 * c, -(int)k);
    }
    all->of[c] = (clt_singular){NODES, COUNT, all->sides[c][0][0], all->sides[c][1][0], all->value[c]};
  }
}

/* The norm of a channel's far light less what is shared, by power iteration over the whole matrix. */
static double left_out(const channels *all, int c, const clt_shared *shared) {
  double apart[NODES][NODES], x[NODES], y[NODES], norm = 0;
  const size_t rank = shared->rank;
  for (size_t i = 0; i < NODES; i++) {
    x[i] = 1 + 0.1 * (double)(i % 7);
    for (size_t j = 0; j < NODES; j++) {
      apart[i][j] = 0;
      for (size_t k = 0; k < COUNT; k++) {
        apart[i][j] += all->sides[c][0][k][i] * all->value[c][k] * all->sides[c][1][k][j];
      }
      for (size_t r = 0; r < rank * rank; r++) {
        apart[i][j] -= shared->left[r / rank * NODES + i] * (double)shared->core[(size_t)c * rank * rank + r] *
                       shared->right[r % rank * NODES + j];
      }
    }
  }
  for (int round = 0; round < 200; round++) {
    double size = 0;
    for (size_t i = 0; i < NODES; i++) {
      size += x[i] * x[i];
    }
    norm = 0;
    for (size_t i = 0; i < NODES; i++) {
      y[i] = 0;
      for (size_t j = 0; j < NODES; j++) {
        y[i] += apart[i][j] * x[j] / sqrt(size);
      }
      norm += y[i] * y[i];
    }
    for (size_t j = 0; j < NODES; j++) {
      x[j] = 0;
      for (size_t i = 0; i < NODES; i++) {
        x[j] += apart[i][j] * y[i];
      }
    }
  }
  return sqrt(norm);
}

/* As far as the channels' spaces agree, few columns serve all of them to the tolerance, beside what is below it; where
 * they do not, they are left to themselves. */
static void test_sharing(void **unused) {
  (void)unused;
  static const double APART[] = {0, 0.002, 0.05};
  for (uint64_t seed = 1; seed <= 4; seed++) {
    uint64_t state = seed;
    const double tolerance[CHANNELS] = {1e-2, 2e-2, 1e-2};
    size_t before = 0;
    for (size_t a = 0; a < 3; a++) {
      channels all;
      clt_shared shared;
      clt_error error = {0};
      make_channels(&all, APART[a], &state);
      assert_ok(clt_singular_share(all.of, CHANNELS, tolerance, 1, COUNT * CHANNELS, &shared, &error), error);
      assert_true(shared.rank >= 6 && shared.rank >= before && (a > 1 || shared.rank <= 8));
      for (int c = 0; c < CHANNELS; c++) {
        assert_true(left_out(&all, c, &shared) <= 2 * tolerance[c]);
      }
      before = shared.rank;
      clt_shared_finish(&shared);
      assert_ok(clt_singular_share(all.of, CHANNELS, tolerance, 1, before - 1, &shared, &error), error);
      assert_int_equal(shared.rank, 0);
      clt_shared_finish(&shared);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_codes), cmocka_unit_test(test_sums),
                                     cmocka_unit_test(test_variants), cmocka_unit_test(test_sharing)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
