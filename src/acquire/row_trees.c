#include "acquire/row_trees.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

/* A difference below this many deviations is taken for noise. */
#define NOISE_FLOOR 3.0
/* Light that is shared evenly at one level may still be uneven below, by chance or by symmetry: a spread is at least
 * this part of a block's light. */
#define SPREAD_FLOOR (1.0f / 16)
/* No light is below zero by more than this, in units of a channel's scale. */
#define NEGATIVE_LIMIT 0.002f
enum { WORTH_SHARING = 65536 }; /* leaves from which threads pay */

static clt_status allocate_leaves(clt_row_trees *trees, clt_error *error) {
  size_t leaves = (size_t)trees->start[trees->rows];
  trees->node = clt_alloc(leaves, sizeof *trees->node);
  trees->value = clt_alloc(leaves * (size_t)trees->channels, sizeof *trees->value);
  trees->variance = clt_alloc(leaves, sizeof *trees->variance);
  trees->spread = clt_alloc(leaves, sizeof *trees->spread);
  if (trees->node == NULL || trees->value == NULL || trees->variance == NULL || trees->spread == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for %zu blocks of light; raise the threshold", leaves);
  }
  return CLT_OK;
}

static clt_status allocate_rows(clt_row_trees *trees, size_t rows, int channels, clt_error *error) {
  *trees = (clt_row_trees){.rows = rows, .channels = channels, .start = clt_alloc(rows + 1, sizeof *trees->start)};
  return trees->start != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for %zu rows", rows);
}

void clt_row_trees_finish(clt_row_trees *trees) {
  free(trees->start);
  free(trees->node);
  free(trees->value);
  free(trees->variance);
  free(trees->spread);
  *trees = (clt_row_trees){0};
}

static float largest_value(const clt_row_trees *trees, int64_t leaf) {
  float largest = 0;
  for (int c = 0; c < trees->channels; c++) {
    largest = fmaxf(largest, fabsf(trees->value[leaf * trees->channels + c]));
  }
  return largest;
}

clt_status clt_row_trees_plant(const clt_pyramid *pyramid, const clt_image *flood, const double *scale,
                               const float *variance, clt_row_trees *trees, clt_error *error) {
  size_t rows = (size_t)flood->width * (size_t)flood->height;
  clt_status status = allocate_rows(trees, rows, flood->channels, error);
  if (status != CLT_OK) {
    return status;
  }
  for (size_t i = 0; i <= rows; i++) {
    trees->start[i] = (int64_t)i;
  }
  status = allocate_leaves(trees, error);
  for (size_t i = 0; status == CLT_OK && i < rows; i++) {
    trees->node[i] = pyramid->first[pyramid->levels - 1];
    for (int c = 0; c < flood->channels; c++) {
      trees->value[i * (size_t)flood->channels + (size_t)c] = (float)(flood->data[(size_t)c * rows + i] / scale[c]);
    }
    trees->spread[i] = largest_value(trees, (int64_t)i);
    /* A saturated flood only bounds the row; the dimmer photographs must be free to correct it. */
    trees->variance[i] = isfinite(variance[i]) ? variance[i] : trees->spread[i] * trees->spread[i];
  }
  return status;
}

static bool is_at(const clt_pyramid *pyramid, int level, int32_t node) {
  return node >= pyramid->first[level] && node < pyramid->first[level + 1];
}

void clt_row_trees_active(const clt_row_trees *trees, const clt_pyramid *pyramid, int level, double threshold,
                          int64_t *start, int32_t *column) {
  int64_t count = 0;
  for (size_t i = 0; i < trees->rows; i++) {
    start[i] = count;
    for (int64_t e = trees->start[i]; e < trees->start[i + 1]; e++) {
      if (is_at(pyramid, level, trees->node[e]) && trees->spread[e] > threshold) {
        column[count++] = trees->node[e] - pyramid->first[level];
      }
    }
  }
  start[trees->rows] = count;
}

static bool is_split(const clt_row_trees *trees, const clt_pyramid *pyramid, int level, double threshold,
                     const int32_t *colour, int64_t leaf) {
  int32_t node = trees->node[leaf];
  return is_at(pyramid, level, node) && trees->spread[leaf] > threshold && colour[node - pyramid->first[level]] >= 0;
}

/* Writes the children of a leaf from `to` on; returns their count. */
static int split_leaf(const clt_row_trees *before, int64_t leaf, const clt_pyramid *pyramid, int level,
                      clt_row_trees *after, int64_t to) {
  int32_t children[4];
  int count = clt_block_children(pyramid, level, before->node[leaf], children);
  int cells = clt_block_cells(pyramid, level, before->node[leaf]);
  float spread = before->spread[leaf];
  for (int q = 0; q < count; q++) {
    float share = (float)clt_block_cells(pyramid, level - 1, children[q]) / (float)cells;
    after->node[to + q] = children[q];
    after->variance[to + q] = spread * spread + share * share * before->variance[leaf];
    after->spread[to + q] = spread;
    for (int c = 0; c < before->channels; c++) {
      after->value[(to + q) * before->channels + c] = share * before->value[leaf * before->channels + c];
    }
  }
  return count;
}

static void copy_leaf(const clt_row_trees *before, int64_t leaf, clt_row_trees *after, int64_t to) {
  size_t channels = (size_t)before->channels;
  after->node[to] = before->node[leaf];
  after->variance[to] = before->variance[leaf];
  after->spread[to] = before->spread[leaf];
  memcpy(after->value + (size_t)to * channels, before->value + (size_t)leaf * channels,
         channels * sizeof *after->value);
}

clt_status clt_row_trees_split(const clt_row_trees *before, const clt_pyramid *pyramid, int level, double threshold,
                               const int32_t *colour, clt_row_trees *after, clt_error *error) {
  clt_status status = allocate_rows(after, before->rows, before->channels, error);
  if (status != CLT_OK) {
    return status;
  }
  for (size_t i = 0; i < before->rows; i++) {
    after->start[i + 1] = after->start[i];
    for (int64_t e = before->start[i]; e < before->start[i + 1]; e++) {
      int32_t children[4];
      bool split = is_split(before, pyramid, level, threshold, colour, e);
      after->start[i + 1] += split ? clt_block_children(pyramid, level, before->node[e], children) : 1;
    }
  }
  status = allocate_leaves(after, error);
  if (status != CLT_OK) {
    return status;
  }
#pragma omp parallel for schedule(dynamic, 256) if (after->start[after->rows] >= WORTH_SHARING)
  for (size_t i = 0; i < before->rows; i++) {
    int64_t to = after->start[i];
    for (int64_t e = before->start[i]; e < before->start[i + 1]; e++) {
      if (is_split(before, pyramid, level, threshold, colour, e)) {
        to += split_leaf(before, e, pyramid, level, after, to);
      } else {
        copy_leaf(before, e, after, to++);
      }
    }
  }
  return CLT_OK;
}

/* The light of a lit pattern that the leaves of row i explain (added to explained[c]), and the variance of that. */
static double explain(const clt_row_trees *trees, size_t i, int32_t children_end, const double *fill,
                      double *explained) {
  double variance = 0;
  for (int64_t e = trees->start[i]; e < trees->start[i + 1]; e++) {
    double f = fill[trees->node[e]];
    if (f == 0) {
      continue;
    }
    for (int c = 0; c < trees->channels; c++) {
      explained[c] += f * trees->value[e * trees->channels + c];
    }
    /* Half of a block lit tells least about what its light is: 4 f (1 - f) spread^2 is exact for an even half. */
    double spread = trees->spread[e];
    variance += trees->node[e] < children_end ? trees->variance[e] : 4 * f * (1 - f) * spread * spread;
  }
  return variance;
}

void clt_row_trees_correct(clt_row_trees *trees, const clt_pyramid *pyramid, int level, const double *fill,
                           const clt_image *seen, const double *scale, const float *noise) {
  int32_t children_end = pyramid->first[level + 1];
#pragma omp parallel for schedule(dynamic, 256) if (trees->start[trees->rows] >= WORTH_SHARING)
  for (size_t i = 0; i < trees->rows; i++) {
    double residual[4] = {0};
    double total = explain(trees, i, children_end, fill, residual) + noise[i];
    if (!(total > 0) || isinf(total)) {
      continue;
    }
    for (int c = 0; c < trees->channels; c++) {
      residual[c] = seen->data[(size_t)c * trees->rows + i] / scale[c] - residual[c];
    }
    for (int64_t e = trees->start[i]; e < trees->start[i + 1]; e++) {
      if (trees->node[e] < children_end && fill[trees->node[e]] > 0) {
        double gain = trees->variance[e] / total;
        for (int c = 0; c < trees->channels; c++) {
          trees->value[e * trees->channels + c] += (float)(gain * residual[c]);
        }
        trees->variance[e] *= (float)(1 - gain);
      }
    }
  }
}

/* Shares what count leaves lack to add up to total[c], whose variance is total_variance: the minimum-variance estimate
 * given one noisy sum. Where nothing is uncertain the brightest leaf takes it. */
static void share_missing(clt_row_trees *trees, int64_t first, int64_t count, const double *total,
                          double total_variance) {
  int channels = trees->channels;
  int64_t brightest = first;
  double missing[4], variance = total_variance;
  memcpy(missing, total, (size_t)channels * sizeof *missing);
  for (int64_t e = first; e < first + count; e++) {
    variance += trees->variance[e];
    brightest = largest_value(trees, e) > largest_value(trees, brightest) ? e : brightest;
    for (int c = 0; c < channels; c++) {
      missing[c] -= trees->value[e * channels + c];
    }
  }
  for (int64_t e = first; e < first + count; e++) {
    double gain = variance > 0 ? trees->variance[e] / variance : e == brightest;
    for (int c = 0; c < channels; c++) {
      trees->value[e * channels + c] += (float)(gain * missing[c]);
    }
    trees->variance[e] *= (float)(1 - gain);
  }
}

/* How far the children lie from an even split of the parent's value, beyond noise. An only child tells nothing new. */
static float unevenness(const clt_row_trees *before, int64_t parent, const clt_row_trees *after, int64_t first,
                        int count, const clt_pyramid *pyramid, int level) {
  int cells = clt_block_cells(pyramid, level, before->node[parent]), channels = before->channels;
  double largest = 0;
  if (count == 1) {
    return before->spread[parent];
  }
  for (int64_t e = first; e < first + count; e++) {
    double share = (double)clt_block_cells(pyramid, level - 1, after->node[e]) / cells;
    double noise = NOISE_FLOOR * NOISE_FLOOR * after->variance[e];
    for (int c = 0; c < channels; c++) {
      double difference = after->value[e * channels + c] - share * before->value[parent * channels + c];
      largest = fmax(largest, difference * difference - noise);
    }
  }
  return (float)sqrt(largest);
}

/* The last child of four was not photographed: all that is known is that its family adds up to the parent. Where one
 * sibling holds the cell's own light, the difference of two bright measurements says less than the two dim siblings do:
 * the light is expected to be like theirs, unless more is missing than noise explains (too little is always noise). */
static void expect_last_child(clt_row_trees *trees, int64_t first, const double *total, double total_variance) {
  int channels = trees->channels;
  int64_t last = first + 3, brightest = first;
  double noise = total_variance;
  for (int64_t e = first; e < last; e++) {
    brightest = largest_value(trees, e) > largest_value(trees, brightest) ? e : brightest;
    noise += trees->variance[e];
  }
  double mean[4] = {0}, missing[4], dim = 0, largest = 0;
  memcpy(missing, total, (size_t)channels * sizeof *missing);
  for (int64_t e = first; e < last; e++) {
    for (int c = 0; c < channels; c++) {
      double value = trees->value[e * channels + c];
      missing[c] -= value;
      mean[c] += e == brightest ? 0 : value / 2;
    }
    dim = e == brightest ? dim : fmax(dim, pow(largest_value(trees, e), 2) + trees->variance[e]);
  }
  for (int c = 0; c < channels; c++) {
    largest = fmax(largest, missing[c] - mean[c]);
  }
  if (largest * largest < NOISE_FLOOR * NOISE_FLOOR * (noise + dim) && dim < trees->variance[last]) {
    trees->variance[last] = (float)dim;
    for (int c = 0; c < channels; c++) {
      trees->value[last * channels + c] = (float)mean[c];
    }
  }
}

static void settle_row(clt_row_trees *after, const clt_row_trees *before, const clt_pyramid *pyramid, int level,
                       size_t i) {
  int64_t e = after->start[i];
  for (int64_t parent = before->start[i]; parent < before->start[i + 1]; parent++) {
    if (after->node[e] == before->node[parent]) {
      e++;
      continue;
    }
    int32_t children[4];
    int count = clt_block_children(pyramid, level, before->node[parent], children);
    double total[4];
    for (int c = 0; c < before->channels; c++) {
      total[c] = before->value[parent * before->channels + c];
    }
    if (count == 4) {
      expect_last_child(after, e, total, before->variance[parent]);
    }
    share_missing(after, e, count, total, before->variance[parent]);
    float spread = unevenness(before, parent, after, e, count, pyramid, level);
    for (int q = 0; q < count; q++, e++) {
      float light = largest_value(after, e);
      after->spread[e] = fminf(fmaxf(spread, SPREAD_FLOOR * light), light);
    }
  }
}

void clt_row_trees_settle(clt_row_trees *after, const clt_row_trees *before, const clt_pyramid *pyramid, int level) {
#pragma omp parallel for schedule(dynamic, 256) if (after->start[after->rows] >= WORTH_SHARING)
  for (size_t i = 0; i < after->rows; i++) {
    settle_row(after, before, pyramid, level, i);
  }
}

/* Light is not negative: what lies below zero beyond noise was taken for another block's, and stays zero from now on.
 */
static void clip_negative(clt_row_trees *trees, size_t i) {
  for (int64_t e = trees->start[i]; e < trees->start[i + 1]; e++) {
    float least = -fminf(NOISE_FLOOR * sqrtf(trees->variance[e]), NEGATIVE_LIMIT);
    for (int c = 0; c < trees->channels; c++) {
      float *value = &trees->value[e * trees->channels + c];
      if (*value < least) {
        *value = 0;
        trees->variance[e] = 0;
      }
    }
  }
}

void clt_row_trees_match_flood(clt_row_trees *trees, const clt_image *flood, const double *scale,
                               const float *variance) {
  enum { ROUNDS = 3 }; /* sharing may push other leaves below zero */
#pragma omp parallel for schedule(static) if (trees->start[trees->rows] >= WORTH_SHARING)
  for (size_t i = 0; i < trees->rows; i++) {
    double total[4];
    for (int c = 0; c < trees->channels; c++) {
      total[c] = flood->data[(size_t)c * trees->rows + i] / scale[c];
    }
    for (int round = 0; round < ROUNDS; round++) {
      clip_negative(trees, i);
      if (isfinite(variance[i])) {
        share_missing(trees, trees->start[i], trees->start[i + 1] - trees->start[i], total, 0);
      }
    }
  }
}
