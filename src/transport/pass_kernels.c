/* Products with four columns both ways at once, each number read and converted once: what blocks storage is read by. */
#include <string.h>

#include "transport/kernels.h"

enum {
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

/* One variant, in vectors of `width` doubles, LANES / width of which make up the partial sums of a column. */
#define VARIANT(name, width, attributes)                                                                               \
  typedef double wide_##name __attribute__((vector_size(width * sizeof(double))));                                     \
  typedef float brief_##name __attribute__((vector_size(width * sizeof(float))));                                      \
  attributes static void pass_##name(const float *const column[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS],        \
                                     const double *x, size_t count, double sum[CLT_PLAIN_ROWS], double *out) {         \
    enum { PARTS = LANES / width };                                                                                    \
    wide_##name total[CLT_PLAIN_ROWS][PARTS] = {{{0}}};                                                                \
    double lane[CLT_PLAIN_ROWS][LANES];                                                                                \
    size_t k = 0;                                                                                                      \
    for (; k + LANES <= count; k += LANES) {                                                                           \
      for (size_t p = 0; p < PARTS; p++) {                                                                             \
        wide_##name in, to, value[CLT_PLAIN_ROWS];                                                                     \
        memcpy(&in, x + k + p * width, sizeof in);                                                                     \
        memcpy(&to, out + k + p * width, sizeof to);                                                                   \
        for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) {                                                                  \
          brief_##name code;                                                                                           \
          __builtin_prefetch(column[r] + k + AHEAD);                                                                   \
          memcpy(&code, column[r] + k + p * width, sizeof code);                                                       \
          value[r] = __builtin_convertvector(code, wide_##name);                                                       \
          total[r][p] += value[r] * in;                                                                                \
        }                                                                                                              \
        to += (y[0] * value[0] + y[1] * value[1]) + (y[2] * value[2] + y[3] * value[3]);                               \
        memcpy(out + k + p * width, &to, sizeof to);                                                                   \
      }                                                                                                                \
    }                                                                                                                  \
    memcpy(lane, total, sizeof lane);                                                                                  \
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
VARIANT(avx2, 4, __attribute__((target("avx2"))))

#define NEEDS_avx512 "AVX-512"
static bool has_avx512(void) {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl");
}
VARIANT(avx512, 8, __attribute__((target("avx512f,avx512vl"))))

const clt_pass_kernels *const clt_pass_variants[] = {&avx512, &avx2, &portable, NULL};
#else
const clt_pass_kernels *const clt_pass_variants[] = {&portable, NULL};
#endif

const clt_pass_kernels *clt_pass_choose(void) {
  size_t k = 0;
  while (!clt_pass_variants[k]->runs_here()) {
    k++;
  }
  return clt_pass_variants[k];
}
