#include "rig/geometry/pairs.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/order.h"

#define SATURATED 0.99 /* of full scale */

static bool make_probes(clt_pairs *pairs) {
  int width = pairs->sensor.width, height = pairs->sensor.height;
  pairs->stride = 1;
  for (;; pairs->stride++) {
    pairs->across = (width + pairs->stride - 1) / pairs->stride;
    pairs->probes = pairs->across * ((height + pairs->stride - 1) / pairs->stride);
    if (pairs->probes <= CLT_PROBES_MAX) {
      break;
    }
  }
  size_t values = (size_t)pairs->probes * (size_t)pairs->sensor.channels * (size_t)(2 * pairs->pairs);
  pairs->probe = clt_alloc(values, sizeof *pairs->probe);
  return pairs->probe != NULL;
}

static void fill_light(clt_pairs *pairs, const clt_curve *response) {
  int full = (1 << pairs->sensor.bits) - 1;
  double black = pairs->sensor.black_level;
  for (int code = 0; code <= full; code++) {
    double v = (code - black) / (full - black);
    /* The odd continuation below black keeps noise around zero unbiased. */
    pairs->light[code] =
        (float)(CLT_PAIRS_FULL * (v < 0 ? -clt_curve_decode(response, -v) : clt_curve_decode(response, v)));
  }
}

clt_status clt_pairs_init(clt_pairs *pairs, const clt_gray *gray, const clt_camera_info *sensor,
                          const clt_curve *response, clt_error *error) {
  *pairs = (clt_pairs){.gray = *gray,
                       .sensor = *sensor,
                       .pairs = clt_gray_pictures(gray) / 2,
                       .pixels = (size_t)sensor->width * (size_t)sensor->height};
  pairs->light = clt_alloc((size_t)1 << sensor->bits, sizeof *pairs->light);
  pairs->difference = clt_alloc((size_t)pairs->pairs * pairs->pixels, sizeof *pairs->difference);
  pairs->picture = clt_alloc(pairs->pixels, sizeof *pairs->picture);
  pairs->sum = clt_alloc(pairs->pixels, sizeof *pairs->sum);
  pairs->saturated = clt_alloc(pairs->pixels, sizeof *pairs->saturated);
  if (!make_probes(pairs) || pairs->light == NULL || pairs->difference == NULL || pairs->picture == NULL ||
      pairs->sum == NULL || pairs->saturated == NULL) {
    clt_pairs_finish(pairs);
    return clt_fail(error, CLT_FAILED, "out of memory for %d pairs of frames of %d x %d pixels",
                    clt_gray_pictures(gray) / 2, sensor->width, sensor->height);
  }
  static const float luminance[3] = {0.2126F, 0.7152F, 0.0722F}, alone[3] = {1, 0, 0};
  memcpy(pairs->share, sensor->channels == 3 ? luminance : alone, sizeof pairs->share);
  fill_light(pairs, response);
  return CLT_OK;
}

void clt_pairs_finish(clt_pairs *pairs) {
  free(pairs->light);
  free(pairs->difference);
  free(pairs->picture);
  free(pairs->sum);
  free(pairs->saturated);
  free(pairs->probe);
  *pairs = (clt_pairs){0};
}

static void keep_probes(clt_pairs *pairs, int index, const clt_frame *frame) {
  int channels = frame->channels;
  uint16_t *to = pairs->probe + (size_t)index * (size_t)pairs->probes * (size_t)channels;
  for (int p = 0; p < pairs->probes; p++) {
    int x = p % pairs->across * pairs->stride, y = p / pairs->across * pairs->stride;
    const uint16_t *from = frame->samples + ((size_t)y * (size_t)frame->width + (size_t)x) * (size_t)channels;
    for (int c = 0; c < channels; c++) {
      *to++ = from[c];
    }
  }
}

void clt_pairs_add(clt_pairs *pairs, int index, const clt_frame *frame) {
  int channels = frame->channels;
  uint16_t limit = (uint16_t)ceil(SATURATED * ((1 << frame->bits) - 1));
  int16_t *difference = pairs->difference + (size_t)(index / 2) * pairs->pixels;
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < pairs->pixels; i++) {
    const uint16_t *sample = frame->samples + i * (size_t)channels;
    float total = 0;
    int top = 0;
    for (int c = 0; c < channels; c++) {
      total += pairs->share[c] * pairs->light[sample[c]];
      top = sample[c] > top ? sample[c] : top;
    }
    int light = (int)lrintf(fmaxf(total, -CLT_PAIRS_FULL));
    pairs->sum[i] += (float)light;
    pairs->saturated[i] |= top >= limit;
    if (index % 2 == 0) {
      pairs->picture[i] = (uint16_t)(light + CLT_PAIRS_FULL); /* may be below black */
    } else {
      difference[i] = (int16_t)(pairs->picture[i] - CLT_PAIRS_FULL - light);
    }
  }
  keep_probes(pairs, index, frame);
}

double clt_pairs_probe(const clt_pairs *pairs, int pair, int probe, int channel) {
  int channels = pairs->sensor.channels;
  double sum = 0;
  for (int frame = 2 * pair; frame < 2 * pair + 2; frame++) {
    const uint16_t *sample = pairs->probe + ((size_t)frame * (size_t)pairs->probes + (size_t)probe) * (size_t)channels;
    for (int c = 0; c < channels; c++) {
      float share = channel < 0 ? pairs->share[c] : (float)(c == channel);
      sum += share * pairs->light[sample[c]];
    }
  }
  return sum;
}

enum { LEVELS = 12, FEWEST = 100 };

/* Level of brightness, two to an octave, below full scale. */
static int level_of(double sum) {
  double octaves = log2(fmax(2 * CLT_PAIRS_FULL / fmax(sum, 1), 1));
  int level = (int)(2 * octaves);
  return level < LEVELS ? level : LEVELS - 1;
}

static double median_of(double *values, size_t count) {
  clt_sort_doubles(values, count);
  return values[count / 2];
}

/* Mean sum and standard deviation of a difference at each level of brightness; count 0 where probes are few. */
typedef struct level {
  double sum, variance;
  size_t count;
} level;

/* The noise of one level. changes has room for two values a probe; the second half is work space. */
static level measure_level(const clt_pairs *pairs, int pair, int wanted, double *changes) {
  level out = {0};
  for (int p = 0; p < pairs->probes; p++) {
    double before = clt_pairs_probe(pairs, pair, p, -1), after = clt_pairs_probe(pairs, pair + 1, p, -1);
    if (level_of(0.5 * (before + after)) == wanted) {
      changes[out.count++] = after - before;
      out.sum += 0.5 * (before + after);
    }
  }
  if (out.count < FEWEST) {
    return (level){0};
  }
  out.sum /= (double)out.count;
  double *spread = changes + pairs->probes, middle = median_of(changes, out.count);
  for (size_t k = 0; k < out.count; k++) {
    spread[k] = fabs(changes[k] - middle);
  }
  double deviation = 1.4826 * median_of(spread, out.count); /* of a normal distribution, from its MAD */
  out.variance = 0.5 * deviation * deviation;               /* a change is made of two sums */
  return out;
}

clt_status clt_pairs_noise(const clt_pairs *pairs, clt_pair_noise *noise, clt_error *error) {
  double *changes = clt_alloc(2 * (size_t)pairs->probes, sizeof *changes);
  if (changes == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the noise of %d probes", pairs->probes);
  }
  /* Rounding to code values leaves a twelfth of a step, squared, in each of 2 frames. */
  double step = (double)CLT_PAIRS_FULL / ((1 << pairs->sensor.bits) - 1);
  double floor = 2 * step * step / 12, s0 = 0, s1 = 0, s2 = 0, v0 = 0, v1 = 0;
  int pair = pairs->gray.bits[0] > 4 ? 1 : 0; /* wide stripes, and not the frames while the camera settles */
  for (int k = 0; k < LEVELS; k++) {
    level seen = measure_level(pairs, pair, k, changes);
    double w = seen.count > 0 ? 1 / pow(seen.variance + floor, 2) : 0;
    s0 += w;
    s1 += w * seen.sum;
    s2 += w * seen.sum * seen.sum;
    v0 += w * seen.variance;
    v1 += w * seen.variance * seen.sum;
  }
  free(changes);
  double determinant = s0 * s2 - s1 * s1;
  double slope = determinant > 1e-12 * s0 * s2 ? fmax((s0 * v1 - s1 * v0) / determinant, 0) : 0;
  *noise = (clt_pair_noise){s0 > 0 ? fmax(floor, (v0 - slope * s1) / s0) : floor, slope};
  return CLT_OK;
}
