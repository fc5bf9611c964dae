#include "base/variants.h"
#include "transport/kernels.h"

/* 16 partial sums: lane l takes the codes l and l + 16 of every block. */
enum { HALF = CLT_BLOCK / 2 };

static double fold(const float lane[HALF]) {
  double sum = 0;
  for (int k = 0; k < HALF / 2; k++) {
    sum += (double)(lane[k] + lane[k + HALF / 2]);
  }
  return sum;
}

/* The columns of the last, short block. */
static double dot_rest(const int8_t *code, const float *scale, const float *x, size_t done, size_t count) {
  double sum = 0;
  for (size_t k = done; k < count; k++) {
    sum += (double)((float)code[k] * x[k]);
  }
  return done < count ? (double)scale[done / CLT_BLOCK] * sum : 0;
}

static double dot_portable(const int8_t *code, const float *scale, const float *x, size_t count) {
  float lane[HALF] = {0};
  size_t k = 0;
  for (; k + CLT_BLOCK <= count; k += CLT_BLOCK) {
    const float block = scale[k / CLT_BLOCK];
    for (size_t l = 0; l < HALF; l++) {
      float sum = (float)code[k + l] * x[k + l] + (float)code[k + HALF + l] * x[k + HALF + l];
      lane[l] += block * sum;
    }
  }
  return fold(lane) + dot_rest(code, scale, x, k, count);
}

/* Eight partial sums of each row, and the columns behind the last whole eight. */
static void fold_rows(float lane[4][8], const int8_t *const code[4], const float *const scale[4], const float *x,
                      size_t done, size_t count, float sum[4]) {
  for (int r = 0; r < 4; r++) {
    const float *of = lane[r];
    sum[r] = ((of[0] + of[4]) + (of[2] + of[6])) + ((of[1] + of[5]) + (of[3] + of[7]));
    for (size_t k = done; k < count; k++) {
      sum[r] += scale[r][k / CLT_BLOCK] * ((float)code[r][k] * x[k]);
    }
  }
}

static void dots_portable(const int8_t *const code[4], const float *const scale[4], const float *x, size_t count,
                          float sum[4]) {
  float lane[4][8] = {{0}};
  size_t k = 0;
  for (; k + 8 <= count; k += 8) {
    for (int r = 0; r < 4; r++) {
      const float block = scale[r][k / CLT_BLOCK];
      for (size_t l = 0; l < 8; l++) {
        lane[r][l] += block * ((float)code[r][k + l] * x[k + l]);
      }
    }
  }
  fold_rows(lane, code, scale, x, k, count, sum);
}

static void add_from(const int8_t *const code[4], const float *const scale[4], const float y[4], size_t done,
                     size_t count, float *x) {
  const int8_t *a = code[0], *b = code[1], *c = code[2], *d = code[3];
  for (size_t first = done, end; first < count; first = end) {
    const size_t block = first / CLT_BLOCK;
    end = (block + 1) * CLT_BLOCK < count ? (block + 1) * CLT_BLOCK : count;
    const float sa = y[0] * scale[0][block], sb = y[1] * scale[1][block];
    const float sc = y[2] * scale[2][block], sd = y[3] * scale[3][block];
    for (size_t k = first; k < end; k++) {
      x[k] += (sa * (float)a[k] + sb * (float)b[k]) + (sc * (float)c[k] + sd * (float)d[k]);
    }
  }
}

static void add_portable(const int8_t *const code[4], const float *const scale[4], const float y[4], size_t count,
                         float *x) {
  add_from(code, scale, y, 0, count, x);
}

static bool runs_everywhere(void) {
  return true;
}

static const clt_byte_kernels portable = {
    .runs_here = runs_everywhere, .dot = dot_portable, .dots = dots_portable, .add = add_portable};

#if defined(__x86_64__)
#include <immintrin.h>

static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

#define AVX2 __attribute__((target("avx2")))

AVX2 static inline __m256 take_bytes(const int8_t *code) {
  return _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)code)));
}

AVX2 static inline __m256 pair(const int8_t *code, const float *x) {
  return _mm256_add_ps(_mm256_mul_ps(take_bytes(code), _mm256_loadu_ps(x)),
                       _mm256_mul_ps(take_bytes(code + HALF), _mm256_loadu_ps(x + HALF)));
}

AVX2 static double dot_avx2(const int8_t *code, const float *scale, const float *x, size_t count) {
  __m256 low = _mm256_setzero_ps(), high = low;
  size_t k = 0;
  for (; k + CLT_BLOCK <= count; k += CLT_BLOCK) {
    const __m256 block = _mm256_set1_ps(scale[k / CLT_BLOCK]);
    low = _mm256_add_ps(low, _mm256_mul_ps(block, pair(code + k, x + k)));
    high = _mm256_add_ps(high, _mm256_mul_ps(block, pair(code + k + 8, x + k + 8)));
  }
  float lane[HALF];
  _mm256_storeu_ps(lane, low);
  _mm256_storeu_ps(lane + HALF / 2, high);
  return fold(lane) + dot_rest(code, scale, x, k, count);
}

AVX2 static inline __m256 scaled(const int8_t *code, const float *scale, __m256 x) {
  return _mm256_mul_ps(_mm256_set1_ps(*scale), _mm256_mul_ps(take_bytes(code), x));
}

AVX2 static void dots_avx2(const int8_t *const code[4], const float *const scale[4], const float *x, size_t count,
                           float sum[4]) {
  __m256 a = _mm256_setzero_ps(), b = a, c = a, d = a;
  size_t k = 0;
  for (; k + 8 <= count; k += 8) {
    const __m256 times = _mm256_loadu_ps(x + k);
    const size_t block = k / CLT_BLOCK;
    a = _mm256_add_ps(a, scaled(code[0] + k, scale[0] + block, times));
    b = _mm256_add_ps(b, scaled(code[1] + k, scale[1] + block, times));
    c = _mm256_add_ps(c, scaled(code[2] + k, scale[2] + block, times));
    d = _mm256_add_ps(d, scaled(code[3] + k, scale[3] + block, times));
  }
  float lane[4][8];
  _mm256_storeu_ps(lane[0], a);
  _mm256_storeu_ps(lane[1], b);
  _mm256_storeu_ps(lane[2], c);
  _mm256_storeu_ps(lane[3], d);
  fold_rows(lane, code, scale, x, k, count, sum);
}

AVX2 static void add_avx2(const int8_t *const code[4], const float *const scale[4], const float y[4], size_t count,
                          float *x) {
  size_t k = 0;
  while (k + 8 <= count) {
    const size_t block = k / CLT_BLOCK, end = (block + 1) * CLT_BLOCK < count ? (block + 1) * CLT_BLOCK : count;
    const __m256 sa = _mm256_set1_ps(y[0] * scale[0][block]), sb = _mm256_set1_ps(y[1] * scale[1][block]);
    const __m256 sc = _mm256_set1_ps(y[2] * scale[2][block]), sd = _mm256_set1_ps(y[3] * scale[3][block]);
    for (; k + 8 <= end; k += 8) {
      __m256 front =
          _mm256_add_ps(_mm256_mul_ps(sa, take_bytes(code[0] + k)), _mm256_mul_ps(sb, take_bytes(code[1] + k)));
      __m256 back =
          _mm256_add_ps(_mm256_mul_ps(sc, take_bytes(code[2] + k)), _mm256_mul_ps(sd, take_bytes(code[3] + k)));
      _mm256_storeu_ps(x + k, _mm256_add_ps(_mm256_loadu_ps(x + k), _mm256_add_ps(front, back)));
    }
  }
  add_from(code, scale, y, k, count, x);
}

static const clt_byte_kernels avx2 = {
    .needs = "AVX2", .runs_here = has_avx2, .dot = dot_avx2, .dots = dots_avx2, .add = add_avx2};

const clt_byte_kernels *const clt_byte_variants[] = {&avx2, &portable, NULL};
#else
const clt_byte_kernels *const clt_byte_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_byte_choose, clt_byte_kernels, clt_byte_variants)
