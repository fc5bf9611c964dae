/* Sines over time. */
#ifndef CLT_SIM_EFFECTS_SINE_H
#define CLT_SIM_EFFECTS_SINE_H

#include <math.h>

#include "sim/effects/effect.h"

/* Mean of sin(2 pi hz t) over the time of a band: sin at its middle times sin(h) / h with h half its phase. */
static inline double clt_sine_mean(double hz, const clt_band *band) {
  double middle_s = 0.5e-9 * ((double)band->start_ns + (double)band->end_ns);
  double half = M_PI * hz * 1e-9 * (double)(band->end_ns - band->start_ns);
  return sin(2.0 * M_PI * hz * middle_s) * sin(half) / half;
}

#endif
