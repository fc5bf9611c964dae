#include "rig/photometry/sensor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/order.h"

/* Share of samples at 0 from which the noise counts as cut off, and at which a field is left out. */
#define CLIPPED_SHARE 1e-3

static const double dark[CLT_FIELD_CHANNELS] = {0, 0, 0};

static void count_samples(void *context, const clt_field_bench *bench, const clt_frame *frame) {
  double *histogram = context;
  for (size_t p = 0; p < bench->pixels; p++) {
    for (int c = 0; c < frame->channels && bench->group[p] > 0; c++) {
      histogram[frame->samples[p * (size_t)frame->channels + (size_t)c]] += 1;
    }
  }
}

/* The code below which a share of the samples lies, samples being spread evenly over their code. */
static double quantile(const double *histogram, int codes, double total, double share) {
  double below = 0;
  int code = 0;
  while (code < codes - 1 && below + histogram[code] < share * total) {
    below += histogram[code++];
  }
  return code - 0.5 + (share * total - below) / fmax(histogram[code], 1);
}

static double centre(const double *histogram, int codes) {
  double total = 0, sum = 0, kept = 0;
  for (int code = 0; code < codes; code++) {
    total += histogram[code];
  }
  /* Noise is symmetric about no light, in samples too. Where a steep response leaves a hole there, the median is
   * uncertain, and the middle between two quantiles is not. */
  double share = fmin(fmax(histogram[0] / total + 0.02, 0.16), 0.45);
  double low = quantile(histogram, codes, total, share), high = quantile(histogram, codes, total, 1 - share);
  double middle = 0.5 * (low + high), reach = 2 + 3 * (high - low);
  if (histogram[0] > CLIPPED_SHARE * total) {
    return middle;
  }
  for (int code = 0; code < codes; code++) {
    if (fabs(code - middle) <= reach) {
      sum += code * histogram[code];
      kept += histogram[code];
    }
  }
  return sum / kept;
}

clt_status clt_sensor_black_level(clt_field_bench *bench, int frames, double *black_level, clt_error *error) {
  const clt_camera_info *sensor = &bench->shots->sensor;
  int codes = 1 << sensor->bits;
  double *histogram = clt_alloc((size_t)codes, sizeof *histogram), at[2] = {0, 0};
  int64_t ready_ns = 0;
  if (histogram == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the black level");
  }
  clt_status status = clt_field_show(bench, dark, &ready_ns, error);
  for (int k = 0; k < 2 && status == CLT_OK; k++) {
    clt_field field;
    double seconds = fmin((k + 1) * sensor->exposure_min_s, sensor->exposure_max_s);
    memset(histogram, 0, (size_t)codes * sizeof *histogram);
    status = clt_field_take(bench, ready_ns, seconds, frames, count_samples, histogram, &field, error);
    at[k] = centre(histogram, codes);
  }
  free(histogram);
  *black_level = fmax(2 * at[0] - at[1], 0);
  return status;
}

enum {
  GROUPS = CLT_FIELD_GROUPS * CLT_FIELD_CHANNELS,
  POINTS_MAX = GROUPS * (CLT_NOISE_LEVELS + CLT_NOISE_DARKS),
  PASSES = 6
};
#define OUTLIER 4.0

/* Variance of a group at its mean light. */
typedef struct point {
  double light, variance, count;
} point;

/* Sums over the samples of a group. */
typedef struct group_sums {
  double light, difference, square, step, count, clipped;
} group_sums;

typedef struct transfer {
  float *before; /* decoded light of the frame before */
  bool there;
  group_sums groups[GROUPS];
  point points[POINTS_MAX];
  int count_of_points;
} transfer;

static void add_differences(void *context, const clt_field_bench *bench, const clt_frame *frame) {
  transfer *self = context;
  int top = (1 << frame->bits) - 1;
  for (size_t n = 0; n < bench->pixels * (size_t)frame->channels; n++) {
    int group = bench->group[n / (size_t)frame->channels], sample = frame->samples[n];
    float light = bench->light[sample];
    if (group > 0 && self->there) {
      group_sums *to = &self->groups[(group - 1) * CLT_FIELD_CHANNELS + (int)(n % (size_t)frame->channels)];
      double off = (double)light - (double)self->before[n];
      double step = (double)bench->light[sample < top ? sample + 1 : top] - (double)light;
      to->light += (double)light;
      to->difference += off;
      to->square += off * off;
      to->step += step * step;
      to->count += 1;
      to->clipped += sample == 0 || sample >= 0.97 * top;
    }
    self->before[n] = light;
  }
  self->there = true;
}

/* One field at one exposure: a point for every group that is not cut off. A shift that all pixels of a group share, by
 * flicker, is no noise. */
static clt_status add_field(transfer *self, clt_field_bench *bench, int64_t ready_ns, double seconds, int frames,
                            clt_error *error) {
  clt_field field;
  memset(self->groups, 0, sizeof self->groups);
  self->there = false;
  clt_status status = clt_field_take(bench, ready_ns, seconds, frames, add_differences, self, &field, error);
  for (int g = 0; g < GROUPS && status == CLT_OK; g++) {
    const group_sums *of = &self->groups[g];
    double count = of->count;
    if (count > 100 && of->clipped <= CLIPPED_SHARE * count && self->count_of_points < POINTS_MAX) {
      double shift = of->difference / count;
      self->points[self->count_of_points++] =
          (point){.light = of->light / count,
                  .variance = 0.5 * (of->square / count - shift * shift) - of->step / count / 12,
                  .count = count};
    }
  }
  return status;
}

/* variance = slope * light + floor, weights 1 / variance^2 by the line of the pass before. */
static void fit_line(const point *points, int count, const bool *kept, double *slope, double *offset) {
  for (int pass = 0; pass < PASSES; pass++) {
    double w0 = 0, w1 = 0, w2 = 0, y0 = 0, y1 = 0;
    for (int n = 0; n < count; n++) {
      double line = *slope * points[n].light + *offset, w = kept[n] ? points[n].count / (line * line) : 0;
      w0 += w;
      w1 += w * points[n].light;
      w2 += w * points[n].light * points[n].light;
      y0 += w * points[n].variance;
      y1 += w * points[n].light * points[n].variance;
    }
    double determinant = w0 * w2 - w1 * w1;
    *slope = fmax((w0 * y1 - w1 * y0) / determinant, 1e-12);
    *offset = fmax((w2 * y0 - w1 * y1) / determinant, 1e-14);
  }
}

/* The line through the points, then again without those that are off it by more than 4 of their median departures. */
static void fit(const transfer *self, clt_sensor_noise *out, double *slope, double *offset) {
  bool kept[POINTS_MAX];
  double off[POINTS_MAX], sorted[POINTS_MAX], squares = 0;
  int count = self->count_of_points;
  memset(kept, 1, sizeof kept);
  *slope = 1e-4;
  *offset = 1e-6;
  fit_line(self->points, count, kept, slope, offset);
  for (int n = 0; n < count; n++) {
    double line = *slope * self->points[n].light + *offset;
    sorted[n] = off[n] = fabs(self->points[n].variance / line - 1);
  }
  clt_sort_doubles(sorted, (size_t)count);
  for (int n = 0; n < count; n++) {
    kept[n] = off[n] <= OUTLIER * 1.4826 * sorted[count / 2];
    out->points += kept[n];
  }
  fit_line(self->points, count, kept, slope, offset);
  for (int n = 0; n < count; n++) {
    double line = *slope * self->points[n].light + *offset, z = (self->points[n].variance / line - 1);
    squares += kept[n] ? z * z * self->points[n].count / 3 : 0; /* differences of successive frames overlap: 3 for 2 */
  }
  out->misfit = sqrt(squares / fmax(out->points - 2, 1));
}

static clt_status see_fields(transfer *self, clt_field_bench *bench, double seconds, int frames, clt_error *error) {
  int64_t ready_ns = 0;
  clt_status status = clt_field_show(bench, dark, &ready_ns, error);
  for (int k = 0; k < CLT_NOISE_DARKS && status == CLT_OK; k++) {
    double shorter = seconds / pow(1.5, k);
    if (shorter >= bench->shots->sensor.exposure_min_s) {
      status = add_field(self, bench, ready_ns, shorter, frames, error);
    }
  }
  for (int k = 1; k <= CLT_NOISE_LEVELS && status == CLT_OK; k++) {
    double level = (double)k / CLT_NOISE_LEVELS, code[CLT_FIELD_CHANNELS] = {level, level, level};
    status = clt_field_show(bench, code, &ready_ns, error);
    status = status == CLT_OK ? add_field(self, bench, ready_ns, seconds, frames, error) : status;
  }
  return status;
}

clt_status clt_sensor_noise_measure(clt_field_bench *bench, double seconds, int frames, clt_sensor_noise *out,
                                    clt_error *error) {
  transfer *self = clt_alloc(1, sizeof *self);
  double slope = 0, offset = 0;
  *out = (clt_sensor_noise){0};
  clt_status status = CLT_OK;
  if (self != NULL) {
    self->before = clt_alloc(bench->pixels * (size_t)bench->channels, sizeof *self->before);
  }
  if (self == NULL || self->before == NULL) {
    status = clt_fail(error, CLT_FAILED, "out of memory for the noise of %zu pixels", bench->pixels);
  }
  if (status == CLT_OK) {
    status = see_fields(self, bench, seconds, frames, error);
  }
  if (status == CLT_OK && self->count_of_points >= 3) {
    fit(self, out, &slope, &offset);
    out->full_well = 1 / slope;
    out->read_noise = sqrt(offset) / slope;
  }
  if (status == CLT_OK && !(slope > 1e-9)) {
    status =
        clt_fail(error, CLT_FAILED,
                 "the noise does not grow with light (%d fields); is the camera's noise reduction on? switch it off",
                 self->count_of_points);
  }
  if (self != NULL) {
    free(self->before);
  }
  free(self);
  return status;
}
