/* Counter-based noise: every number is a function of (seed, frame, sample), so that it does not depend on who asks for
 * it in which order. */
#ifndef CLT_SIM_NOISE_H
#define CLT_SIM_NOISE_H

#include <stdint.h>

/* Key of the numbers of one frame. */
uint64_t clt_noise_key(uint64_t seed, uint64_t frame);
/* Uniform in the open interval (0, 1): number `counter` of a key (splitmix64; Steele, Lea, Flood, OOPSLA 2014). */
double clt_noise_uniform(uint64_t key, uint64_t counter);
/* The standard normal quantile of 0 < p < 1, to 7 digits (Wichura 1988, AS 241, PPND7). */
double clt_noise_normal(double p);

/* exp(-mean) where clt_noise_electrons needs it, else 0. */
double clt_noise_none(double mean);
/* Electrons read out of one pixel: Poisson of `mean` (>= 0) plus Gaussian read noise of read_noise electrons rms. The
 * Poisson part is exact below 30 electrons and Gaussian above. none = clt_noise_none(mean), which pixels of a
 * cell share. */
double clt_noise_electrons(uint64_t key, uint64_t sample, double mean, double none, double read_noise);

#endif
