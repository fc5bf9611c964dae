/* Hierarchy storage against entries known in closed form: products, files, threads, noise, growth, refusals. */
#include <omp.h>
#include <stdbool.h>

#include "products.h"
#include "smooth.h"
#include "transport/hierarchy.h"

/* Entries on the diagonal are .8 to 1.2: no looser than 3e-6 there. */
static const allowance OFF_BY = {3e-6, 2.4e-6};

/* As made and as read from a file; block 0 has no flux in every other room. */
static void test_products(void **unused) {
  (void)unused;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/hierarchy.h5", test_folder(folder));
  for (uint64_t seed = 1; seed <= 4; seed++) {
    const size_case size = {seed % 2 ? 37 : 64, seed % 2 ? 22 : 12, 1 + (int)(seed % 3), 0};
    const size_t cells = (size_t)size.width * (size_t)size.height;
    uint64_t state = seed;
    smooth_room room = make_smooth_room(&size, 0.8, 0, seed % 2 == 0, &state);
    clt_transport *made = hierarchy_of(room.blocks, 1e-6), *read = NULL;
    clt_error error = {0};
    assert_true(clt_transport_simplified(made) < 1e-5);
    assert_ok(clt_transport_save(made, path, &error), error);
    assert_ok(clt_transport_load(path, &read, &error), error);
    assert_string_equal(clt_transport_describe(read).storage, "hierarchy");
    assert_int_equal(clt_transport_describe(read).bytes, clt_transport_describe(made).bytes);
    assert_true(clt_transport_simplified(read) == clt_transport_simplified(made));
    for (int c = 0; c < size.channels; c++) {
      check_products(made, c, room.entries + (size_t)c * cells * cells, OFF_BY, &state);
      check_products(read, c, room.entries + (size_t)c * cells * cells, OFF_BY, &state);
    }
    clt_transport_destroy(made);
    clt_transport_destroy(read);
    finish_smooth_room(&room);
  }
  unlink(path);
  rmdir(folder);
}

/* The same bits with any number of threads. */
static void test_thread_count(void **unused) {
  (void)unused;
  const size_case size = {64, 48, 1, 0};
  const size_t cells = 64 * 48;
  const int before = omp_get_max_threads();
  uint64_t state = 9;
  smooth_room room = make_smooth_room(&size, 0.8, 1e-4, false, &state);
  clt_transport *made = hierarchy_of(room.blocks, 1e-3);
  double *x = random_vector(cells, &state), *one = calloc(4 * cells, sizeof *one), *many = one + 2 * cells;
  for (int threads = 1; threads <= 3; threads += 2) {
    omp_set_num_threads(threads);
    clt_transport_apply(made, 0, x, threads == 1 ? one : many);
    clt_transport_apply_transposed(made, 0, x, (threads == 1 ? one : many) + cells);
  }
  omp_set_num_threads(before);
  assert_memory_equal(one, many, 2 * cells * sizeof *one);
  free(x);
  free(one);
  clt_transport_destroy(made);
  finish_smooth_room(&room);
}

static double off_by(const clt_transport *transport, const double *entries, const double *x) {
  const size_t cells = clt_transport_describe(transport).cols;
  double *y = calloc(cells, sizeof *y), apart = 0;
  clt_transport_apply(transport, 0, x, y);
  for (size_t i = 0; i < cells; i++) {
    double wanted = 0;
    for (size_t j = 0; j < cells; j++) {
      wanted += entries[i * cells + j] * x[j];
    }
    apart += (y[i] - wanted) * (y[i] - wanted);
  }
  free(y);
  return sqrt(apart);
}

/* Some entries of the diagonal, by products with one cell. y holds two channels. */
static void check_diagonal(const clt_transport *transport, int channel, double *x, double *y) {
  const size_t cells = clt_transport_describe(transport).cols;
  double *diagonal = y + cells;
  clt_transport_diagonal(transport, channel, diagonal);
  memset(x, 0, cells * sizeof *x);
  for (size_t i = 7; i < cells; i += cells / 5) {
    x[i] = 1;
    clt_transport_apply(transport, channel, x, y);
    assert_near(y[i], diagonal[i], 1e-6);
    x[i] = 0;
  }
}

/* Noise of the columns grows no leaves and is smoothed: what a leaf of n cells tells of it falls by sqrt(4 / n). The
 * flood, a sum that keeps its noise, is even in this drive: its mean is 0. */
static void test_noise(void **unused) {
  (void)unused;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    const size_case size = {64, 48, 1, 0};
    const size_t cells = 64 * 48;
    uint64_t state = seed;
    smooth_room room = make_smooth_room(&size, 0.8, 2e-3, false, &state);
    clt_transport *made = hierarchy_of(room.blocks, 1e-4);
    double *x = calloc(cells, sizeof *x), mean = 0;
    for (size_t j = 0; j < cells; j++) {
      x[j] = smooth_block((int)j, size.width, size.height) % 2 == 0 ? 1 : -1;
      mean += x[j] / (double)cells;
    }
    for (size_t j = 0; j < cells; j++) {
      x[j] -= mean;
    }
    assert_true(clt_hierarchic_of(made)->leaves <= 12);
    assert_true(off_by(made, room.entries, x) < 0.5 * off_by(room.blocks, room.entries, x));
    assert_true(clt_transport_simplified(made) > 1e-4 && clt_transport_simplified(made) < 1e-2);
    free(x);
    clt_transport_destroy(made);
    finish_smooth_room(&room);
  }
}

/* The tolerance, and what leaves leave out of noisy columns, say in how many bits far light is kept. Products of a file
 * are the same to the bit. */
static void test_bits(void **unused) {
  (void)unused;
  static const struct {
    double noise, tolerance;
    int bits;
  } CASES[] = {{5e-2, 5e-2, 8}, {2e-3, 5e-3, 16}, {2e-3, 1e-6, 32}};
  const size_case size = {64, 48, 3, 0};
  const size_t cells = 64 * 48;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/bits.h5", test_folder(folder));
  for (size_t k = 0; k < 3; k++) {
    uint64_t state = 3;
    smooth_room room = make_smooth_room(&size, 0.8, CASES[k].noise, false, &state);
    clt_transport *made = hierarchy_of(room.blocks, CASES[k].tolerance), *read = NULL;
    const clt_hierarchy_storage *own = clt_hierarchic_of(made);
    double *x = random_vector(cells, &state), *y = calloc(4 * cells, sizeof *y);
    clt_error error = {0};
    print_message("tolerance %g: %d bits, %zu sets, rank %zu, %.2g left out\n", CASES[k].tolerance, own->left.bits,
                  own->left.sets, own->rank, own->error);
    assert_int_equal(own->left.bits, CASES[k].bits);
    assert_ok(clt_transport_save(made, path, &error), error);
    assert_ok(clt_transport_load(path, &read, &error), error);
    assert_int_equal(clt_transport_describe(read).bytes, clt_transport_describe(made).bytes);
    for (int c = 0; c < 3; c++) {
      clt_transport_apply(made, c, x, y);
      clt_transport_apply(read, c, x, y + cells);
      clt_transport_apply_transposed(made, c, x, y + 2 * cells);
      clt_transport_apply_transposed(read, c, x, y + 3 * cells);
      assert_memory_equal(y, y + cells, cells * sizeof *y);
      assert_memory_equal(y + 2 * cells, y + 3 * cells, cells * sizeof *y);
      check_diagonal(made, c, x, y);
    }
    free(x);
    free(y);
    clt_transport_destroy(made);
    clt_transport_destroy(read);
    finish_smooth_room(&room);
  }
  unlink(path);
  rmdir(folder);
}

static void test_refusals(void **unused) {
  (void)unused;
  const size_case size = {9, 8, 1, 0};
  uint64_t state = 5;
  clt_error error = {0};
  clt_transport *made = NULL;
  smooth_room room = make_smooth_room(&size, 0.5, 0, false, &state);
  const double bad[] = {-1, 1, NAN};
  for (size_t k = 0; k < 3; k++) {
    assert_int_equal(clt_transport_create_hierarchy(room.blocks, bad[k], &made, &error), CLT_BAD_INPUT);
    assert_null(made);
  }
  assert_true(clt_transport_simplified(room.blocks) == 0);
  finish_smooth_room(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_products), cmocka_unit_test(test_thread_count),
                                     cmocka_unit_test(test_noise), cmocka_unit_test(test_bits),
                                     cmocka_unit_test(test_refusals)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
