/* Memory: zeroed and aligned at every size, none where the size overflows. */
#include "base/memory.h"

#include <stdint.h>
#include <stdlib.h>

#include "support.h"

enum { LARGE = 1 << 21 };

static void look_through(void *(*alloc)(size_t, size_t), size_t count, size_t size, size_t alignment) {
  unsigned char *memory = alloc(count, size);
  size_t others = 0;
  assert_non_null(memory);
  assert_int_equal((uintptr_t)memory % alignment, 0);
  for (size_t k = 0; k < count * size; k++) {
    others += memory[k] != 0;
    memory[k] = 0xa5; /* for who is given it next */
  }
  assert_int_equal(others, 0);
  free(memory);
}

static void test_sizes(void **unused) {
  (void)unused;
  static const size_t COUNTS[] = {0, 1, 7, 64, 1000, LARGE - 1, LARGE, 4 * LARGE - 1, 4 * LARGE, 5 * LARGE + 3};
  for (int turn = 0; turn < 2; turn++) {
    for (size_t k = 0; k < sizeof COUNTS / sizeof COUNTS[0]; k++) {
      look_through(clt_alloc, COUNTS[k], 1, 64);
      look_through(clt_alloc_large, COUNTS[k], 1, COUNTS[k] >= 4 * LARGE ? LARGE : 64);
      look_through(clt_alloc_large, COUNTS[k] / 12, 12, 64);
    }
  }
}

static void test_too_much(void **unused) {
  (void)unused;
  static const size_t SIZES[] = {1, 8, 24};
  for (size_t k = 0; k < sizeof SIZES / sizeof SIZES[0]; k++) {
    assert_null(clt_alloc(SIZE_MAX / SIZES[k], SIZES[k]));
    assert_null(clt_alloc_large(SIZE_MAX / SIZES[k], SIZES[k]));
    assert_null(clt_alloc_large(SIZE_MAX / SIZES[k] - 1, SIZES[k]));
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_sizes), cmocka_unit_test(test_too_much)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
