/* Sums and light over the leaves of a hierarchy. */
#include <string.h>

#include "base/variants.h"
#include "transport/kernels.h"
#include "transport/wide.h"

enum { LANES = 4 }; /* partial sums; a leaf is a few times as wide */

/* Asks memory, into the second cache, for what lies behind some numbers of a plane: of as many streams at once it
 * foresees too little. */
enum { AHEAD = 512, LINE = 64, SECOND = 2 };
static inline void foresee_floats(const float *at, size_t count) {
  for (size_t k = 0; k < count; k += LINE / sizeof *at) {
    __builtin_prefetch(at + k + AHEAD, 0, SECOND);
  }
}
static inline void foresee_doubles(const double *at, size_t count) {
  for (size_t k = 0; k < count; k += LINE / sizeof *at) {
    __builtin_prefetch(at + k + AHEAD, 0, SECOND);
  }
}

#define WIDE 2
#define NAME(of) of##_portable
#define FOR
#define TAKE clt_take2
#include "transport/leaf_loops.h"
#undef WIDE
#undef NAME
#undef FOR
#undef TAKE

static bool runs_everywhere(void) {
  return true;
}

static const clt_leaf_kernels portable = {.runs_here = runs_everywhere, .sum = sum_portable, .spread = spread_portable};

#if defined(__x86_64__)
#define WIDE 4
#define NAME(of) of##_avx2
#define FOR CLT_AVX2
#define TAKE clt_take4
#include "transport/leaf_loops.h"

static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

static const clt_leaf_kernels avx2 = {.needs = "AVX2", .runs_here = has_avx2, .sum = sum_avx2, .spread = spread_avx2};

const clt_leaf_kernels *const clt_leaf_variants[] = {&avx2, &portable, NULL};
#else
const clt_leaf_kernels *const clt_leaf_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_leaf_choose, clt_leaf_kernels, clt_leaf_variants)
