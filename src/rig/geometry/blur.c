#include "rig/geometry/blur.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

#define NARROWEST 0.15
#define WIDEST 6.0

static int period_of(int bit) {
  return CLT_BLUR_STEPS << (bit + 2);
}

/* The profile of a square wave of period P, lit from P/4 to 3P/4, blurred by a Gaussian of deviation s:
 *   -sum over odd n of 4/(pi n) sin(pi n / 2) cos(2 pi n x / P) exp(-2 (pi n s / P)^2) */
static double wave(double x, double period, double s) {
  double sum = 0;
  for (int n = 1; n < 400; n += 2) {
    double fade = exp(-2 * pow(M_PI * n * s / period, 2));
    if (fade < 1e-6) {
      break;
    }
    double sign = n % 4 == 1 ? 1 : -1;
    sum -= sign * 4 / (M_PI * n) * cos(2 * M_PI * n * x / period) * fade;
  }
  return sum;
}

static float *fill_bit(clt_blur *blur, int bit, float *at) {
  double period = 4 << bit, squares = 0;
  int steps = period_of(bit);
  blur->profile[bit] = at;
  for (int k = 0; k < steps; k++) {
    double x = (k + 0.5) / CLT_BLUR_STEPS, value = fmin(fmax(wave(x, period, blur->width), -1), 1);
    at[k] = (float)value;
    squares += value * value;
    blur->peak[bit] = fmaxf(blur->peak[bit], at[k]);
  }
  blur->rms[bit] = sqrt(squares / steps);
  return at + steps;
}

clt_status clt_blurs_init(clt_blurs *blurs, clt_error *error) {
  size_t entries = 0;
  for (int bit = 0; bit < CLT_BLUR_BITS; bit++) {
    entries += (size_t)period_of(bit);
  }
  *blurs = (clt_blurs){.memory = clt_alloc(entries * CLT_BLUR_WIDTHS, sizeof(float))};
  if (blurs->memory == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the profiles of blurred stripes");
  }
  float *at = blurs->memory;
  for (int w = 0; w < CLT_BLUR_WIDTHS; w++) {
    blurs->blur[w].width = NARROWEST * pow(WIDEST / NARROWEST, w / (CLT_BLUR_WIDTHS - 1.0));
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

const clt_blur *clt_blurs_fit(const clt_blurs *blurs, const double mean_square[CLT_BLUR_BITS]) {
  const clt_blur *best = &blurs->blur[0];
  double least = INFINITY;
  for (int w = 0; w < CLT_BLUR_WIDTHS; w++) {
    double misfit = 0;
    for (int bit = 0; bit < CLT_BLUR_BITS; bit++) {
      double seen = sqrt(fmax(mean_square[bit], 0));
      misfit += pow(seen - blurs->blur[w].rms[bit], 2);
    }
    if (misfit < least) {
      least = misfit;
      best = &blurs->blur[w];
    }
  }
  return best;
}

float clt_blur_edge(const clt_blur *blur, float x, float edge) {
  return erff((x - edge) / ((float)blur->width * (float)M_SQRT2));
}
