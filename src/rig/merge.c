#include "rig/merge.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"

/* A sample this near to full scale may be clipped. Leaving single samples out by their own value would favour the dark
 * ones of a bright cell; so a whole exposure goes as soon as the mean of the cell's samples, whose noise is small,
 * comes near, and the limit of a single sample then only meets hot pixels. */
#define SAMPLE_LIMIT 0.98
#define MEAN_LIMIT 0.95
#define DEVIATIONS 6            /* that two exposures must lie apart for one to be dead */
enum { WORTH_SHARING = 32768 }; /* values from which threads pay */

/* h at a code value that need not be whole. */
static double light_at(const clt_merge *merge, double code) {
  int top = (1 << merge->camera.bits) - 1;
  double at = fmin(fmax(code, 0), top);
  int low = at < top ? (int)at : top - 1;
  return (double)merge->light[low] + (at - low) * ((double)merge->light[low + 1] - (double)merge->light[low]);
}

static void fill_tables(clt_merge *merge, const clt_curve *response) {
  int top = (1 << merge->camera.bits) - 1;
  double black = merge->camera.black_level, range = top - black, half = 0.5 * fmax(merge->camera.step, 1);
  for (int code = 0; code <= top; code++) {
    double v = (code - black) / range;
    /* The odd continuation below black keeps noise around zero unbiased. */
    merge->light[code] = (float)(v < 0 ? -clt_curve_decode(response, -v) : clt_curve_decode(response, v));
  }
  for (int code = 0; code <= top; code++) {
    double up = light_at(merge, code + half) - light_at(merge, code);
    double down = light_at(merge, code) - light_at(merge, code - half);
    merge->step[code] = (float)(2 * fmax(up, down)); /* at the ends of the scale one of them is cut short */
  }
  merge->saturated = (float)(black + SAMPLE_LIMIT * range);
  merge->full = (float)(black + MEAN_LIMIT * range);
}

clt_status clt_merge_init(clt_merge *merge, const clt_camera_info *camera, const clt_curve *response,
                          const clt_footprints *footprints, int exposures, clt_error *error) {
  size_t codes = (size_t)1 << camera->bits;
  *merge = (clt_merge){
      .camera = *camera,
      .footprints = footprints,
      .exposures = exposures,
      .light = clt_alloc(codes, sizeof *merge->light),
      .step = clt_alloc(codes, sizeof *merge->step),
      .sums = clt_alloc((size_t)exposures * (size_t)camera->channels * footprints->cells, sizeof *merge->sums)};
  if (merge->light == NULL || merge->step == NULL || merge->sums == NULL) {
    clt_merge_finish(merge);
    return clt_fail(error, CLT_FAILED, "out of memory for merging %d exposures of %zu cells", exposures,
                    footprints->cells);
  }
  fill_tables(merge, response);
  return CLT_OK;
}

void clt_merge_finish(clt_merge *merge) {
  free(merge->light);
  free(merge->step);
  free(merge->sums);
  *merge = (clt_merge){0};
}

/* Means of a footprint's samples; weight is NULL where all count alike. n samples of weights w tell as much as
 * (sum w)^2 / sum w^2 alike ones. Pixels of a weighted footprint see unlike light, so that the mean of those which
 * do not saturate would be too dark: whole leaves such an exposure out. */
static clt_merge_sum sum_footprint(const clt_merge *merge, const uint16_t *samples, const int32_t *pixel,
                                   const float *weight, int64_t count, bool whole) {
  int channels = merge->camera.channels;
  float light = 0, unsaturated = 0, squares = 0, raw = 0, all = 0;
  for (int64_t p = 0; p < count; p++) {
    uint16_t code = samples[(size_t)pixel[p] * (size_t)channels];
    float w = weight != NULL ? weight[p] : 1;
    raw += w * code;
    all += w;
    if (code < merge->saturated) {
      light += w * merge->light[code];
      unsaturated += w;
      squares += w * w;
    }
  }
  raw /= all;
  if (unsaturated == 0 || raw >= merge->full || (whole && unsaturated < all)) {
    return (clt_merge_sum){.raw = raw};
  }
  return (clt_merge_sum){.light = light / unsaturated, .count = unsaturated * unsaturated / squares, .raw = raw};
}

void clt_merge_add(clt_merge *merge, int exposure, const clt_frame *frame) {
  const clt_footprints *footprints = merge->footprints;
  int channels = merge->camera.channels;
  clt_merge_sum *sums = merge->sums + (size_t)exposure * (size_t)channels * footprints->cells;
  merge->seconds[exposure] = frame->exposure_s;
  bool whole = footprints->weight != NULL && exposure > 0; /* the shortest bears with a defective pixel */
#pragma omp parallel for schedule(static) if (footprints->cells >= WORTH_SHARING)
  for (size_t i = 0; i < footprints->cells; i++) {
    int64_t first = footprints->start[i], count = footprints->start[i + 1] - first;
    const float *weight = footprints->weight != NULL ? footprints->weight + first : NULL;
    for (int c = 0; c < channels; c++) {
      sums[(size_t)c * footprints->cells + i] =
          count > 0 ? sum_footprint(merge, frame->samples + c, footprints->pixel + first, weight, count, whole)
                    : (clt_merge_sum){0};
    }
  }
}

/* Noise of variance r2 steps squared leaves sum over k of (-1)^k sin(2 pi k x) exp(-2 pi^2 k^2 r2) / (pi k) steps of
 * the rounding of x; its mean square over all x is S(4 pi^2 r2) / (2 pi^2), S(a) = sum exp(-a k^2) / k^2, which for
 * small a is pi^2 / 6 - sqrt(pi a) + a / 2 (by S' and the theta function). 1/12 without noise. */
static double shared_rounding(double r2) {
  double a = 4 * M_PI * M_PI * r2;
  if (a > 20) {
    return 0;
  }
  double sum = a < 1.5 ? M_PI * M_PI / 6 - sqrt(M_PI * a) + a / 2 : exp(-a) + exp(-4 * a) / 4;
  return sum / (2 * M_PI * M_PI);
}

/* Variances of h: of one sample by itself, and of what all samples of the cell share. */
static double sample_variance(const clt_merge *merge, const clt_merge_sum *sum, double light, double *shared) {
  const clt_camera_info *camera = &merge->camera;
  double read = camera->read_noise / camera->full_well, step = (double)merge->step[(int)(sum->raw + 0.5f)];
  double noise = fmax(light, 0) / camera->full_well + read * read, squared = step * step;
  *shared = squared > 0 ? squared * shared_rounding(noise / squared) : 0;
  return noise + squared / 12 - *shared;
}

double clt_merge_noise(const clt_merge *merge, const clt_merge_sum *sum, double t, double e) {
  double shared = 0, own = sample_variance(merge, sum, e * t, &shared);
  return own / (t * t * (double)sum->count);
}

double clt_merge_variance(const clt_merge *merge, const clt_merge_sum *sum, double t, double e) {
  double shared = 0, own = sample_variance(merge, sum, e * t, &shared);
  return (own / (double)sum->count + shared) / (t * t);
}

double clt_merge_rounding(const clt_merge *merge, double t) {
  const clt_merge_sum dark = {.raw = (float)merge->camera.black_level};
  double shared = 0;
  sample_variance(merge, &dark, 0, &shared);
  return sqrt(shared) / (t * merge->camera.responsivity);
}

/* What rounding to the camera's steps shifts the mean of samples at a code value, noise in units of h. */
static double rounding(const clt_merge *merge, double code, double noise) {
  double step = (double)merge->step[(int)(code + 0.5)], steps = noise / fmax(step, 1e-12);
  return 0.5 * step * exp(-2 * M_PI * M_PI * steps * steps);
}

/* What noise gains that is cut off at the end of the scale, for any light that may have come out as this mean: the gain
 * is most at the end itself, where it is so many deviations. */
static double cut_off(double above, double noise) {
  const double most = 1 / sqrt(2 * M_PI);
  double z = fmax(above / noise - most, 0);
  return noise * (most * exp(-0.5 * z * z) - 0.5 * z * erfc(z / sqrt(2)));
}

double clt_merge_bias(const clt_merge *merge, const clt_merge_sum *sum, double t, double e) {
  const clt_camera_info *camera = &merge->camera;
  double light = fmax(e, 0) * t, read = camera->read_noise / camera->full_well;
  double noise = sqrt(light / camera->full_well + read * read + 1e-18);
  return (rounding(merge, (double)sum->raw, noise) + rounding(merge, camera->black_level, read) +
          cut_off(light - (double)merge->light[0], noise)) /
         t;
}

/* The rate that two exposures prove at the least; 0 where only one shows light, which may be a frame of another
 * pattern.
 */
static double proven_rate(const clt_merge *merge, const clt_merge_sum *sums, size_t stride) {
  double most = 0, second = 0;
  for (int k = 0; k < merge->exposures; k++) {
    const clt_merge_sum *sum = &sums[(size_t)k * stride];
    double t = merge->seconds[k];
    if (sum->count > 0) {
      double e = sum->light / t, proven = e - DEVIATIONS * sqrt(clt_merge_variance(merge, sum, t, e));
      second = fmax(second, fmin(most, proven));
      most = fmax(most, proven);
    }
  }
  return second;
}

/* An exposure counts where it is neither saturated nor dead: without light where two others prove that there was
 * some (a shutter or a lamp that failed). */
static bool counts(const clt_merge *merge, const clt_merge_sum *sum, double t, double proven) {
  if (sum->count == 0) {
    return false;
  }
  double e = sum->light / t, dark = DEVIATIONS * sqrt(clt_merge_variance(merge, sum, t, 0));
  return e > dark || e >= proven - DEVIATIONS * sqrt(clt_merge_variance(merge, sum, t, proven));
}

/* The rate e of one cell and channel (sums of successive exposures lie stride apart) and its variance. */
static double merge_rate(const clt_merge *merge, const clt_merge_sum *sums, size_t stride, double *variance) {
  double first = 0, longest = 0, bound = 0, proven = proven_rate(merge, sums, stride);
  for (int k = 0; k < merge->exposures; k++) {
    const clt_merge_sum *sum = &sums[(size_t)k * stride];
    double t = merge->seconds[k];
    if (t > longest && counts(merge, sum, t, proven)) {
      longest = t;
      first = sum->light / t;
    }
    bound = fmax(bound, merge->light[(int)(sum->raw + 0.5f)] / t);
  }
  if (longest == 0) {
    *variance = INFINITY;
    return bound;
  }
  double e = first, weights = 0;
  for (int pass = 0; pass < 2; pass++) {
    double weighted = 0;
    weights = 0;
    for (int k = 0; k < merge->exposures; k++) {
      const clt_merge_sum *sum = &sums[(size_t)k * stride];
      if (counts(merge, sum, merge->seconds[k], proven)) {
        double w = 1 / clt_merge_variance(merge, sum, merge->seconds[k], e);
        weighted += w * sum->light / merge->seconds[k];
        weights += w;
      }
    }
    e = weighted / weights;
  }
  *variance = 1 / weights;
  return e;
}

void clt_merge_radiance(const clt_merge *merge, clt_image *radiance, clt_image *deviation) {
  size_t cells = merge->footprints->cells, values = cells * (size_t)merge->camera.channels;
  double responsivity = merge->camera.responsivity;
#pragma omp parallel for schedule(static) if (values >= WORTH_SHARING)
  for (size_t i = 0; i < values; i++) {
    bool seen = merge->footprints->start[i % cells + 1] > merge->footprints->start[i % cells];
    double variance = INFINITY;
    double e = seen ? merge_rate(merge, merge->sums + i, values, &variance) : 0;
    radiance->data[i] = (float)(e / responsivity);
    deviation->data[i] = (float)(sqrt(variance) / responsivity);
  }
}
