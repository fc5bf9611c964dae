/* Resampling. Both axes have the same scale, because the input is first cropped to the output's aspect ratio; so an
 * axis is a set of weights for each output sample, and the picture is the product of the two axes' weights. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "counterlight/image.h"

/* out[j] = sum over k < taps of weight[j * taps + k] * in[first[j] + k]; the weights of an output sum to 1. */
typedef struct axis_weights {
  int taps;
  int *first;
  double *weight;
} axis_weights;

/* The scale is side / goal input samples an output sample, of that axis which is used whole. */
typedef struct axis_scale {
  int64_t side, goal;
} axis_scale;

/* Output j of the m of an axis with n inputs covers the input interval edge_j..edge_(j+1), in units of 1 / (2 goal):
 * edge_j = 2 goal ((n - m side / goal) / 2 + j side / goal) = n goal - m side + 2 j side. Whole numbers, so that
 * weights are exact. */
static int64_t edge(axis_scale scale, int n, int m, int j) {
  return n * scale.goal - m * scale.side + 2 * j * scale.side;
}

/* The weight of an input is the fraction of the output's interval that it covers. */
static void set_area(axis_weights *axis, axis_scale scale, int n, int m) {
  const int64_t unit = 2 * scale.goal;
  for (int j = 0; j < m; j++) {
    int64_t begin = edge(scale, n, m, j), end = edge(scale, n, m, j + 1);
    int64_t first = begin / unit < n - axis->taps ? begin / unit : n - axis->taps;
    axis->first[j] = (int)first;
    for (int k = 0; k < axis->taps; k++) {
      int64_t from = (first + k) * unit, to = from + unit;
      int64_t covered = (to < end ? to : end) - (from > begin ? from : begin);
      axis->weight[j * axis->taps + k] = covered > 0 ? (double)covered / (double)(end - begin) : 0;
    }
  }
}

/* Linear between the two inputs whose centres enclose the output's centre; the border is repeated. */
static void set_linear(axis_weights *axis, axis_scale scale, int n, int m) {
  for (int j = 0; j < m; j++) {
    double middle = (double)(edge(scale, n, m, j) + edge(scale, n, m, j + 1)) / (4.0 * (double)scale.goal) - 0.5;
    middle = middle < 0 ? 0 : middle > n - 1 ? n - 1 : middle;
    axis->first[j] = (int)middle < n - axis->taps ? (int)middle : n - axis->taps;
    double fraction = middle - axis->first[j];
    axis->weight[j * axis->taps] = 1 - fraction;
    if (axis->taps == 2) {
      axis->weight[j * axis->taps + 1] = fraction;
    }
  }
}

static void axis_finish(axis_weights *axis) {
  free(axis->first);
  free(axis->weight);
}

static bool axis_init(axis_weights *axis, axis_scale scale, int n, int m) {
  bool shrinks = scale.side >= scale.goal;
  int64_t taps = shrinks ? (scale.side + scale.goal - 1) / scale.goal + 1 : 2;
  axis->taps = taps < n ? (int)taps : n;
  axis->first = clt_alloc((size_t)m, sizeof *axis->first);
  axis->weight = clt_alloc((size_t)m * (size_t)axis->taps, sizeof *axis->weight);
  if (axis->first == NULL || axis->weight == NULL) {
    return false;
  }
  (shrinks ? set_area : set_linear)(axis, scale, n, m);
  return true;
}

/* One input row to one output row of m samples. */
static void resample_row(const axis_weights *axis, const float *in, double *out, int m) {
  for (int j = 0; j < m; j++) {
    const double *weight = axis->weight + (size_t)j * (size_t)axis->taps;
    const float *from = in + axis->first[j];
    double sum = 0;
    for (int k = 0; k < axis->taps; k++) {
      sum += weight[k] * from[k];
    }
    out[j] = sum;
  }
}

/* Output row y as the weighted sum of resampled input rows; sum has a row's room. */
static void mix_rows(const axis_weights *axis, const double *rows, int y, size_t width, double *sum, float *out) {
  memset(sum, 0, width * sizeof *sum);
  for (int k = 0; k < axis->taps; k++) {
    double weight = axis->weight[(size_t)y * (size_t)axis->taps + (size_t)k];
    const double *row = rows + (size_t)(axis->first[y] + k) * width;
    for (size_t x = 0; x < width; x++) {
      sum[x] += weight * row[x];
    }
  }
  for (size_t x = 0; x < width; x++) {
    out[x] = (float)sum[x];
  }
}

/* rows has room for in->height + 1 rows of the output's width. */
static void resample(const clt_image *in, const axis_weights *across, const axis_weights *down, double *rows,
                     clt_image *out) {
  size_t width = (size_t)out->width;
  double *sum = rows + (size_t)in->height * width;
  for (int c = 0; c < in->channels; c++) {
    for (int y = 0; y < in->height; y++) {
      const float *from = in->data + ((size_t)c * (size_t)in->height + (size_t)y) * (size_t)in->width;
      resample_row(across, from, rows + (size_t)y * width, out->width);
    }
    for (int y = 0; y < out->height; y++) {
      float *to = out->data + ((size_t)c * (size_t)out->height + (size_t)y) * width;
      mix_rows(down, rows, y, width, sum, to);
    }
  }
}

clt_status clt_image_resize(const clt_image *in, int height, int width, clt_image *out, clt_error *error) {
  clt_status status = clt_image_init(out, in->channels, height, width, error);
  if (status != CLT_OK) {
    return status;
  }
  if (in->width == width && in->height == height) {
    memcpy(out->data, in->data, clt_image_size(in) * sizeof *in->data);
    return CLT_OK;
  }
  bool whole_height = (int64_t)in->width * height >= (int64_t)in->height * width;
  axis_scale scale = whole_height ? (axis_scale){in->height, height} : (axis_scale){in->width, width};
  axis_weights across = {0}, down = {0};
  double *rows = clt_alloc(((size_t)in->height + 1) * (size_t)width, sizeof *rows);
  if (rows != NULL && axis_init(&across, scale, in->width, width) && axis_init(&down, scale, in->height, height)) {
    resample(in, &across, &down, rows, out);
  } else {
    clt_image_finish(out);
    status = clt_fail(error, CLT_FAILED, "memory is short to resize a picture to %d x %d pixels", width, height);
  }
  free(rows);
  axis_finish(&across);
  axis_finish(&down);
  return status;
}
