#include "rig/agreement.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

/* Deviations from which a difference is no noise; share of the light in a cell or beside it by which flicker, a picture
 * that shakes by a fifth of a cell, or an exposure time that is not quite kept may change it. */
#define DEVIATIONS 8.0
#define TOLERANCE 0.2

clt_status clt_agreement_init(clt_agreement *agreement, int width, int height, int channels, clt_error *error) {
  size_t cells = (size_t)width * (size_t)height;
  *agreement = (clt_agreement){.width = width,
                               .height = height,
                               .rate = clt_alloc(2 * cells, sizeof *agreement->rate),
                               .variance = clt_alloc(2 * cells, sizeof *agreement->variance),
                               .bias = clt_alloc(2 * cells, sizeof *agreement->bias),
                               .dazzled = clt_alloc(cells, sizeof *agreement->dazzled),
                               .doubtful = clt_alloc(cells * (size_t)channels, sizeof *agreement->doubtful)};
  if (agreement->rate == NULL || agreement->variance == NULL || agreement->bias == NULL || agreement->dazzled == NULL ||
      agreement->doubtful == NULL) {
    clt_agreement_finish(agreement);
    return clt_fail(error, CLT_FAILED, "out of memory for comparing exposures of %zu cells", cells);
  }
  return CLT_OK;
}

void clt_agreement_finish(clt_agreement *agreement) {
  free(agreement->rate);
  free(agreement->variance);
  free(agreement->bias);
  free(agreement->dazzled);
  free(agreement->doubtful);
  *agreement = (clt_agreement){0};
}

/* Rates of a channel by one exposure, to one half of the arrays. A saturated value has the least rate that it proves
 * and a variance of -1; one that is not seen is NaN. */
static void read_rates(const clt_agreement *agreement, const clt_merge *merge, int exposure, int channel, size_t half) {
  float *rate = agreement->rate + half, *variance = agreement->variance + half, *bias = agreement->bias + half;
  size_t cells = (size_t)agreement->width * (size_t)agreement->height;
  const clt_merge_sum *sums =
      merge->sums + ((size_t)exposure * (size_t)merge->camera.channels + (size_t)channel) * cells;
  double t = merge->seconds[exposure];
  for (size_t i = 0; i < cells; i++) {
    bool seen = merge->footprints->start[i + 1] > merge->footprints->start[i];
    bool whole = sums[i].count > 0;
    double e = (whole ? (double)sums[i].light : (double)merge->light[(int)(sums[i].raw + 0.5f)]) / t;
    rate[i] = seen ? (float)e : NAN;
    variance[i] = whole ? (float)clt_merge_noise(merge, &sums[i], t, e) : -1;
    bias[i] = whole ? (float)clt_merge_bias(merge, &sums[i], t, e) : 0;
  }
}

/* The brightest of a cell and its neighbours in either exposure. */
static float brightest_beside(const clt_agreement *agreement, int x, int y) {
  float most = 0;
  size_t cells = (size_t)agreement->width * (size_t)agreement->height;
  for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < agreement->height; v++) {
    for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < agreement->width; u++) {
      size_t i = (size_t)v * (size_t)agreement->width + (size_t)u;
      most = fmaxf(most, fmaxf(agreement->rate[i], agreement->rate[cells + i]));
    }
  }
  return most;
}

static bool contradict(double apart, double variance, double bias, double beside) {
  return fabs(apart) > DEVIATIONS * sqrt(variance) + bias + TOLERANCE * beside;
}

/* Values of one row that contradict each other, marked; where none does, 1 where the sum of those does that nothing
 * dazzles. */
static size_t check_row(const clt_agreement *agreement, int y, uint8_t *doubtful) {
  size_t cells = (size_t)agreement->width * (size_t)agreement->height, bad = 0;
  const float *rate = agreement->rate, *variance = agreement->variance;
  double sum[2] = {0, 0}, sum_variance = 0, sum_bias = 0;
  for (int x = 0; x < agreement->width; x++) {
    size_t i = (size_t)y * (size_t)agreement->width + (size_t)x, j = cells + i;
    bool open_a = variance[i] < 0, open_b = variance[j] < 0;
    /* A saturated value is only bounded from below: it contradicts what is darker. */
    bool apart = !(open_a && rate[j] >= rate[i]) && !(open_b && rate[i] >= rate[j]) && !(open_a && open_b);
    double both = fmax((double)variance[i], 0) + fmax((double)variance[j], 0);
    if (isnan(rate[i]) || !apart) {
      continue;
    }
    double own = fmax((double)rate[i], (double)rate[j]), off = (double)rate[i] - (double)rate[j];
    double bias = (double)agreement->bias[i] + (double)agreement->bias[j];
    bool here =
        contradict(off, both, bias, own) && contradict(off, both, bias, (double)brightest_beside(agreement, x, y));
    doubtful[i] |= here;
    bad += here;
    if (!agreement->dazzled[i]) {
      sum[0] += (double)rate[i];
      sum[1] += (double)rate[j];
      sum_variance += both;
      sum_bias += bias;
    }
  }
  bool row = contradict(sum[0] - sum[1], sum_variance, sum_bias, fmax(sum[0], sum[1]));
  return bad > 0 ? bad : (size_t)row;
}

static bool saturates(const clt_merge *merge, int exposure, size_t cells, size_t i) {
  const clt_merge_sum *sum = merge->sums + (size_t)exposure * (size_t)merge->camera.channels * cells + i;
  bool full = false;
  for (int c = 0; c < merge->camera.channels; c++) {
    full = full || sum[(size_t)c * cells].count == 0;
  }
  return full && merge->footprints->start[i + 1] > merge->footprints->start[i];
}

/* What a saturated pixel gives to those beside is not proportional to its light: the colour differences that it shares
 * with them, charge that overflows. */
static void find_dazzled(clt_agreement *agreement, const clt_merge *merge, int a, int b) {
  int width = agreement->width, height = agreement->height;
  size_t cells = (size_t)width * (size_t)height;
  memset(agreement->dazzled, 0, cells);
  for (int y = 0; y < height; y++) {
    for (int x = 0; x < width; x++) {
      size_t i = (size_t)y * (size_t)width + (size_t)x;
      if (!saturates(merge, a, cells, i) && !saturates(merge, b, cells, i)) {
        continue;
      }
      for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < height; v++) {
        int left = x > 0 ? x - 1 : 0, right = x + 1 < width ? x + 1 : x;
        memset(agreement->dazzled + (size_t)v * (size_t)width + left, 1, (size_t)(right - left + 1));
      }
    }
  }
}

static size_t check_pair(clt_agreement *agreement, const clt_merge *merge, int a, int b) {
  size_t cells = (size_t)agreement->width * (size_t)agreement->height, bad = 0;
  find_dazzled(agreement, merge, a, b);
  for (int c = 0; c < merge->camera.channels; c++) {
    read_rates(agreement, merge, a, c, 0);
    read_rates(agreement, merge, b, c, cells);
    for (int y = 0; y < agreement->height; y++) {
      bad += check_row(agreement, y, agreement->doubtful + (size_t)c * cells);
    }
  }
  return bad;
}

size_t clt_agreement_check(clt_agreement *agreement, const clt_merge *merge, bool bad[CLT_EXPOSURES_MAX]) {
  size_t worst = 0, values = (size_t)agreement->width * (size_t)agreement->height * (size_t)merge->camera.channels;
  memset(agreement->doubtful, 0, values);
  memset(bad, 0, sizeof(bool[CLT_EXPOSURES_MAX]));
  for (int b = 1; b < merge->exposures; b++) {
    for (int a = 0; a < b; a++) {
      size_t apart = check_pair(agreement, merge, a, b);
      bad[a] = bad[a] || apart > 0;
      bad[b] = bad[b] || apart > 0;
      worst = apart > worst ? apart : worst;
    }
  }
  return worst;
}
