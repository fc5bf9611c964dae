/* Products of both storage kinds against a triple loop in double (long double for long sums). */
#include <omp.h>

#include "cases.h"

static const make_known kinds[] = {random_dense, random_tree};
enum { KINDS = sizeof kinds / sizeof kinds[0], SEEDS = 3 };

/* y_i = sum_j T_ij x_j and x_j = sum_i T_ij y_i of one channel, written out. */
static void naive_apply(const double *entries, size_t rows, size_t cols, const double *x, double *y) {
  for (size_t i = 0; i < rows; i++) {
    y[i] = 0;
    for (size_t j = 0; j < cols; j++) {
      y[i] += entries[i * cols + j] * x[j];
    }
  }
}

static void naive_transposed(const double *entries, size_t rows, size_t cols, const double *y, double *x) {
  for (size_t j = 0; j < cols; j++) {
    x[j] = 0;
    for (size_t i = 0; i < rows; i++) {
      x[j] += entries[i * cols + j] * y[i];
    }
  }
}

static void assert_vectors(const double *actual, const double *wanted, size_t count) {
  for (size_t i = 0; i < count; i++) {
    assert_near(actual[i], wanted[i], 1e-11 * (1 + fabs(wanted[i])));
  }
}

static double inner(const double *a, const double *b, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; i++) {
    sum += a[i] * b[i];
  }
  return sum;
}

static void check_channel(const known_transport *known, int channel, uint64_t *state) {
  clt_transport_info info = clt_transport_describe(known->transport);
  const double *entries = known->reference + (size_t)channel * info.rows * info.cols;
  size_t least = info.rows < info.cols ? info.rows : info.cols;
  size_t most = info.rows + info.cols;
  double *x = random_vector(most, state), *y = random_vector(most, state), *ours = random_vector(most, state);
  double *wanted = random_vector(most, state);

  clt_transport_apply(known->transport, channel, x, ours);
  naive_apply(entries, info.rows, info.cols, x, wanted);
  assert_vectors(ours, wanted, info.rows);
  double left = inner(ours, y, info.rows);

  clt_transport_apply_transposed(known->transport, channel, y, ours);
  naive_transposed(entries, info.rows, info.cols, y, wanted);
  assert_vectors(ours, wanted, info.cols);
  /* <T x, y> = <x, T' y> */
  assert_near(inner(x, ours, info.cols), left, 1e-10 * (1 + fabs(left)));

  clt_transport_diagonal(known->transport, channel, ours);
  for (size_t i = 0; i < least; i++) {
    assert_near(ours[i], entries[i * info.cols + i], 1e-13);
  }
  for (size_t j = 0; j < info.cols; j++) {
    x[j] = 1;
  }
  clt_transport_row_sums(known->transport, channel, ours);
  naive_apply(entries, info.rows, info.cols, x, wanted);
  assert_vectors(ours, wanted, info.rows);
  free(x);
  free(y);
  free(ours);
  free(wanted);
}

static void test_products(void **unused) {
  (void)unused;
  for (uint64_t seed = 0; seed < SEEDS * KINDS * SIZE_CASES; seed++) {
    const size_case *size = &size_cases[seed % SIZE_CASES];
    uint64_t state = seed;
    known_transport known = kinds[seed / SIZE_CASES % KINDS](size, &state);
    clt_transport_info info = clt_transport_describe(known.transport);
    assert_int_equal(info.rows, size->rows);
    assert_int_equal(info.cols, size->width * size->height);
    for (int channel = 0; channel < size->channels; channel++) {
      check_channel(&known, channel, &state);
    }
    finish_known(&known);
  }
}

/* All products with one thread and with several: the same bits. */
static void test_thread_count(void **unused) {
  (void)unused;
  const size_case sizes[] = {{96, 71, 1, 300}, {190, 181, 1, 1500}};
  const int before = omp_get_max_threads();
  for (size_t k = 0; k < KINDS * 2; k++) {
    uint64_t state = k;
    const size_case *size = &sizes[k % KINDS];
    if (k / 2 == 0 && size->width > 100) {
      continue; /* a dense one of that size is too big for a test */
    }
    known_transport known = kinds[k / 2](size, &state);
    const size_t rows = size->rows, cols = (size_t)size->width * (size_t)size->height, most = rows + cols;
    double *x = random_vector(most, &state), *one = random_vector(4 * most, &state);
    double *many = random_vector(4 * most, &state);
    for (size_t i = 0; i < most; i += 3) {
      x[i] = 0; /* gaps, which a transposed product leaves out */
    }
    for (int threads = 1; threads <= 7; threads += threads == 1 ? 1 : 2) {
      double *out = threads == 1 ? one : many;
      omp_set_num_threads(threads);
      clt_transport_apply(known.transport, 0, x, out);
      clt_transport_apply_transposed(known.transport, 0, x, out + most);
      clt_transport_row_sums(known.transport, 0, out + 2 * most);
      clt_transport_diagonal(known.transport, 0, out + 3 * most);
      if (threads > 1) {
        assert_memory_equal(one, many, rows * sizeof *one);
        assert_memory_equal(one + most, many + most, cols * sizeof *one);
        assert_memory_equal(one + 2 * most, many + 2 * most, rows * sizeof *one);
        assert_memory_equal(one + 3 * most, many + 3 * most, (rows < cols ? rows : cols) * sizeof *one);
      }
    }
    omp_set_num_threads(before);
    free(x);
    free(one);
    free(many);
    finish_known(&known);
  }
}

/* A row whose y is zero is not even read: NaN in it would show. */
static void test_zero_rows(void **unused) {
  (void)unused;
  const size_case size = {13, 7, 1, 200};
  uint64_t state = 5;
  known_transport known = random_dense(&size, &state);
  double *y = calloc(size.rows, sizeof *y), x[91], wanted[91];
  float *entries = clt_transport_entries(known.transport, 0);
  for (size_t i = 0; i < size.rows; i++) {
    if (i % 11 == 4) {
      y[i] = test_random(&state);
      continue;
    }
    for (size_t j = 0; j < 91; j++) {
      entries[i * 91 + j] = NAN;
      known.reference[i * 91 + j] = 0;
    }
  }
  clt_transport_apply_transposed(known.transport, 0, y, x);
  naive_transposed(known.reference, size.rows, 91, y, wanted);
  assert_vectors(x, wanted, 91);
  memset(y, 0, size.rows * sizeof *y);
  clt_transport_apply_transposed(known.transport, 0, y, x);
  memset(wanted, 0, sizeof wanted);
  assert_memory_equal(x, wanted, sizeof x);
  free(y);
  finish_known(&known);
}

/* Sums of 131072 terms to 1e-6, with cancellation to a thousandth. */
static void case_19_sums_of_131072_terms(void **unused) {
  (void)unused;
  enum { COLS = 131072, ROWS = 6 };
  clt_transport *transport;
  clt_error error;
  uint64_t state = 19;
  assert_ok(clt_transport_create_dense(512, 256, 1, ROWS, &transport, &error), error);
  float *entries = clt_transport_entries(transport, 0);
  double *x = random_vector(COLS, &state), *back = random_vector(COLS, &state), y[ROWS], sums[ROWS];
  for (size_t k = 0; k < (size_t)ROWS * COLS; k++) {
    entries[k] = (float)(exp(-20 * test_random(&state)));
  }
  clt_transport_apply(transport, 0, x, y);
  clt_transport_row_sums(transport, 0, sums);
  for (size_t i = 0; i < ROWS; i++) {
    long double product = 0, sum = 0;
    for (size_t j = 0; j < COLS; j++) {
      product += (long double)entries[i * COLS + j] * (long double)x[j];
      sum += (long double)entries[i * COLS + j];
    }
    assert_near(y[i] / (double)product, 1, 1e-6);
    assert_near(sums[i] / (double)sum, 1, 1e-12);
  }
  clt_transport_destroy(transport);
  /* and as a column: one drive cell seen by 131072 observed cells */
  assert_ok(clt_transport_create_dense(1, 1, 1, COLS, &transport, &error), error);
  entries = clt_transport_entries(transport, 0);
  long double product = 0;
  for (size_t i = 0; i < COLS; i++) {
    entries[i] = (float)(exp(-20 * test_random(&state)));
    product += (long double)entries[i] * (long double)x[i];
  }
  clt_transport_apply_transposed(transport, 0, x, back);
  assert_near(back[0] / (double)product, 1, 1e-6);
  clt_transport_destroy(transport);
  free(x);
  free(back);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_products), cmocka_unit_test(test_thread_count),
                                     cmocka_unit_test(test_zero_rows), cmocka_unit_test(case_19_sums_of_131072_terms)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
