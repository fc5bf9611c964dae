/* What the cmocka tests share. */
#ifndef CLT_TESTS_SUPPORT_H
#define CLT_TESTS_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
/* cmocka.h needs the four above */
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "counterlight/status.h"

/* Fails with both values where |actual - wanted| > tolerance or either is not finite. */
#define assert_near(actual, wanted, tolerance)                                                                         \
  do {                                                                                                                 \
    double near_actual = (actual), near_wanted = (wanted);                                                             \
    if (!(fabs(near_actual - near_wanted) <= (tolerance))) {                                                           \
      fail_msg("%s = %.9g, wanted %.9g within %.3g", #actual, near_actual, near_wanted, (double)(tolerance));          \
    }                                                                                                                  \
  } while (0)

/* Fails with the message of error where status is not CLT_OK. */
#define assert_ok(outcome, failure)                                                                                    \
  do {                                                                                                                 \
    if ((outcome) != CLT_OK) {                                                                                         \
      fail_msg("%s: %s", clt_status_name((failure).status), (failure).message);                                        \
    }                                                                                                                  \
  } while (0)

/* A reproducible uniform number in 0..1 (splitmix64). */
static inline double test_random(uint64_t *state) {
  uint64_t z = (*state += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/* A fresh folder for files of a test; the test removes what it writes. */
static inline const char *test_folder(char folder[64]) {
  strcpy(folder, "/tmp/counterlight-test-XXXXXX");
  assert_non_null(mkdtemp(folder));
  return folder;
}

#endif
