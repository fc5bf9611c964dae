/* Loops that threads share: every turn is taken once, a thread's own first and in their order, by any number of
 * threads. */
#include <omp.h>

#include "base/turns.h"
#include "support.h"

enum { MOST = 200 };

static void test_once(void **unused) {
  (void)unused;
  const size_t counts[] = {0, 1, 2, 7, 16, MOST};
  for (int threads = 1; threads <= 40; threads += threads < 4 ? 1 : 12) {
    for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++) {
      clt_turns turns = clt_turns_of(counts[c]);
      int taken[MOST] = {0};
#pragma omp parallel num_threads(threads)
      for (size_t turn = 0; clt_turns_next(&turns, &turn);) {
#pragma omp atomic
        taken[turn]++;
      }
      for (size_t k = 0; k < MOST; k++) {
        assert_int_equal(taken[k], k < counts[c]);
      }
    }
  }
}

/* The first turns of a thread are its own, ascending; one whose fellows do nothing takes all of theirs as well. */
static void test_own_first(void **unused) {
  (void)unused;
  size_t order[MOST], threads = 0, done = 0;
  clt_turns turns = clt_turns_of(MOST);
#pragma omp parallel num_threads(4)
  if (omp_get_thread_num() == omp_get_num_threads() / 2) {
    threads = (size_t)omp_get_num_threads();
    while (clt_turns_next(&turns, &order[done < MOST ? done : MOST - 1])) {
      done++;
    }
  }
  assert_int_equal(done, MOST);
  for (size_t k = 0; k < MOST; k++) {
    assert_int_equal(order[k], (MOST * (threads / 2) / threads + k) % MOST);
  }
}

static void test_few(void **unused) {
  (void)unused;
  for (size_t count = 0; count < 40; count++) {
    clt_turns turns = clt_turns_of_few(count, 8);
    size_t first = 0, end = 0, wanted = 0;
    while (clt_turns_next_few(&turns, count, 8, &first, &end)) {
      assert_int_equal(first, wanted);
      assert_true(end > first && end - first <= 8 && end <= count);
      wanted = end;
    }
    assert_int_equal(wanted, count);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_once), cmocka_unit_test(test_own_first),
                                     cmocka_unit_test(test_few)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
