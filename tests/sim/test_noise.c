#include "sim/noise.h"
#include "support.h"

static void quantiles(void **state) {
  (void)state;
  /* of the standard normal, from tables */
  const double known[][2] = {{0.5, 0.0},
                             {0.841344746068543, 1.0},
                             {0.977249868051821, 2.0},
                             {0.998650101968370, 3.0},
                             {3.16712418331200e-5, -4.0},
                             {9.86587645037698e-10, -6.0}};
  for (size_t k = 0; k < sizeof known / sizeof known[0]; k++) {
    assert_near(clt_noise_normal(known[k][0]), known[k][1], 2e-6);
  }
}

/* Mean, variance and third moment against Poisson + normal: mean, mean + r^2, mean. The bounds are 4.5 standard errors
 * of the sample moments. */
static void electrons(void **state) {
  (void)state;
  enum { SAMPLES = 400000 };
  const double means[] = {0.0, 0.05, 1.0, 7.5, 29.0, 31.0, 400.0};
  for (int k = 0; k < 7; k++) {
    double mean = means[k], read = 3.0, variance = mean + read * read, m1 = 0.0, m2 = 0.0, m3 = 0.0;
    uint64_t key = clt_noise_key(5, (uint64_t)k);
    for (uint64_t n = 0; n < SAMPLES; n++) {
      double d = clt_noise_electrons(key, n, mean, exp(-mean), read) - mean;
      m1 += d / SAMPLES;
      m2 += d * d / SAMPLES;
      m3 += d * d * d / SAMPLES;
    }
    assert_near(m1, 0.0, 4.5 * sqrt(variance / SAMPLES));
    assert_near(m2, variance, 4.5 * sqrt((2 * variance * variance + mean) / SAMPLES));
    double skew = mean < 30.0 ? mean : 0.0;
    assert_near(m3, skew, 4.5 * sqrt((15 * pow(variance, 3) + 40 * mean * variance) / SAMPLES));
  }
}

/* Without read noise the counts are Poisson's own probabilities. */
static void counts(void **state) {
  (void)state;
  enum { SAMPLES = 200000, COUNTS = 12 };
  double mean = 2.3, expected = exp(-mean);
  long seen[COUNTS] = {0};
  for (uint64_t n = 0; n < SAMPLES; n++) {
    double count = clt_noise_electrons(clt_noise_key(1, 2), n, mean, exp(-mean), 0.0);
    assert_true(count >= 0.0 && count == floor(count));
    seen[count < COUNTS ? (int)count : COUNTS - 1]++;
  }
  for (int k = 0; k < 8; k++) {
    assert_near((double)seen[k] / SAMPLES, expected, 4.5 * sqrt(expected / SAMPLES));
    expected *= mean / (k + 1);
  }
}

/* Samples, frames and seeds are independent of each other. */
static void independence(void **state) {
  (void)state;
  enum { SAMPLES = 100000 };
  double samples = 0.0, frames = 0.0, seeds = 0.0;
  for (uint64_t n = 0; n < SAMPLES; n++) {
    double u = clt_noise_uniform(clt_noise_key(1, 1), n) - 0.5;
    assert_true(fabs(u) < 0.5);
    samples += 12 * u * (clt_noise_uniform(clt_noise_key(1, 1), n + 1) - 0.5) / SAMPLES;
    frames += 12 * u * (clt_noise_uniform(clt_noise_key(1, 2), n) - 0.5) / SAMPLES;
    seeds += 12 * u * (clt_noise_uniform(clt_noise_key(2, 1), n) - 0.5) / SAMPLES;
  }
  double bound = 4.5 / sqrt(SAMPLES);
  assert_near(samples, 0.0, bound);
  assert_near(frames, 0.0, bound);
  assert_near(seeds, 0.0, bound);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(quantiles),
      cmocka_unit_test(electrons),
      cmocka_unit_test(counts),
      cmocka_unit_test(independence),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
