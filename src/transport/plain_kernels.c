#include "base/variants.h"
#include "transport/kernels.h"
#include "transport/wide.h"

/* Partial sums of a row, so that additions do not wait for each other. */
enum { LANES = 8 };

/* Adds in a fixed order, whatever the processor. */
static double fold(const double *lane) {
  return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

#if defined(__x86_64__)
CLT_AVX2 static inline __m256d take_doubles(const double *at) {
  return _mm256_loadu_pd(at);
}
#endif

#define REAL float
#define NAME(of) of##_float
#define TAKE clt_take4
#include "transport/plain_loops.h"
#undef REAL
#undef NAME
#undef TAKE

#define REAL double
#define NAME(of) of##_double
#define TAKE take_doubles
#include "transport/plain_loops.h"

static bool runs_everywhere(void) {
  return true;
}

static const clt_plain_kernels portable = {.runs_here = runs_everywhere,
                                           .dot_float = dot_portable_float,
                                           .dot_double = dot_portable_double,
                                           .add_float = add_portable_float,
                                           .add_double = add_portable_double};

#if defined(__x86_64__)
static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

static const clt_plain_kernels avx2 = {.needs = "AVX2",
                                       .runs_here = has_avx2,
                                       .dot_float = dot_avx2_float,
                                       .dot_double = dot_avx2_double,
                                       .add_float = add_avx2_float,
                                       .add_double = add_avx2_double};

const clt_plain_kernels *const clt_plain_variants[] = {&avx2, &portable, NULL};
#else
const clt_plain_kernels *const clt_plain_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_plain_choose, clt_plain_kernels, clt_plain_variants)
