/* The pyramid's numbering, flood corrections, and what a tree refuses. */
#include <pthread.h>

#include "cases.h"

static void test_numbering(void **unused) {
  (void)unused;
  assert_int_equal(clt_tree_levels(1, 1), 1);
  assert_int_equal(clt_tree_levels(64, 48), 7);
  assert_int_equal(clt_tree_levels(65, 2), 8);
  assert_int_equal(clt_tree_levels(CLT_GRID_SIDE_MAX, 1), 15);
  assert_int_equal(clt_tree_nodes(1, 1), 1);
  for (size_t k = 0; k < SIZE_CASES; k++) {
    const int width = size_cases[k].width, height = size_cases[k].height;
    int32_t count = 0;
    for (int level = 0; level < clt_tree_levels(width, height); level++) {
      const int side = 1 << level;
      for (int by = 0; by * side < height; by++) {
        for (int bx = 0; bx * side < width; bx++) {
          assert_int_equal(clt_tree_node(width, height, level, bx, by), count);
          block found = find_block(width, height, count++);
          assert_int_equal(found.left, bx * side);
          assert_int_equal(found.top, by * side);
        }
      }
    }
    assert_int_equal(count, clt_tree_nodes(width, height));
    block whole = find_block(width, height, count - 1);
    assert_int_equal((whole.right - whole.left) * (whole.bottom - whole.top), width * height);
  }
}

/* Cells alone are a dense T; an entry c_i at the top node adds c_i N mean(x). */
static void test_flood_node(void **unused) {
  (void)unused;
  const size_case size = {11, 6, 1, 66};
  enum { N = 66 };
  uint64_t state = 3;
  clt_error error;
  known_transport dense = random_dense(&size, &state);
  int64_t start[N + 1] = {0};
  static int32_t node[N * (N + 1)];
  static float value[N * (N + 1)];
  double correction[N];
  for (int i = 0; i < N; i++) {
    start[i + 1] = start[i] + N + 1;
    for (int j = 0; j < N; j++) {
      node[start[i] + j] = clt_tree_node(11, 6, 0, j % 11, j / 11);
      value[start[i] + j] = clt_transport_entries(dense.transport, 0)[i * N + j];
    }
    node[start[i] + N] = clt_tree_node(11, 6, clt_tree_levels(11, 6) - 1, 0, 0);
    value[start[i] + N] = (float)(0.01 * test_random(&state));
    correction[i] = (double)value[start[i] + N];
  }
  clt_transport *tree;
  assert_ok(clt_transport_create_tree(11, 6, 1, N, start, node, value, &tree, &error), error);
  assert_string_equal(clt_transport_describe(tree).storage, "tree");
  assert_null(clt_transport_entries(tree, 0));
  double *x = random_vector(N, &state), y[N], wanted[N], mean = 0;
  for (int j = 0; j < N; j++) {
    mean += x[j] / N;
  }
  clt_transport_apply(tree, 0, x, y);
  clt_transport_apply(dense.transport, 0, x, wanted);
  for (int i = 0; i < N; i++) {
    assert_near(y[i], wanted[i] + correction[i] * N * mean, 1e-12);
  }
  free(x);
  clt_transport_destroy(tree);
  finish_known(&dense);
}

static void refuse(int width, int channels, size_t rows, const int64_t *start, const int32_t *node, const float *value,
                   const char *word) {
  clt_transport *transport = (clt_transport *)1;
  clt_error error;
  assert_int_equal(clt_transport_create_tree(width, 3, channels, rows, start, node, value, &transport, &error),
                   CLT_BAD_INPUT);
  assert_null(transport);
  if (strstr(error.message, word) == NULL) {
    fail_msg("\"%s\" does not name %s", error.message, word);
  }
}

static void test_refusals(void **unused) {
  (void)unused;
  const int64_t start[] = {0, 2, 3}, falling[] = {0, 4, 3}, late[] = {1, 2, 3}, negative[] = {0, 0, -1};
  const int32_t node[] = {0, 21, 2}, high[] = {0, 3, 22},
                low[] = {0, -1, 2}; /* 15 cells, 3 x 2, 2 x 1 blocks, top: 24 */
  const float value[] = {1, .5f, .25f}, nan_value[] = {1, NAN, 0}, infinite[] = {1, 0, INFINITY};
  clt_transport *transport;
  clt_error error;
  assert_int_equal(clt_tree_nodes(5, 3), 24);
  assert_ok(clt_transport_create_tree(5, 3, 1, 2, start, high, value, &transport, &error), error);
  clt_transport_destroy(transport);
  const int32_t beyond[] = {0, 3, 24};
  refuse(5, 1, 2, start, beyond, value, "/tree/node[2]");
  refuse(5, 1, 2, start, low, value, "/tree/node[1]");
  refuse(5, 1, 2, falling, node, value, "/tree/start[1]");
  refuse(5, 1, 2, late, node, value, "/tree/start[0]");
  refuse(5, 1, 2, negative, node, value, "-1 entries");
  refuse(5, 1, 2, start, node, nan_value, "/tree/value[0, 1]");
  refuse(5, 1, 2, start, node, infinite, "/tree/value[0, 2]");
  refuse(0, 1, 2, start, node, value, "1..16384");
  refuse(CLT_GRID_SIDE_MAX + 1, 1, 2, start, node, value, "1..16384");
  refuse(5, 5, 2, start, node, value, "5 channels");
  refuse(5, 1, 0, start, node, value, "0 rows");
}

typedef struct product {
  const clt_transport *transport;
  const double *x;
  double *y;
} product;

static void *repeat_product(void *argument) {
  const product *task = argument;
  for (int k = 0; k < 50; k++) {
    clt_transport_apply(task->transport, 0, task->x, task->y);
  }
  return NULL;
}

/* Two threads at one channel of one transport do not disturb each other. */
static void test_concurrent(void **unused) {
  (void)unused;
  const size_case size = {33, 17, 1, 561};
  uint64_t state = 8;
  known_transport known = random_tree(&size, &state);
  double *x[2], *y[2], *wanted = random_vector(size.rows, &state);
  pthread_t threads[2];
  product tasks[2];
  for (int k = 0; k < 2; k++) {
    x[k] = random_vector(size.rows, &state);
    y[k] = random_vector(size.rows, &state);
    tasks[k] = (product){known.transport, x[k], y[k]};
    assert_int_equal(pthread_create(&threads[k], NULL, repeat_product, &tasks[k]), 0);
  }
  for (int k = 0; k < 2; k++) {
    assert_int_equal(pthread_join(threads[k], NULL), 0);
  }
  for (int k = 0; k < 2; k++) {
    clt_transport_apply(known.transport, 0, x[k], wanted);
    assert_memory_equal(wanted, y[k], size.rows * sizeof *wanted);
    free(x[k]);
    free(y[k]);
  }
  free(wanted);
  finish_known(&known);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_numbering), cmocka_unit_test(test_flood_node),
                                     cmocka_unit_test(test_refusals), cmocka_unit_test(test_concurrent)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
