/* Reproducible Gaussian noise for tests. */
#ifndef CLT_TESTS_NOISE_H
#define CLT_TESTS_NOISE_H

#include "support.h"

/* A standard normal number (Box and Muller 1958). */
static inline double test_normal(uint64_t *state) {
  double radius = sqrt(-2 * log(1 - test_random(state)));
  return radius * cos(2 * 3.14159265358979323846 * test_random(state));
}

#endif
