#include "rig/geometry/drift.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"

enum { FEWEST = 50 };
#define LIT 0.03   /* least light of a probe, of full scale */
#define DARK 0.005 /* least mean sum of a channel, of full scale, whose ratios are worth taking */
#define OUT 0.9    /* share of the full height from which a pair's stripes stand out */
#define MOVED 0.01 /* of the light: what locked cameras and lamps stay below */
#define SIGMAS 4.0

/* Median, and the standard error of it from the middle half (normal distribution). */
static double median_of(double *values, int count, double *deviation) {
  if (count < FEWEST) {
    *deviation = 0;
    return NAN;
  }
  clt_sort_doubles(values, (size_t)count);
  double quartiles = values[count * 3 / 4] - values[count / 4];
  *deviation = 1.2533 * quartiles / 1.349 / sqrt(count);
  return values[count / 2];
}

/* What the probes say: height of the stripes of each pair and of the whole, and mean sums. */
typedef struct probes {
  const clt_pairs *pairs;
  float *height; /* [pair * probes + p] */
  float *mean;   /* [channel * probes + p], mean sum over the pairs */
  bool *lit;
} probes;

static size_t pixel_of(const clt_pairs *pairs, int p) {
  size_t x = (size_t)(p % pairs->across * pairs->stride), y = (size_t)(p / pairs->across * pairs->stride);
  return y * (size_t)pairs->sensor.width + x;
}

/* Height of a pair's stripes at a probe, by the pixels beside it: the probe's own noise must not choose whether it
 * counts, for bright noise raises difference and sum alike. */
static float height_at(const clt_pairs *pairs, int pair, int p) {
  const int16_t *at = pairs->difference + (size_t)pair * pairs->pixels + pixel_of(pairs, p);
  int x = p % pairs->across * pairs->stride;
  return fminf(fabsf((float)at[x > 0 ? -1 : 0]), fabsf((float)at[x + 1 < pairs->sensor.width ? 1 : 0]));
}

static void read_probe(probes *seen, int p) {
  const clt_pairs *pairs = seen->pairs;
  float largest = 0;
  for (int k = 0; k < pairs->pairs; k++) {
    float height = height_at(pairs, k, p);
    seen->height[(size_t)k * (size_t)pairs->probes + (size_t)p] = height;
    largest = fmaxf(largest, height);
  }
  seen->lit[p] = largest >= LIT * CLT_PAIRS_FULL && !pairs->saturated[pixel_of(pairs, p)];
  for (int c = 0; c < pairs->sensor.channels; c++) {
    double sum = 0;
    for (int k = 0; k < pairs->pairs; k++) {
      sum += clt_pairs_probe(pairs, k, p, c);
    }
    seen->mean[(size_t)c * (size_t)pairs->probes + (size_t)p] = (float)(sum / pairs->pairs);
  }
}

/* Heights over the light of their pairs, relative to the probe's largest. */
static void compare_heights(probes *seen, const clt_drift *drift) {
  size_t count = (size_t)seen->pairs->probes;
  for (size_t p = 0; p < count; p++) {
    float largest = 1e-6F;
    for (int k = 0; k < drift->pairs; k++) {
      double gain = 0;
      for (int c = 0; c < drift->channels; c++) {
        gain += drift->all[k][c] / drift->channels;
      }
      seen->height[(size_t)k * count + p] /= gain > 0 ? (float)gain : 1;
      largest = fmaxf(largest, seen->height[(size_t)k * count + p]);
    }
    for (int k = 0; k < drift->pairs; k++) {
      seen->height[(size_t)k * count + p] /= largest;
    }
  }
}

/* Sums of a pair over the probe's mean, median over probes; of those at which the stripes stand out where wide. */
static double measure_pair(const probes *seen, int pair, int channel, bool wide, double *work, double *deviation) {
  const clt_pairs *pairs = seen->pairs;
  int count = 0;
  for (int p = 0; p < pairs->probes; p++) {
    double mean = seen->mean[(size_t)channel * (size_t)pairs->probes + (size_t)p];
    bool out = seen->height[(size_t)pair * (size_t)pairs->probes + (size_t)p] >= OUT;
    if (seen->lit[p] && mean >= DARK * CLT_PAIRS_FULL && (out || !wide)) {
      work[count++] = clt_pairs_probe(pairs, pair, p, channel) / mean;
    }
  }
  return median_of(work, count, deviation);
}

static void measure_all(probes *seen, double *work, clt_drift *drift) {
  double error = 0;
  for (int p = 0; p < seen->pairs->probes; p++) {
    read_probe(seen, p);
  }
  for (int wide = 0; wide < 2; wide++) {
    for (int k = 0; k < drift->pairs; k++) {
      for (int c = 0; c < drift->channels; c++) {
        double *to = wide ? &drift->wide[k][c] : &drift->all[k][c];
        *to = measure_pair(seen, k, c, wide, work, &error);
        drift->noise = fmax(drift->noise, error);
      }
    }
    compare_heights(seen, drift);
  }
}

clt_status clt_drift_measure(const clt_pairs *pairs, clt_drift *drift, clt_error *error) {
  size_t count = (size_t)pairs->probes;
  *drift = (clt_drift){.pairs = pairs->pairs, .channels = pairs->sensor.channels};
  probes seen = {.pairs = pairs,
                 .height = clt_alloc(count * (size_t)pairs->pairs, sizeof *seen.height),
                 .mean = clt_alloc(count * (size_t)pairs->sensor.channels, sizeof *seen.mean),
                 .lit = clt_alloc(count, sizeof *seen.lit)};
  double *work = clt_alloc(count, sizeof *work);
  clt_status status = CLT_OK;
  if (seen.height == NULL || seen.mean == NULL || seen.lit == NULL || work == NULL) {
    status = clt_fail(error, CLT_FAILED, "out of memory for %zu probes of drift", count);
  } else {
    measure_all(&seen, work, drift);
  }
  free(seen.height);
  free(seen.mean);
  free(seen.lit);
  free(work);
  return status;
}

double clt_drift_span(const clt_drift *drift, int channel, bool wide) {
  double low = INFINITY, high = -INFINITY;
  for (int k = 0; k < drift->pairs; k++) {
    double sum = wide ? drift->wide[k][channel] : drift->all[k][channel];
    if (isfinite(sum)) {
      low = fmin(low, sum);
      high = fmax(high, sum);
    }
  }
  return high > low ? high - low : 0;
}

/* The channel whose sums move most. */
static int worst_channel(const clt_drift *drift, bool wide) {
  int worst = 0;
  for (int c = 1; c < drift->channels; c++) {
    worst = clt_drift_span(drift, c, wide) > clt_drift_span(drift, worst, wide) ? c : worst;
  }
  return worst;
}

void clt_drift_judge(const clt_drift *drift, clt_findings *findings) {
  static const char *const names[] = {"red", "green", "blue"};
  double limit = MOVED + SIGMAS * drift->noise;
  int wide = worst_channel(drift, true), all = worst_channel(drift, false);
  double moved = clt_drift_span(drift, wide, true), faded = clt_drift_span(drift, all, false);
  const char *light = drift->channels == 3 ? names[wide] : "light";
  if (moved > limit) {
    clt_findings_add(findings, true,
                     "pattern + inverse drift by %.1f %% (%s): exposure, gain or white balance moves, or the response "
                     "is not the one given; set the camera to manual, lock all, record raw",
                     100 * moved, light);
  }
  if (faded > limit && faded > 2 * moved) {
    clt_findings_add(findings, true,
                     "pattern + inverse change by %.1f %% from wide to fine stripes: samples are not linear in light; "
                     "record raw frames or give the camera's response",
                     100 * faded);
  }
}
