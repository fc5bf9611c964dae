/* Floats of memory as vectors of doubles, each for the processor that has them. */
#ifndef CLT_TRANSPORT_WIDE_H
#define CLT_TRANSPORT_WIDE_H

typedef double clt_wide2 __attribute__((vector_size(2 * sizeof(double))));
static inline clt_wide2 clt_take2(const float *at) {
  return (clt_wide2){(double)at[0], (double)at[1]};
}

#if defined(__x86_64__)
#include <immintrin.h>

#define CLT_AVX2 __attribute__((target("avx2")))
#define CLT_AVX512 __attribute__((target("avx512f,avx512vl")))

CLT_AVX2 static inline __m256d clt_take4(const float *at) {
  return _mm256_cvtps_pd(_mm_loadu_ps(at));
}

CLT_AVX512 static inline __m512d clt_take8(const float *at) {
  return _mm512_cvtps_pd(_mm256_loadu_ps(at));
}
#endif

#endif
