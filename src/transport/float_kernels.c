/* Four rows of floats at a time, in float. Vectors are those of the compiler, which breaks them up where the processor
 * has shorter ones. */
#include <string.h>

#include "base/variants.h"
#include "transport/kernels.h"

#define INLINE static inline __attribute__((always_inline)) /* into each variant */

enum { LANES = 8, ROWS = CLT_PLAIN_ROWS };
typedef float lanes __attribute__((vector_size(LANES * sizeof(float))));

INLINE void take(lanes *to, const float *from) {
  memcpy(to, from, sizeof *to);
}

INLINE void add(const float *const row[ROWS], const float y[ROWS], size_t count, float *x) {
  size_t k = 0;
  for (; k + LANES <= count; k += LANES) {
    lanes a, b, c, d, sum;
    take(&a, row[0] + k);
    take(&b, row[1] + k);
    take(&c, row[2] + k);
    take(&d, row[3] + k);
    take(&sum, x + k);
    sum += (y[0] * a + y[1] * b) + (y[2] * c + y[3] * d);
    memcpy(x + k, &sum, sizeof sum);
  }
  for (; k < count; k++) {
    x[k] += (y[0] * row[0][k] + y[1] * row[1][k]) + (y[2] * row[2][k] + y[3] * row[3][k]);
  }
}

INLINE void dot(const float *const row[ROWS], const float *x, size_t count, float sum[ROWS]) {
  lanes sums[ROWS] = {0};
  size_t k = 0;
  for (; k + LANES <= count; k += LANES) {
    lanes value, times;
    take(&times, x + k);
    for (size_t r = 0; r < ROWS; r++) {
      take(&value, row[r] + k);
      sums[r] += value * times;
    }
  }
  for (size_t r = 0; r < ROWS; r++) {
    sum[r] = 0;
    for (int l = 0; l < LANES; l++) {
      sum[r] += sums[r][l];
    }
    for (size_t rest = k; rest < count; rest++) {
      sum[r] += row[r][rest] * x[rest];
    }
  }
}

static bool runs_everywhere(void) {
  return true;
}

#define VARIANT(name, attributes, has)                                                                                 \
  attributes static void add_##name(const float *const row[ROWS], const float y[ROWS], size_t count, float *x) {       \
    add(row, y, count, x);                                                                                             \
  }                                                                                                                    \
  attributes static void dot_##name(const float *const row[ROWS], const float *x, size_t count, float sum[ROWS]) {     \
    dot(row, x, count, sum);                                                                                           \
  }                                                                                                                    \
  static const clt_float_kernels name = {.needs = NEEDS_##name, .runs_here = has, .add = add_##name, .dot = dot_##name};

#define NEEDS_portable NULL
VARIANT(portable, , runs_everywhere)

#if defined(__x86_64__)
static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

#define NEEDS_avx2 "AVX2"
VARIANT(avx2, __attribute__((target("avx2"))), has_avx2)

const clt_float_kernels *const clt_float_variants[] = {&avx2, &portable, NULL};
#else
const clt_float_kernels *const clt_float_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_float_choose, clt_float_kernels, clt_float_variants)
