#include "rig/geometry/decode.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/order.h"
#include "rig/geometry/blur.h"
#include "rig/geometry/refine.h"

enum { TILE = 64, FEW_LIT = 64, COARSEST = 4, HYPOTHESES_MAX = 3 * CLT_BLUR_STEPS_MAX << COARSEST };
#define LIT 6.0          /* amplitude over noise from which a pixel is decoded */
#define LEAST_LIGHT 0.03 /* of full scale: below it a longer exposure tells more */
#define SURE 3.0         /* difference over noise from which its sign counts */
#define WHOLE 0.3        /* share of a bit's full height from which one place lights the pixel */
/* Share of the amplitude that a profile is trusted to. Light that scatters to one side shifts the edges of wide
 * stripes, while fine ones show the direct light's place; so wide ones only tell the cell. */
#define TRUST_FINE 0.07F
#define TRUST_WIDER 0.2F
#define TRUST_EDGE 0.2F
#define TRUST_AMPLITUDE 0.3F
/* Share of the amplitude that fine stripes must have; light by way of a wall beside an inner corner has less. */
#define DIRECT 0.75F
#define MISFIT 25.0 /* mean squared deviation from the profiles, in variances, at which they are no explanation */
#define VAGUE 1.5   /* panel pixels of deviation at which a coordinate is of no use */

typedef struct decoder {
  const clt_pairs *pairs;
  clt_pixel_map *map;
  uint8_t *detail;
  float *variance; /* of x and y, [axis * pixels + i] */
  clt_blurs blurs;
  clt_pair_noise noise;
} decoder;

/* One axis of one pixel on its way through the steps. */
typedef struct reading {
  float difference[CLT_GRAY_BITS_MAX];
  int bits;
  float amplitude, noise;
} reading;

/* A coordinate, or what stands against it. */
typedef struct finding {
  clt_pixel_fate fate;
  int bit; /* where ambiguous */
  float x, variance;
} finding;

static reading read_pixel(const decoder *d, size_t pixel, int axis) {
  const clt_pairs *pairs = d->pairs;
  reading r = {.bits = pairs->gray.bits[axis]};
  int first = r.bits > 4 ? 2 : 0; /* the finest bits fade and tell nothing of the whole light */
  for (int b = 0; b < r.bits; b++) {
    size_t pair = (size_t)clt_gray_pair(&pairs->gray, axis, b);
    r.difference[b] = pairs->difference[pair * pairs->pixels + pixel];
    if (b >= first) {
      r.amplitude = fmaxf(r.amplitude, fabsf(r.difference[b]));
    }
  }
  float light = fmaxf(pairs->sum[pixel] / (float)pairs->pairs, 0);
  r.noise = sqrtf((float)(d->noise.constant + d->noise.slope * light));
  return r;
}

static bool is_lit(const reading *r) {
  return r->amplitude >= LIT * r->noise && r->amplitude >= LEAST_LIGHT * CLT_PAIRS_FULL;
}

/* The finest bit whose stripes stand out of the noise. */
static int finest_bit(const reading *r, const clt_blur *blur) {
  int bit = 0;
  while (bit < r->bits - 1 && bit <= COARSEST &&
         !(blur->peak[bit] * r->amplitude >= SURE * r->noise && blur->peak[bit] > 0.15F)) {
    bit++;
  }
  return bit;
}

/* Number of the cell of 2^finest pixels by the signs of the bits from finest on. */
static int decode_cell(const reading *r, int finest) {
  int cell = 0;
  bool set = false;
  for (int b = r->bits - 1; b >= finest; b--) {
    set ^= r->difference[b] > 0;
    cell = 2 * cell + set;
  }
  return cell;
}

/* Zero bits at the right end of n > 0. */
static int zeros_of(int n) {
  return __builtin_ctz((unsigned)n);
}

/* Number of the edge, among those of the cell and its neighbours, of a bit beyond finest + 1; the bit is finest + its
 * zeros. Of four edges one is a multiple of 4. */
static int rare_edge(int cell) {
  int edge = cell - 1;
  while (edge % 4 != 0) {
    edge++;
  }
  return edge;
}

/* Step 3 of the bits that have no edge at the cell. */
static clt_pixel_fate check_bits(const reading *r, const clt_blur *blur, int finest, int cell, int *bit) {
  int even = cell % 2 == 0 ? cell : cell + 1, at_edge = even > 0 ? finest + zeros_of(even) : -1;
  clt_pixel_fate fate = CLT_PIXEL_DECODED;
  for (int b = finest + 1; b < r->bits; b++) {
    float height = fabsf(r->difference[b]), full = r->amplitude * (b < CLT_BLUR_BITS ? blur->peak[b] : 1);
    if (b == at_edge) {
      continue;
    }
    if (height < SURE * r->noise) {
      *bit = b;
      return CLT_PIXEL_AMBIGUOUS;
    }
    if (height < WHOLE * full) {
      fate = CLT_PIXEL_DOUBLE;
    }
  }
  return fate;
}

/* Products of a pixel's differences with the profiles of each hypothesis, h standing at (from + h + 1/2) / blur->steps:
 * sums of p d^2, p d E and p E^2 over the bits, p the precision of d. */
typedef struct trial {
  int from, count;
  float squares, product[HYPOTHESES_MAX], profile[HYPOTHESES_MAX];
} trial;

static float precision_of(const reading *r, float trust) {
  return 1 / (r->noise * r->noise + trust * trust * r->amplitude * r->amplitude);
}

static void add_value(trial *t, int h, float precision, float difference, float profile) {
  t->product[h] += precision * difference * profile;
  t->profile[h] += precision * profile * profile;
}

static void add_bit(const reading *r, const clt_blur *blur, int bit, float trust, trial *t) {
  float precision = precision_of(r, trust);
  int mask = (blur->steps << (bit + 2)) - 1;
  t->squares += precision * r->difference[bit] * r->difference[bit];
  for (int h = 0; h < t->count; h++) {
    add_value(t, h, precision, r->difference[bit], blur->profile[bit][(t->from + h) & mask]);
  }
}

static void add_edge(const reading *r, const clt_blur *blur, int bit, int edge, float trust, trial *t) {
  float precision = precision_of(r, trust), sign = clt_gray_lit(edge, bit) ? 1.0F : -1.0F;
  t->squares += precision * r->difference[bit] * r->difference[bit];
  for (int h = 0; h < t->count; h++) {
    float x = ((float)(t->from + h) + 0.5F) / (float)blur->steps;
    add_value(t, h, precision, r->difference[bit], sign * clt_blur_edge(blur, x, (float)edge));
  }
}

/* Squared deviations of each hypothesis, in variances, at the amplitude a that suits it best, which is known to
 * TRUST_AMPLITUDE beforehand: the least of sum p (d - a E)^2 + q (a - a0)^2. Returns a of the cheapest. */
static float weigh(const reading *r, const trial *t, float *cost) {
  float q = 1 / (TRUST_AMPLITUDE * TRUST_AMPLITUDE * r->amplitude * r->amplitude), a0 = r->amplitude;
  float least = INFINITY, amplitude = a0;
  for (int h = 0; h < t->count; h++) {
    float product = t->product[h] + q * a0, fitted = product / (t->profile[h] + q);
    cost[h] = t->squares + q * a0 * a0 - product * fitted;
    amplitude = cost[h] < least ? fitted : amplitude;
    least = fminf(least, cost[h]);
  }
  return amplitude;
}

/* Mean and variance of the coordinate under weights exp(-cost / 2); returns the least cost. */
static float mean_hypothesis(const float *cost, int from, int count, int steps, finding *out) {
  float least = INFINITY;
  for (int h = 0; h < count; h++) {
    least = fminf(least, cost[h]);
  }
  float s0 = 0, s1 = 0, s2 = 0;
  for (int h = 0; h < count; h++) {
    float over = cost[h] - least;
    if (over < 24) {
      float w = expf(-0.5F * over), at = (float)h + 0.5F;
      s0 += w;
      s1 += w * at;
      s2 += w * at * at;
    }
  }
  float mean = s1 / s0;
  out->x = ((float)from + mean) / (float)steps;
  out->variance = (fmaxf(s2 / s0 - mean * mean, 0) + 1 / 12.0F) / (float)(steps * steps);
  return least;
}

/* Step 4. */
static void locate(const reading *r, const clt_blur *blur, int finest, int cell, int panel, finding *out) {
  int size = blur->steps << finest, border = blur->steps / 2, terms = 0;
  int from = (int)fmax((cell - 1) * size, -border), to = (int)fmin((cell + 2) * size, panel * blur->steps + border);
  int count = to - from;
  if (count < 1) {
    out->fate = CLT_PIXEL_OUTSIDE;
    return;
  }
  trial t; /* too large to be cleared as a whole at every pixel */
  t.from = from, t.count = count, t.squares = 0;
  memset(t.product, 0, (size_t)count * sizeof *t.product);
  memset(t.profile, 0, (size_t)count * sizeof *t.profile);
  float cost[HYPOTHESES_MAX];
  for (int b = 0; b <= finest + 1 && b < CLT_BLUR_BITS && b < r->bits; b++, terms++) {
    add_bit(r, blur, b, b <= finest ? TRUST_FINE : TRUST_WIDER, &t);
  }
  int edge = rare_edge(cell), bit = edge > 0 ? finest + zeros_of(edge) : r->bits;
  if (bit < r->bits) {
    add_edge(r, blur, bit, edge << finest, TRUST_EDGE, &t);
    terms++;
  }
  float amplitude = weigh(r, &t, cost);
  float least = mean_hypothesis(cost, from, count, blur->steps, out);
  if (least > (float)MISFIT * (float)terms || amplitude < DIRECT * r->amplitude) {
    out->fate = CLT_PIXEL_DOUBLE;
  } else if (out->variance > VAGUE * VAGUE) {
    out->fate = CLT_PIXEL_AMBIGUOUS;
    out->bit = finest;
  }
}

static finding decode_axis(const decoder *d, const reading *r, const clt_blur *blur, int axis) {
  finding out = {.fate = CLT_PIXEL_DECODED};
  int finest = finest_bit(r, blur), size = axis == 0 ? d->map->panel_width : d->map->panel_height;
  if (finest > COARSEST || finest >= r->bits) {
    return (finding){.fate = CLT_PIXEL_AMBIGUOUS, .bit = COARSEST};
  }
  int cell = decode_cell(r, finest);
  out.fate = check_bits(r, blur, finest, cell, &out.bit);
  if (out.fate == CLT_PIXEL_DECODED) {
    locate(r, blur, finest, cell, size, &out);
  }
  if (out.fate == CLT_PIXEL_DECODED && !(out.x > -1 && out.x < (float)size + 1)) {
    out.fate = CLT_PIXEL_OUTSIDE;
  }
  return out;
}

static void decode_pixel(const decoder *d, size_t pixel, const clt_blur *const blur[2], const double gain[2]) {
  clt_pixel_map *map = d->map;
  finding found[2];
  for (int axis = 0; axis < 2; axis++) {
    reading r = read_pixel(d, pixel, axis);
    if (!is_lit(&r)) {
      return; /* stays unlit */
    }
    r.amplitude *= (float)gain[axis];
    found[axis] = decode_axis(d, &r, blur[axis], axis);
  }
  for (int axis = 0; axis < 2; axis++) {
    if (found[axis].fate != CLT_PIXEL_DECODED) {
      clt_pixel_map_mask(map, pixel, found[axis].fate);
      d->detail[pixel] = (uint8_t)(axis * CLT_GRAY_BITS_MAX + found[axis].bit);
      return;
    }
  }
  map->fate[pixel] = CLT_PIXEL_DECODED;
  map->x[pixel] = found[0].x;
  map->y[pixel] = found[1].x;
  d->variance[pixel] = found[0].variance;
  d->variance[d->pairs->pixels + pixel] = found[1].variance;
}

typedef struct rectangle {
  int left, top, right, bottom;
} rectangle;

/* Blur of an axis by the pixels of a rectangle; NULL where too few are lit. */
static const clt_blur *measure_blur(const decoder *d, const rectangle *at, int axis, double *gain) {
  double squares[CLT_BLUR_BITS] = {0}, amplitudes = 0;
  long lit = 0;
  for (int y = at->top; y < at->bottom; y++) {
    for (int x = at->left; x < at->right; x++) {
      reading r = read_pixel(d, (size_t)y * (size_t)d->map->width + (size_t)x, axis);
      if (!is_lit(&r)) {
        continue;
      }
      for (int b = 0; b < CLT_BLUR_BITS && b < r.bits; b++) {
        squares[b] += r.difference[b] * r.difference[b] - r.noise * r.noise;
      }
      amplitudes += r.amplitude * r.amplitude;
      lit++;
    }
  }
  int bits = d->pairs->gray.bits[axis] < CLT_BLUR_BITS ? d->pairs->gray.bits[axis] : CLT_BLUR_BITS;
  for (int b = 0; b < bits; b++) {
    squares[b] /= fmax(amplitudes, 1);
  }
  return lit >= FEW_LIT ? clt_blurs_fit(&d->blurs, squares, bits, gain) : NULL;
}

static void decode_tile(const decoder *d, const rectangle *at, const clt_blur *blur[2]) {
  double gain[2];
  for (int axis = 0; axis < 2; axis++) {
    blur[axis] = measure_blur(d, at, axis, &gain[axis]);
  }
  if (blur[0] == NULL || blur[1] == NULL) {
    return;
  }
  for (int y = at->top; y < at->bottom; y++) {
    for (int x = at->left; x < at->right; x++) {
      size_t pixel = (size_t)y * (size_t)d->map->width + (size_t)x;
      if (d->pairs->saturated[pixel]) {
        d->map->fate[pixel] = CLT_PIXEL_SATURATED;
      } else {
        decode_pixel(d, pixel, blur, gain);
      }
    }
  }
}

/* Decodes all tiles and takes the median blur of each axis. */
static clt_status decode_tiles(const decoder *d, clt_decode_report *report, clt_error *error) {
  int width = d->map->width, height = d->map->height;
  int across = (width + TILE - 1) / TILE, tiles = across * ((height + TILE - 1) / TILE), used = 0;
  float *blurs = clt_alloc(2 * (size_t)tiles, sizeof *blurs);
  if (blurs == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for %d tiles", tiles);
  }
#pragma omp parallel for schedule(dynamic)
  for (int t = 0; t < tiles; t++) {
    int left = t % across * TILE, top = t / across * TILE;
    rectangle at = {left, top, left + TILE < width ? left + TILE : width, top + TILE < height ? top + TILE : height};
    const clt_blur *blur[2];
    decode_tile(d, &at, blur);
    if (blur[0] != NULL && blur[1] != NULL) {
      int slot;
#pragma omp atomic capture
      slot = used++;
      blurs[slot] = (float)blur[0]->width;
      blurs[tiles + slot] = (float)blur[1]->width;
    }
  }
  for (int axis = 0; axis < 2 && used > 0; axis++) {
    clt_sort_floats(blurs + axis * tiles, (size_t)used);
    report->blur[axis] = (double)blurs[axis * tiles + used / 2];
  }
  free(blurs);
  return CLT_OK;
}

static void count_fates(const decoder *d, clt_decode_report *report) {
  double noise = 0;
  for (size_t i = 0; i < d->pairs->pixels; i++) {
    report->count[d->map->fate[i]]++;
    if (d->map->fate[i] == CLT_PIXEL_AMBIGUOUS) {
      report->ambiguous[d->detail[i] / CLT_GRAY_BITS_MAX][d->detail[i] % CLT_GRAY_BITS_MAX]++;
    }
    if (d->map->fate[i] == CLT_PIXEL_DECODED) {
      noise += d->noise.constant + d->noise.slope * fmax((double)d->pairs->sum[i] / d->pairs->pairs, 0);
    }
  }
  long decoded = report->count[CLT_PIXEL_DECODED];
  report->noise = decoded > 0 ? sqrt(noise / (double)decoded) / CLT_PAIRS_FULL : 0;
}

clt_status clt_decode(const clt_pairs *pairs, clt_pixel_map *map, uint8_t *detail, clt_decode_report *report,
                      clt_error *error) {
  decoder d = {.pairs = pairs, .map = map, .detail = detail};
  *report = (clt_decode_report){0};
  clt_status status = clt_pixel_map_init(map, pairs->sensor.width, pairs->sensor.height, pairs->gray.panel_width,
                                         pairs->gray.panel_height, error);
  if (status == CLT_OK) {
    status = clt_blurs_init(&d.blurs, error);
  }
  if (status == CLT_OK) {
    status = clt_pairs_noise(pairs, &d.noise, error);
  }
  d.variance = clt_alloc(2 * pairs->pixels, sizeof *d.variance);
  if (status == CLT_OK && d.variance == NULL) {
    status = clt_fail(error, CLT_FAILED, "out of memory for the variances of %zu pixels", pairs->pixels);
  }
  if (status == CLT_OK) {
    status = decode_tiles(&d, report, error);
  }
  if (status == CLT_OK) {
    status = clt_pixel_map_refine(map, d.variance, &report->pitch, error);
  }
  if (status == CLT_OK) {
    count_fates(&d, report);
  } else {
    clt_pixel_map_finish(map);
  }
  free(d.variance);
  clt_blurs_finish(&d.blurs);
  return status;
}
