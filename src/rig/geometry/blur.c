#include "rig/geometry/blur.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

#define NARROWEST 0.03
#define WIDEST 6.0
#define LEAST_GAIN 0.7
#define REACH 5.0 /* widths from which an edge is felt */

enum { STEPS_LEAST = 4 };

static double width_of(int index) {
  return NARROWEST * pow(WIDEST / NARROWEST, index / (CLT_BLUR_WIDTHS - 1.0));
}

/* Edges are placed to a part of their width. */
static int steps_of(double width) {
  int steps = STEPS_LEAST;
  while (steps * width < 2 && steps < CLT_BLUR_STEPS_MAX) {
    steps *= 2;
  }
  return steps;
}

/* The profile of a square wave of period P, lit from P/4 to 3P/4, blurred by a Gaussian of deviation s: from edge to
 * edge at P/4 + k P/2 it rises and falls by 1 + erf((x - edge) / (s sqrt 2)). */
static double wave(double x, double period, double s) {
  long first = (long)ceil(2 * (x - REACH * s) / period - 0.5), last = (long)floor(2 * (x + REACH * s) / period - 0.5);
  double sum = first % 2 == 0 ? -1 : 1;
  for (long k = first; k <= last; k++) {
    double edge = 0.5 * period * ((double)k + 0.5);
    sum += (k % 2 == 0 ? 1 : -1) * (1 + erf((x - edge) / (s * M_SQRT2)));
  }
  return sum;
}

static float *fill_bit(clt_blur *blur, int bit, float *at) {
  double period = 4 << bit, squares = 0;
  int entries = blur->steps << (bit + 2);
  blur->profile[bit] = at;
  for (int k = 0; k < entries; k++) {
    double x = (k + 0.5) / blur->steps, value = fmin(fmax(wave(x, period, blur->width), -1), 1);
    at[k] = (float)value;
    squares += value * value;
    blur->peak[bit] = fmaxf(blur->peak[bit], at[k]);
  }
  blur->rms[bit] = sqrt(squares / entries);
  return at + entries;
}

clt_status clt_blurs_init(clt_blurs *blurs, clt_error *error) {
  size_t entries = 0;
  for (int w = 0; w < CLT_BLUR_WIDTHS; w++) {
    entries += (size_t)steps_of(width_of(w)) * (4 << CLT_BLUR_BITS);
  }
  *blurs = (clt_blurs){.memory = clt_alloc(entries, sizeof(float))};
  if (blurs->memory == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the profiles of blurred stripes");
  }
  float *at = blurs->memory;
  for (int w = 0; w < CLT_BLUR_WIDTHS; w++) {
    blurs->blur[w].width = width_of(w);
    blurs->blur[w].steps = steps_of(width_of(w));
    for (int bit = 0; bit < CLT_BLUR_BITS; bit++) {
      at = fill_bit(&blurs->blur[w], bit, at);
    }
  }
  return CLT_OK;
}

void clt_blurs_finish(clt_blurs *blurs) {
  free(blurs->memory);
  *blurs = (clt_blurs){0};
}

/* gain = sum(seen rms) / sum(rms^2) has the least misfit. */
const clt_blur *clt_blurs_fit(const clt_blurs *blurs, const double *mean_square, int bits, double *gain) {
  const clt_blur *best = &blurs->blur[0];
  double least = INFINITY;
  for (int w = 0; w < CLT_BLUR_WIDTHS; w++) {
    const clt_blur *blur = &blurs->blur[w];
    double product = 0, square = 0, misfit = 0;
    for (int bit = 0; bit < bits; bit++) {
      double weight = pow(0.25, bit);
      product += weight * sqrt(fmax(mean_square[bit], 0)) * blur->rms[bit];
      square += weight * blur->rms[bit] * blur->rms[bit];
    }
    double scale = fmin(fmax(product / square, LEAST_GAIN), 1);
    for (int bit = 0; bit < bits; bit++) {
      misfit += pow(0.25, bit) * pow(sqrt(fmax(mean_square[bit], 0)) - scale * blur->rms[bit], 2);
    }
    if (misfit < least) {
      least = misfit;
      best = blur;
      *gain = scale;
    }
  }
  return best;
}

float clt_blur_edge(const clt_blur *blur, float x, float edge) {
  return erff((x - edge) / ((float)blur->width * (float)M_SQRT2));
}
