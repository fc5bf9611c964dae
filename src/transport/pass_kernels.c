/* Products with four columns both ways at once, each number read and converted once: what blocks storage is read by. */
#include <string.h>

#include "base/variants.h"
#include "transport/kernels.h"
#include "transport/wide.h"

enum {
  LINE = 16,  /* floats of a cache line */
  LANES = 8,  /* partial sums of a column, so that additions do not wait for each other */
  AHEAD = 256 /* numbers by which memory is asked early: four streams at once are more than it foresees */
};

/* Adds in a fixed order, whatever the processor. */
static double fold(const double *lane) {
  return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

/* The rows behind the last whole LANES, and the sums. */
static void pass_rest(const float *const column[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS], size_t done,
                      size_t count, const double *x, double lane[CLT_PLAIN_ROWS][LANES], double sum[CLT_PLAIN_ROWS],
                      double *out) {
  const float *a = column[0], *b = column[1], *c = column[2], *d = column[3];
  for (size_t k = done; k < count; k++) {
    for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
      lane[r][k - done] += (double)column[r][k] * x[k];
    }
    out[k] += (y[0] * (double)a[k] + y[1] * (double)b[k]) + (y[2] * (double)c[k] + y[3] * (double)d[k]);
  }
  for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
    sum[r] = fold(lane[r]);
  }
}

/* One variant, in vectors of `wide` doubles, LANES / wide of which make up the partial sums of a column. Memory is
 * asked once for each cache line. */
#define VARIANT(name, wide, attributes)                                                                                \
  typedef double wide_##name __attribute__((vector_size(wide * sizeof(double))));                                      \
  attributes static inline void step_##name(const float *const at[CLT_PLAIN_ROWS], const wide_##name *y, size_t k,     \
                                            const double *x, wide_##name *total, double *out) {                        \
    wide_##name in, to;                                                                                                \
    memcpy(&in, x + k, sizeof in);                                                                                     \
    memcpy(&to, out + k, sizeof to);                                                                                   \
    const wide_##name a = clt_take##wide(at[0] + k), b = clt_take##wide(at[1] + k);                                    \
    const wide_##name c = clt_take##wide(at[2] + k), d = clt_take##wide(at[3] + k);                                    \
    total[0] += a * in;                                                                                                \
    total[1] += b * in;                                                                                                \
    total[2] += c * in;                                                                                                \
    total[3] += d * in;                                                                                                \
    to += (y[0] * a + y[1] * b) + (y[2] * c + y[3] * d);                                                               \
    memcpy(out + k, &to, sizeof to);                                                                                   \
  }                                                                                                                    \
  attributes static void pass_##name(const float *const column[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS],        \
                                     const double *x, size_t count, double sum[CLT_PLAIN_ROWS], double *out) {         \
    const float *const at[CLT_PLAIN_ROWS] = {column[0], column[1], column[2], column[3]};                              \
    wide_##name factor[CLT_PLAIN_ROWS], total[LANES / wide][CLT_PLAIN_ROWS] = {{{0}}};                                 \
    double lane[CLT_PLAIN_ROWS][LANES];                                                                                \
    size_t k = 0;                                                                                                      \
    for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) {                                                                      \
      factor[r] = y[r] - (wide_##name){0};                                                                             \
    }                                                                                                                  \
    for (; k + LANES <= count; k += LANES) {                                                                           \
      if (k % LINE == 0) {                                                                                             \
        __builtin_prefetch(at[0] + k + AHEAD);                                                                         \
        __builtin_prefetch(at[1] + k + AHEAD);                                                                         \
        __builtin_prefetch(at[2] + k + AHEAD);                                                                         \
        __builtin_prefetch(at[3] + k + AHEAD);                                                                         \
      }                                                                                                                \
      for (size_t p = 0; p < LANES / wide; p++) {                                                                      \
        step_##name(at, factor, k + p * wide, x, total[p], out);                                                       \
      }                                                                                                                \
    }                                                                                                                  \
    for (size_t p = 0; p < LANES / wide; p++) {                                                                        \
      for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) {                                                                    \
        memcpy(lane[r] + p * wide, &total[p][r], sizeof total[p][r]);                                                  \
      }                                                                                                                \
    }                                                                                                                  \
    pass_rest(column, y, k, count, x, lane, sum, out);                                                                 \
  }                                                                                                                    \
  static const clt_pass_kernels name = {.needs = NEEDS_##name, .runs_here = has_##name, .pass = pass_##name};

#define NEEDS_portable NULL
static bool has_portable(void) {
  return true;
}
VARIANT(portable, 2, )

#if defined(__x86_64__)
#define NEEDS_avx2 "AVX2"
static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}
VARIANT(avx2, 4, CLT_AVX2)

#define NEEDS_avx512 "AVX-512"
static bool has_avx512(void) {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl");
}
VARIANT(avx512, 8, CLT_AVX512)

const clt_pass_kernels *const clt_pass_variants[] = {&avx512, &avx2, &portable, NULL};
#else
const clt_pass_kernels *const clt_pass_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_pass_choose, clt_pass_kernels, clt_pass_variants)
