#include <math.h>
#include <string.h>

#include "base/variants.h"
#include "transport/kernels.h"

/* Of a finite code: exponent and fraction move to where float has them; 2^112 makes up for the exponents' biases, of
 * subnormals too. */
static inline float half_value(uint16_t code) {
  const uint32_t bits = (uint32_t)(code & 0x7fff) << 13 | (uint32_t)(code & 0x8000) << 16;
  float value;
  memcpy(&value, &bits, sizeof value);
  return value * 0x1p112f;
}

float clt_half_value(uint16_t code) {
  if ((code & 0x7c00) == 0x7c00) {
    return (code & 0x03ff) != 0 ? NAN : (code & 0x8000) != 0 ? -INFINITY : INFINITY;
  }
  return half_value(code);
}

uint16_t clt_half_code(float value) {
  const float magnitude = fabsf(value);
  const uint16_t sign = signbit(value) ? 0x8000 : 0;
  if (magnitude < 0x1p-14f) {
    return magnitude >= 0x1p-15f ? sign | 0x0400 : 0;
  }
  uint32_t bits;
  memcpy(&bits, &magnitude, sizeof bits);
  bits += 0x0fff + (bits >> 13 & 1);
  return (uint16_t)(sign | ((bits >> 13) - (112 << 10)));
}

static double fold(float *lane) {
  for (int width = CLT_LANES / 2; width >= 8; width /= 2) {
    for (int k = 0; k < width; k++) {
      lane[k] += lane[k + width];
    }
  }
  double sum = 0;
  for (int k = 0; k < 8; k++) {
    sum += (double)lane[k];
  }
  return sum;
}

/* The columns behind the last whole CLT_LANES. */
static double dot_rest(const uint16_t *code, const float *x, size_t done, size_t count) {
  double sum = 0;
  for (size_t k = done; k < count; k++) {
    sum += (double)(half_value(code[k]) * x[k]);
  }
  return sum;
}

static double dot_portable(const uint16_t *code, const float *x, size_t count) {
  float lane[CLT_LANES] = {0};
  size_t k = 0;
  for (; k + CLT_LANES <= count; k += CLT_LANES) {
    for (size_t l = 0; l < CLT_LANES; l++) {
      lane[l] += half_value(code[k + l]) * x[k + l];
    }
  }
  return fold(lane) + dot_rest(code, x, k, count);
}

/* Eight partial sums of each row, and the columns behind the last whole eight. */
static void fold_rows(float lane[4][8], const uint16_t *const code[4], const float *x, size_t done, size_t count,
                      float sum[4]) {
  for (int r = 0; r < 4; r++) {
    const float *of = lane[r];
    sum[r] = ((of[0] + of[4]) + (of[2] + of[6])) + ((of[1] + of[5]) + (of[3] + of[7]));
    for (size_t k = done; k < count; k++) {
      sum[r] += half_value(code[r][k]) * x[k];
    }
  }
}

static void dots_portable(const uint16_t *const code[4], const float *x, size_t count, float sum[4]) {
  float lane[4][8] = {{0}};
  size_t k = 0;
  for (; k + 8 <= count; k += 8) {
    for (int r = 0; r < 4; r++) {
      for (size_t l = 0; l < 8; l++) {
        lane[r][l] += half_value(code[r][k + l]) * x[k + l];
      }
    }
  }
  fold_rows(lane, code, x, k, count, sum);
}

static void add_from(const uint16_t *const code[4], const float y[4], size_t done, size_t count, float *x) {
  const uint16_t *a = code[0], *b = code[1], *c = code[2], *d = code[3];
  for (size_t k = done; k < count; k++) {
    x[k] += (y[0] * half_value(a[k]) + y[1] * half_value(b[k])) + (y[2] * half_value(c[k]) + y[3] * half_value(d[k]));
  }
}

static void add_portable(const uint16_t *const code[4], const float y[4], size_t count, float *x) {
  add_from(code, y, 0, count, x);
}

static bool runs_everywhere(void) {
  return true;
}

static const clt_half_kernels portable = {
    .runs_here = runs_everywhere, .dot = dot_portable, .dots = dots_portable, .add = add_portable};

#if defined(__x86_64__)
#include <cpuid.h>
#include <immintrin.h>

/* Not every compiler's __builtin_cpu_supports knows f16c: it is bit 29 of ecx in CPUID's leaf 1. */
static bool has_f16c(void) {
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __builtin_cpu_supports("avx2") && __get_cpuid(1, &a, &b, &c, &d) && (c >> 29 & 1u);
}

#define F16C __attribute__((target("avx2,f16c")))

F16C static inline __m256 take_half(const uint16_t *code) {
  return _mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)(const void *)code));
}

F16C static double dot_f16c(const uint16_t *code, const float *x, size_t count) {
  __m256 a = _mm256_setzero_ps(), b = a, c = a, d = a;
  size_t k = 0;
  for (; k + CLT_LANES <= count; k += CLT_LANES) {
    a = _mm256_add_ps(a, _mm256_mul_ps(take_half(code + k), _mm256_loadu_ps(x + k)));
    b = _mm256_add_ps(b, _mm256_mul_ps(take_half(code + k + 8), _mm256_loadu_ps(x + k + 8)));
    c = _mm256_add_ps(c, _mm256_mul_ps(take_half(code + k + 16), _mm256_loadu_ps(x + k + 16)));
    d = _mm256_add_ps(d, _mm256_mul_ps(take_half(code + k + 24), _mm256_loadu_ps(x + k + 24)));
  }
  float lane[CLT_LANES];
  _mm256_storeu_ps(lane, a);
  _mm256_storeu_ps(lane + 8, b);
  _mm256_storeu_ps(lane + 16, c);
  _mm256_storeu_ps(lane + 24, d);
  return fold(lane) + dot_rest(code, x, k, count);
}

F16C static void dots_f16c(const uint16_t *const code[4], const float *x, size_t count, float sum[4]) {
  __m256 a = _mm256_setzero_ps(), b = a, c = a, d = a;
  size_t k = 0;
  for (; k + 8 <= count; k += 8) {
    const __m256 times = _mm256_loadu_ps(x + k);
    a = _mm256_add_ps(a, _mm256_mul_ps(take_half(code[0] + k), times));
    b = _mm256_add_ps(b, _mm256_mul_ps(take_half(code[1] + k), times));
    c = _mm256_add_ps(c, _mm256_mul_ps(take_half(code[2] + k), times));
    d = _mm256_add_ps(d, _mm256_mul_ps(take_half(code[3] + k), times));
  }
  float lane[4][8];
  _mm256_storeu_ps(lane[0], a);
  _mm256_storeu_ps(lane[1], b);
  _mm256_storeu_ps(lane[2], c);
  _mm256_storeu_ps(lane[3], d);
  fold_rows(lane, code, x, k, count, sum);
}

F16C static void add_f16c(const uint16_t *const code[4], const float y[4], size_t count, float *x) {
  const __m256 ya = _mm256_set1_ps(y[0]), yb = _mm256_set1_ps(y[1]);
  const __m256 yc = _mm256_set1_ps(y[2]), yd = _mm256_set1_ps(y[3]);
  size_t k = 0;
  for (; k + 8 <= count; k += 8) {
    __m256 front = _mm256_add_ps(_mm256_mul_ps(ya, take_half(code[0] + k)), _mm256_mul_ps(yb, take_half(code[1] + k)));
    __m256 back = _mm256_add_ps(_mm256_mul_ps(yc, take_half(code[2] + k)), _mm256_mul_ps(yd, take_half(code[3] + k)));
    _mm256_storeu_ps(x + k, _mm256_add_ps(_mm256_loadu_ps(x + k), _mm256_add_ps(front, back)));
  }
  add_from(code, y, k, count, x);
}

static const clt_half_kernels f16c = {
    .needs = "AVX2 and F16C", .runs_here = has_f16c, .dot = dot_f16c, .dots = dots_f16c, .add = add_f16c};

const clt_half_kernels *const clt_half_variants[] = {&f16c, &portable, NULL};
#else
const clt_half_kernels *const clt_half_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_half_choose, clt_half_kernels, clt_half_variants)
