#include "image/light_kernels.h"
#include "base/variants.h"

#include <string.h>

#include "counterlight/image.h"

#define INLINE static inline __attribute__((always_inline)) /* into each variant */

enum { AT_ONCE = 8 /* codes that come with one load */ };

void clt_light_fill(clt_light_table *table) {
  const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  for (int code = 0; code < CLT_LIGHT_CODES; code++) {
    uint32_t bits;
    table->light[code] = (float)clt_curve_decode(&srgb, code / (double)(CLT_LIGHT_CODES - 1));
    memcpy(&bits, &table->light[code], sizeof bits);
    for (size_t k = 0; k < sizeof bits; k++) {
      table->byte[k][code] = (uint8_t)(bits >> (8 * k));
    }
  }
}

/* Vectors are those of the compiler, filled number by number: tables are not looked up faster by gathers. */
typedef float lanes __attribute__((vector_size(AT_ONCE * sizeof(float))));

INLINE void light_of(const clt_light_table *table, const uint8_t *codes, lanes *out) {
  const float *light = table->light;
  uint64_t all;
  memcpy(&all, codes, sizeof all);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  all = __builtin_bswap64(all);
#endif
  *out = (lanes){light[all & 255],         light[(all >> 8) & 255],  light[(all >> 16) & 255], light[(all >> 24) & 255],
                 light[(all >> 32) & 255], light[(all >> 40) & 255], light[(all >> 48) & 255], light[all >> 56]};
}

INLINE void look_up(const clt_light_table *table, const uint8_t *codes, size_t count, float *light) {
  size_t k = 0;
  for (; k + AT_ONCE <= count; k += AT_ONCE) {
    lanes value;
    light_of(table, codes + k, &value);
    memcpy(light + k, &value, sizeof value);
  }
  for (; k < count; k++) {
    light[k] = table->light[codes[k]];
  }
}

/* The codes from `done` on, one by one. */
INLINE void add_rest(const clt_light_table *table, const clt_light_rows *rows, size_t done, size_t count, float *kept,
                     float *sums) {
  for (size_t k = done; k < count; k++) {
    float sum = rows->before * kept[k];
    for (size_t r = 0; r < rows->count; r++) {
      kept[k] = table->light[rows->codes[r * rows->stride + k]];
      sum += r + 1 < rows->count ? kept[k] : rows->after * kept[k];
    }
    sums[k] = sum;
  }
}

INLINE void add_rows(const clt_light_table *table, const clt_light_rows *rows, size_t count, float *kept, float *sums) {
  size_t k = 0;
  for (; k + AT_ONCE <= count; k += AT_ONCE) {
    lanes sum, value;
    memcpy(&value, kept + k, sizeof value);
    sum = rows->before * value;
    for (size_t r = 0; r < rows->count; r++) {
      light_of(table, rows->codes + r * rows->stride + k, &value);
      sum += r + 1 < rows->count ? value : rows->after * value;
    }
    memcpy(kept + k, &value, sizeof value);
    memcpy(sums + k, &sum, sizeof sum);
  }
  add_rest(table, rows, k, count, kept, sums);
}

#define VARIANT(name, attributes)                                                                                      \
  attributes static void look_up_##name(const clt_light_table *table, const uint8_t *codes, size_t count,              \
                                        float *light) {                                                                \
    look_up(table, codes, count, light);                                                                               \
  }                                                                                                                    \
  attributes static void add_rows_##name(const clt_light_table *table, const clt_light_rows *rows, size_t count,       \
                                         float *kept, float *sums) {                                                   \
    add_rows(table, rows, count, kept, sums);                                                                          \
  }                                                                                                                    \
  static const clt_light_kernels name = {                                                                              \
      .needs = NEEDS_##name, .runs_here = has_##name, .look_up = look_up_##name, .add_rows = add_rows_##name};

static bool has_portable(void) {
  return true;
}

#define NEEDS_portable NULL
VARIANT(portable, )

#if defined(__x86_64__)
#include <immintrin.h>

static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

#define NEEDS_avx2 "AVX2"
VARIANT(avx2, __attribute__((target("avx2"))))

static bool has_bytes(void) {
  return __builtin_cpu_supports("avx512vbmi") && __builtin_cpu_supports("avx512bw");
}

#define BYTES __attribute__((target("avx512f,avx512bw,avx512vbmi")))

/* The whole table in registers: byte k of the light of codes 64 q and up. */
enum { WIDE = 64, PARTS = CLT_LIGHT_CODES / WIDE, LANES = 16 };
typedef struct held_table {
  __m512i byte[sizeof(float)][PARTS];
} held_table;

BYTES INLINE void hold(const clt_light_table *table, held_table *held) {
  for (size_t k = 0; k < sizeof(float); k++) {
    for (size_t q = 0; q < PARTS; q++) {
      held->byte[k][q] = _mm512_loadu_si512(table->byte[k] + q * WIDE);
    }
  }
}

/* Light of 64 codes. Unpacking puts byte 16 l + 4 q + i into lane l of vector q, so that code comes there first. */
BYTES INLINE void light_of_64(const held_table *held, const uint8_t *codes, __m512 out[PARTS]) {
  const __m512i order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
  const __m512i at = _mm512_permutexvar_epi32(order, _mm512_loadu_si512(codes));
  const __mmask64 upper = _mm512_movepi8_mask(at);
  __m512i byte[sizeof(float)];
  for (size_t k = 0; k < sizeof(float); k++) {
    byte[k] = _mm512_mask_blend_epi8(upper, _mm512_permutex2var_epi8(held->byte[k][0], at, held->byte[k][1]),
                                     _mm512_permutex2var_epi8(held->byte[k][2], at, held->byte[k][3]));
  }
  const __m512i low = _mm512_unpacklo_epi8(byte[0], byte[1]), low_top = _mm512_unpacklo_epi8(byte[2], byte[3]);
  const __m512i high = _mm512_unpackhi_epi8(byte[0], byte[1]), high_top = _mm512_unpackhi_epi8(byte[2], byte[3]);
  out[0] = _mm512_castsi512_ps(_mm512_unpacklo_epi16(low, low_top));
  out[1] = _mm512_castsi512_ps(_mm512_unpackhi_epi16(low, low_top));
  out[2] = _mm512_castsi512_ps(_mm512_unpacklo_epi16(high, high_top));
  out[3] = _mm512_castsi512_ps(_mm512_unpackhi_epi16(high, high_top));
}

BYTES static void look_up_bytes(const clt_light_table *table, const uint8_t *codes, size_t count, float *light) {
  held_table held;
  size_t k = 0;
  hold(table, &held);
  for (; k + WIDE <= count; k += WIDE) {
    __m512 value[PARTS];
    light_of_64(&held, codes + k, value);
    for (size_t q = 0; q < PARTS; q++) {
      _mm512_storeu_ps(light + k + q * LANES, value[q]);
    }
  }
  look_up(table, codes + k, count - k, light + k);
}

BYTES static void add_rows_bytes(const clt_light_table *table, const clt_light_rows *rows, size_t count, float *kept,
                                 float *sums) {
  held_table held;
  size_t k = 0;
  hold(table, &held);
  for (; k + WIDE <= count; k += WIDE) {
    __m512 sum[PARTS], value[PARTS];
    for (size_t q = 0; q < PARTS; q++) {
      value[q] = _mm512_loadu_ps(kept + k + q * LANES);
      sum[q] = _mm512_mul_ps(_mm512_set1_ps(rows->before), value[q]);
    }
    for (size_t r = 0; r < rows->count; r++) {
      const __m512 share = _mm512_set1_ps(r + 1 < rows->count ? 1 : rows->after);
      light_of_64(&held, rows->codes + r * rows->stride + k, value);
      for (size_t q = 0; q < PARTS; q++) {
        sum[q] = _mm512_add_ps(sum[q], _mm512_mul_ps(share, value[q]));
      }
    }
    for (size_t q = 0; q < PARTS; q++) {
      _mm512_storeu_ps(kept + k + q * LANES, value[q]);
      _mm512_storeu_ps(sums + k + q * LANES, sum[q]);
    }
  }
  add_rest(table, rows, k, count, kept, sums);
}

static const clt_light_kernels bytes = {
    .needs = "AVX-512 VBMI", .runs_here = has_bytes, .look_up = look_up_bytes, .add_rows = add_rows_bytes};

const clt_light_kernels *const clt_light_variants[] = {&bytes, &avx2, &portable, NULL};
#else
const clt_light_kernels *const clt_light_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_light_choose, clt_light_kernels, clt_light_variants)
