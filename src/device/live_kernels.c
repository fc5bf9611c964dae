#include "device/live_kernels.h"
#include "base/variants.h"

#include <math.h>
#include <string.h>

enum { COLOURS = CLT_LIVE_COLOURS };

#define INLINE static inline __attribute__((always_inline)) /* into each variant */

/* Bits of a fraction within a piece; and those of the number from which pieces count. */
enum { PART_BITS = 23 - CLT_LIVE_FINE, FIRST_BITS = (127 - CLT_LIVE_OCTAVES) << 23 };
static const float toe = 1.0F / (1 << CLT_LIVE_OCTAVES);

void clt_live_tabulate(const clt_curve *response, clt_live_piece piece[CLT_LIVE_PIECES]) {
  double next = clt_curve_encode(response, 0);
  for (int k = 0; k < CLT_LIVE_PIECES; k++) {
    const int fine = 1 << CLT_LIVE_FINE, octave = (k + 1) / fine - CLT_LIVE_OCTAVES;
    const double end = ldexp(1 + (double)((k + 1) % fine) / fine, octave) - (double)toe, code = next;
    next = clt_curve_encode(response, fmin(end, 1));
    piece[k] = (clt_live_piece){(float)code, (float)(next - code)};
  }
}

typedef float four __attribute__((vector_size(4 * sizeof(float))));
typedef uint64_t two __attribute__((vector_size(2 * sizeof(uint64_t))));

INLINE uint64_t whole(const clt_live_piece *piece) {
  uint64_t bits;
  memcpy(&bits, piece, sizeof bits);
  return bits;
}

INLINE void split(const uint8_t *codes, size_t done, size_t count, uint8_t *plane) {
  uint8_t *red = plane, *green = plane + count, *blue = plane + 2 * count;
  for (size_t x = done; x < count; x++) {
    red[x] = codes[COLOURS * x];
    green[x] = codes[COLOURS * x + 1];
    blue[x] = codes[COLOURS * x + 2];
  }
}

INLINE void expand(const float *own, const int32_t *at, const float *part, size_t done, size_t count, float *out) {
  for (size_t x = done; x < count; x++) {
    const float value = own[at[x]];
    out[x] = value + part[x] * (own[at[x] + 1] - value);
  }
}

/* Pieces are loaded one by one and sorted in registers: gathers are not faster, and missing from many processors. */
INLINE void interpolate(const clt_live_piece *piece, const int32_t *at, const float *part, size_t count, float *out) {
  size_t x = 0;
  for (; x + 4 <= count; x += 4) {
    const four front = (four)(two){whole(piece + at[x]), whole(piece + at[x + 1])};
    const four back = (four)(two){whole(piece + at[x + 2]), whole(piece + at[x + 3])};
    const four value = __builtin_shufflevector(front, back, 0, 2, 4, 6);
    const four step = __builtin_shufflevector(front, back, 1, 3, 5, 7);
    four way;
    memcpy(&way, part + x, sizeof way);
    const four sum = value + way * step;
    memcpy(out + x, &sum, sizeof sum);
  }
  for (; x < count; x++) {
    out[x] = piece[at[x]].value + part[x] * piece[at[x]].step;
  }
}

INLINE float clip(float value) {
  value = value > 0 ? value : 0; /* NaN too */
  return value < 1 ? value : 1;
}

INLINE void drive(const clt_live_field *gain, const clt_live_field *offset, float down, const float *restrict light,
                  size_t count, float *restrict out) {
  const float *restrict gain_above = gain->upper, *restrict gain_below = gain->lower;
  const float *restrict offset_above = offset->upper, *restrict offset_below = offset->lower;
  for (size_t x = 0; x < count; x++) {
    const float by = gain_above[x] + down * (gain_below[x] - gain_above[x]);
    const float more = offset_above[x] + down * (offset_below[x] - offset_above[x]);
    out[x] = clip(by * light[x] + more);
  }
}

INLINE void place(const float *restrict light, size_t count, int32_t *restrict at, float *restrict part) {
  for (size_t x = 0; x < count; x++) {
    const float value = light[x] + toe;
    int32_t bits;
    memcpy(&bits, &value, sizeof bits);
    at[x] = (bits - FIRST_BITS) >> PART_BITS;
    part[x] = (float)(bits & ((1 << PART_BITS) - 1)) * (1.0F / (1 << PART_BITS));
  }
}

/* A number in 1..2 for each counter: 32 bits, of which vectors are multiplied at once and the upper ones make the
 * fraction. The multipliers are those that Wellons found to bias least. */
INLINE float scatter(uint32_t key) {
  key = (key ^ (key >> 16)) * 0x7feb352du;
  key = (key ^ (key >> 15)) * 0x846ca68bu;
  const uint32_t bits = key >> 9 | 0x3f800000;
  float number;
  memcpy(&number, &bits, sizeof number);
  return number;
}

INLINE void dither(float *codes, size_t count, float full, uint32_t start) {
  for (size_t k = 0; k < count; k++) {
    const float step = (float)((int32_t)(codes[k] * full + scatter(start + (uint32_t)k)) - 1);
    codes[k] = (step < full ? step : full) / full;
  }
}

/* A byte plus 1: what scatter brings along goes at once from all three. */
enum { BYTE = 255 };

INLINE int32_t byte_above(float code, uint32_t key) {
  const int32_t step = (int32_t)(code * BYTE + scatter(key));
  return step <= BYTE ? step : BYTE + 1;
}

INLINE void paint(const float *const codes[COLOURS], const uint32_t start[COLOURS], size_t count,
                  uint32_t *restrict pixels) {
  const float *restrict red = codes[0], *restrict green = codes[1], *restrict blue = codes[2];
  const uint32_t first = start[0], second = start[1], third = start[2];
  for (int32_t x = 0; x < (int32_t)count; x++) {
    const uint32_t key = (uint32_t)x;
    const int32_t r = byte_above(red[x], first + key), g = byte_above(green[x], second + key),
                  b = byte_above(blue[x], third + key);
    pixels[x] = (uint32_t)((r << 16) + (g << 8) + b - 0x010101);
  }
}

#define VARIANT(name, attributes)                                                                                      \
  attributes static void interpolate_##name(const clt_live_piece *piece, const int32_t *at, const float *part,         \
                                            size_t count, float *out) {                                                \
    interpolate(piece, at, part, count, out);                                                                          \
  }                                                                                                                    \
  attributes static void drive_##name(const clt_live_field *gain, const clt_live_field *offset, float down,            \
                                      const float *light, size_t count, float *out) {                                  \
    drive(gain, offset, down, light, count, out);                                                                      \
  }                                                                                                                    \
  attributes static void place_##name(const float *light, size_t count, int32_t *at, float *part) {                    \
    place(light, count, at, part);                                                                                     \
  }                                                                                                                    \
  attributes static void dither_##name(float *codes, size_t count, float full, uint32_t start) {                       \
    dither(codes, count, full, start);                                                                                 \
  }                                                                                                                    \
  attributes static void paint_##name(const float *const codes[COLOURS], const uint32_t start[COLOURS], size_t count,  \
                                      uint32_t *pixels) {                                                              \
    paint(codes, start, count, pixels);                                                                                \
  }                                                                                                                    \
  static const clt_live_row_kernels name = {.needs = NEEDS_##name,                                                     \
                                            .runs_here = has_##name,                                                   \
                                            .split = split_##name,                                                     \
                                            .expand = expand_##name,                                                   \
                                            .interpolate = interpolate_##name,                                         \
                                            .drive = drive_##name,                                                     \
                                            .place = place_##name,                                                     \
                                            .dither = dither_##name,                                                   \
                                            .paint = paint_##name};

static bool has_portable(void) {
  return true;
}

static void split_portable(const uint8_t *codes, size_t count, uint8_t *plane) {
  split(codes, 0, count, plane);
}

static void expand_portable(const float *own, const int32_t *at, const float *part, size_t count, float *out) {
  expand(own, at, part, 0, count, out);
}

#define NEEDS_portable NULL
VARIANT(portable, )

#if defined(__x86_64__)
#include <immintrin.h>

static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

/* Sixteen pixels lie in three vectors. Lane j of vector p is of colour p + j modulo 3, so that each lane of a plane is
 * taken from one of them; byte i of the plane then stands in lane 3 i + c modulo 16. */
__attribute__((target("avx2"))) static void split_avx2(const uint8_t *codes, size_t count, uint8_t *plane) {
  enum { LANES = 16 };
  const __m128i third = _mm_setr_epi8(-1, 0, 0, -1, 0, 0, -1, 0, 0, -1, 0, 0, -1, 0, 0, -1);
  const __m128i order = _mm_setr_epi8(0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14, 1, 4, 7, 10, 13);
  size_t x = 0;
  for (; x + LANES <= count; x += LANES) {
    const __m128i *from = (const __m128i *)(codes + COLOURS * x);
    const __m128i all[COLOURS] = {_mm_loadu_si128(from), _mm_loadu_si128(from + 1), _mm_loadu_si128(from + 2)};
    for (int c = 0; c < COLOURS; c++) {
      const __m128i some = _mm_blendv_epi8(all[c], all[(c + 2) % COLOURS], _mm_slli_si128(third, 1));
      const __m128i own = _mm_blendv_epi8(some, all[(c + 1) % COLOURS], _mm_slli_si128(third, 2));
      const __m128i at = _mm_and_si128(_mm_add_epi8(order, _mm_set1_epi8((char)c)), _mm_set1_epi8(LANES - 1));
      _mm_storeu_si128((__m128i *)(plane + (size_t)c * count + x), _mm_shuffle_epi8(own, at));
    }
  }
  split(codes, x, count, plane);
}

/* Eight columns lie between two of eight cells as a rule: a panel has more columns than its grid. */
__attribute__((target("avx2"))) static void expand_avx2(const float *own, const int32_t *at, const float *part,
                                                        size_t count, float *out) {
  enum { LANES = 8 };
  size_t x = 0;
  for (; x + LANES <= count && at[x + LANES - 1] - at[x] < LANES; x += LANES) {
    const float *first = own + at[x];
    const __m256i lane = _mm256_sub_epi32(_mm256_loadu_si256((const __m256i *)(at + x)), _mm256_set1_epi32(at[x]));
    const __m256 value = _mm256_permutevar8x32_ps(_mm256_loadu_ps(first), lane);
    const __m256 next = _mm256_permutevar8x32_ps(_mm256_loadu_ps(first + 1), lane);
    const __m256 way = _mm256_mul_ps(_mm256_loadu_ps(part + x), _mm256_sub_ps(next, value));
    _mm256_storeu_ps(out + x, _mm256_add_ps(value, way));
  }
  expand(own, at, part, x, count, out);
}

#define NEEDS_avx2 "AVX2"
VARIANT(avx2, __attribute__((target("avx2"))))

const clt_live_row_kernels *const clt_live_row_variants[] = {&avx2, &portable, NULL};
#else
const clt_live_row_kernels *const clt_live_row_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_live_row_choose, clt_live_row_kernels, clt_live_row_variants)
