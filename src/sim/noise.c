#include "sim/noise.h"

#include <math.h>

#include "base/random.h"

static const double EXACT_BELOW = 30.0; /* electrons */

uint64_t clt_noise_key(uint64_t seed, uint64_t frame) {
  return clt_random_key(seed, frame);
}

double clt_noise_uniform(uint64_t key, uint64_t counter) {
  return clt_random_uniform(key, counter);
}

double clt_noise_normal(double p) {
  double q = p - 0.5;
  if (fabs(q) <= 0.425) {
    double r = 0.180625 - q * q;
    return q * (((59.109374720 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179) /
           (((67.187563600 * r + 78.757757664) * r + 17.895169469) * r + 1.0);
  }
  double r = sqrt(-log(q < 0.0 ? p : 1.0 - p)), size;
  if (r <= 5.0) {
    r -= 1.6;
    size = (((0.17023821103 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777) /
           ((0.12021132975 * r + 0.73700164250) * r + 1.0);
  } else {
    r -= 5.0;
    size = (((0.017337203997 * r + 0.42868294337) * r + 3.0812263860) * r + 6.6579051150) /
           ((0.012258202635 * r + 0.24197894225) * r + 1.0);
  }
  return q < 0.0 ? -size : size;
}

/* The smallest count whose cumulative probability reaches u. */
static double poisson(double u, double mean, double none) {
  double probability = none, cumulative = none;
  int count = 0;
  while (u > cumulative && count < 200) {
    count++;
    probability *= mean / count;
    cumulative += probability;
  }
  return count;
}

double clt_noise_none(double mean) {
  return mean < EXACT_BELOW ? exp(-mean) : 0.0;
}

double clt_noise_electrons(uint64_t key, uint64_t sample, double mean, double none, double read_noise) {
  double normal = clt_noise_normal(clt_noise_uniform(key, 2 * sample));
  if (mean >= EXACT_BELOW) {
    return mean + sqrt(mean + read_noise * read_noise) * normal;
  }
  return poisson(clt_noise_uniform(key, 2 * sample + 1), mean, none) + read_noise * normal;
}
