/* The HDR merge against closed forms and against the empirical spread of simulated frames. */
#include "noise.h"
#include "rig/merge.h"

enum { WIDTH = 8, HEIGHT = 4, CELLS = WIDTH * HEIGHT, K = 3, PIXELS = CELLS * K * K, EXPOSURES = 3 };

static const double seconds[EXPOSURES] = {1e-3, 8e-3, 64e-3};
static const clt_camera_info camera = {.width = WIDTH * K,
                                       .height = HEIGHT * K,
                                       .channels = 1,
                                       .bits = 12,
                                       .black_level = 100,
                                       .responsivity = 40,
                                       .full_well = 8000,
                                       .read_noise = 6};

typedef struct merge_bench {
  clt_footprints footprints;
  clt_merge merge;
  clt_image radiance, deviation;
  clt_curve curve;
  uint64_t random;
} merge_bench;

static void open_bench(merge_bench *bench, clt_curve curve, int exposures) {
  clt_error error = {0};
  bench->curve = curve;
  assert_ok(clt_footprints_align(WIDTH, HEIGHT, camera.width, camera.height, &bench->footprints, &error), error);
  assert_ok(clt_merge_init(&bench->merge, &camera, &curve, &bench->footprints, exposures, &error), error);
  assert_ok(clt_image_init(&bench->radiance, 1, HEIGHT, WIDTH, &error), error);
  assert_ok(clt_image_init(&bench->deviation, 1, HEIGHT, WIDTH, &error), error);
}

static void close_bench(merge_bench *bench) {
  clt_merge_finish(&bench->merge);
  clt_footprints_finish(&bench->footprints);
  clt_image_finish(&bench->radiance);
  clt_image_finish(&bench->deviation);
}

/* One frame of the cells' radiances: electrons with photon and read noise (noise 0: none), then response and rounding.
 */
static void expose(merge_bench *bench, int exposure, double t, const double *radiance, double noise) {
  static uint16_t samples[PIXELS];
  double full = (1 << camera.bits) - 1, range = full - camera.black_level;
  for (int p = 0; p < PIXELS; p++) {
    double light = camera.responsivity * radiance[p / camera.width / K * WIDTH + p % camera.width / K] * t;
    double variance =
        (light * camera.full_well + camera.read_noise * camera.read_noise) / (camera.full_well * camera.full_well);
    light += noise * sqrt(variance) * test_normal(&bench->random);
    double v = bench->curve.kind == CLT_CURVE_LINEAR ? light
               : light < 0                           ? -clt_curve_encode(&bench->curve, -light)
                                                     : clt_curve_encode(&bench->curve, light);
    samples[p] = (uint16_t)lrint(fmin(fmax(camera.black_level + v * range, 0), full));
  }
  clt_frame frame = {camera.width, camera.height, 1, camera.bits, samples, 0, t, 0};
  clt_merge_add(&bench->merge, exposure, &frame);
}

/* Three exposures 1 : 8 : 64, or up to eight, each twice the one before. */
static double seconds_at(int exposures, int k) {
  return exposures <= EXPOSURES ? seconds[k] : 0.5e-3 * (1 << k);
}

static void take_all(merge_bench *bench, const double *radiance, double noise) {
  for (int k = 0; k < bench->merge.exposures; k++) {
    expose(bench, k, seconds_at(bench->merge.exposures, k), radiance, noise);
  }
  clt_merge_radiance(&bench->merge, &bench->radiance, &bench->deviation);
}

/* Radiances from far below one electron to near the saturation of the shortest exposure. */
static void spread_radiances(double *radiance) {
  for (int i = 0; i < CELLS; i++) {
    radiance[i] = 20 * pow(10, -6.0 * i / (CELLS - 1));
  }
}

static void check_statistics(clt_curve curve, int exposures) {
  enum { SEEDS = 1500 };
  merge_bench bench = {.random = 42};
  open_bench(&bench, curve, exposures);
  double truth[CELLS], sum[CELLS] = {0}, square[CELLS] = {0}, reported[CELLS] = {0};
  spread_radiances(truth);
  for (int n = 0; n < SEEDS; n++) {
    take_all(&bench, truth, 1);
    for (int i = 0; i < CELLS; i++) {
      double difference = bench.radiance.data[i] - truth[i];
      sum[i] += difference;
      square[i] += difference * difference;
      reported[i] += (double)bench.deviation.data[i] * bench.deviation.data[i];
    }
  }
  double z_sum = 0, z_square = 0, ratio = 0;
  for (int i = 0; i < CELLS; i++) {
    double mean = sum[i] / SEEDS, variance = square[i] / SEEDS - mean * mean;
    double z = mean / sqrt(variance / SEEDS);
    z_sum += z;
    z_square += z * z;
    ratio += sqrt(reported[i] / SEEDS / variance) / CELLS;
    /* one cell's own ratio has a statistical error of 1 / sqrt(2 SEEDS) = 1.8 % */
    assert_near(sqrt(reported[i] / SEEDS / variance), 1, 0.08);
    assert_near(z, 0, 4);
  }
  /* over all cells: mean of z within 3 standard errors of 0, of z^2 of 1 (its deviation is sqrt(2 / CELLS)) */
  assert_near(z_sum / CELLS, 0, 3 / sqrt(CELLS));
  assert_near(z_square / CELLS, 1, 3 * sqrt(2.0 / CELLS));
  assert_near(ratio, 1, 0.02);
  close_bench(&bench);
}

static void merged_noise_is_unbiased_and_as_large_as_reported(void **state) {
  (void)state;
  check_statistics((clt_curve){.kind = CLT_CURVE_LINEAR}, EXPOSURES);
}

static void a_curved_response_keeps_both(void **state) {
  (void)state;
  check_statistics((clt_curve){.kind = CLT_CURVE_SRGB}, EXPOSURES);
}

static void eight_exposures_keep_both(void **state) {
  (void)state;
  check_statistics((clt_curve){.kind = CLT_CURVE_LINEAR}, CLT_EXPOSURES_MAX);
}

/* Without noise the merge gives the radiance up to rounding of the samples, and the closed form of its variance. */
static void clean_frames_give_the_closed_form(void **state) {
  (void)state;
  merge_bench bench = {0};
  open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, EXPOSURES);
  double truth[CELLS];
  spread_radiances(truth);
  take_all(&bench, truth, 0);
  double range = 4095 - camera.black_level;
  for (int i = 0; i < CELLS; i++) {
    double information = 0, rounding = 0, rate = truth[i] * camera.responsivity;
    for (int k = 0; k < EXPOSURES; k++) {
      double read = camera.read_noise / camera.full_well, t = seconds[k];
      double merged = fmax(bench.radiance.data[i], 0) * camera.responsivity;
      double variance = merged * t / camera.full_well + read * read + 1 / (12 * range * range);
      double weight = rate * t < 0.95 ? K * K * t * t / variance : 0;
      information += weight;
      rounding += weight * 0.51 / range / t;
    }
    double deviation = sqrt(1 / information) / camera.responsivity;
    assert_near(bench.deviation.data[i] / deviation, 1, 2e-3);
    assert_near(bench.radiance.data[i], truth[i], rounding / information / camera.responsivity);
  }
  close_bench(&bench);
}

/* Every cell is within the deviation that is reported, and that is as small as the exposures that are left allow. */
static void check_left(merge_bench *bench, const double *truth, double share) {
  clt_merge_radiance(&bench->merge, &bench->radiance, &bench->deviation);
  for (int i = 0; i < CELLS; i++) {
    assert_near((bench->radiance.data[i] - truth[i]) / bench->deviation.data[i], 0, 4.8);
    assert_true(bench->deviation.data[i] < share * truth[i]);
  }
}

/* Frames of a too bright exposure hold nothing but clipped samples, one of a shutter that failed nothing but noise; a
 * merge that took them would be far too dark. */
static void case_29_saturated_or_dead_exposure(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 20; seed++) {
    merge_bench bench = {.random = seed};
    open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, EXPOSURES);
    double truth[CELLS], dark[CELLS] = {0};
    for (int i = 0; i < CELLS; i++) { /* saturates the two longer exposures */
      truth[i] = (0.1 + 0.8 * i / CELLS) / (camera.responsivity * seconds[0]);
    }
    take_all(&bench, truth, 1);
    check_left(&bench, truth, .03);
    for (int dead = 0; dead < EXPOSURES; dead++) {
      for (int i = 0; i < CELLS; i++) { /* within the range of all three */
        truth[i] = (0.2 + 0.6 * i / CELLS) / (camera.responsivity * seconds[EXPOSURES - 1]);
      }
      for (int k = 0; k < EXPOSURES; k++) {
        expose(&bench, k, seconds[k], k == dead ? dark : truth, 1);
      }
      check_left(&bench, truth, dead == EXPOSURES - 1 ? .1 : .03);
    }
    close_bench(&bench);
  }
}

static void one_hot_pixel_does_not_spoil_its_cell(void **state) {
  (void)state;
  merge_bench bench = {0};
  open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, 1);
  static uint16_t samples[PIXELS];
  for (int p = 0; p < PIXELS; p++) {
    samples[p] = 1100;
  }
  samples[0] = 4095;
  clt_frame frame = {camera.width, camera.height, 1, camera.bits, samples, 0, seconds[0], 0};
  clt_merge_add(&bench.merge, 0, &frame);
  clt_merge_radiance(&bench.merge, &bench.radiance, &bench.deviation);
  double wanted = 1000.0 / 3995 / seconds[0] / camera.responsivity;
  assert_near(bench.radiance.data[0], wanted, 1e-6 * wanted);
  assert_near(bench.radiance.data[1], wanted, 1e-6 * wanted);
  /* one sample of nine is missing */
  assert_near(bench.deviation.data[0] / bench.deviation.data[1], sqrt(9.0 / 8), 1e-3);
  close_bench(&bench);
}

static void nothing_but_saturation_is_a_bound_of_infinite_deviation(void **state) {
  (void)state;
  merge_bench bench = {0};
  open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, EXPOSURES);
  double truth[CELLS];
  for (int i = 0; i < CELLS; i++) {
    truth[i] = 5 / (camera.responsivity * seconds[0]);
  }
  take_all(&bench, truth, 0);
  for (int i = 0; i < CELLS; i++) {
    assert_true(isinf(bench.deviation.data[i]));
    /* the shortest exposure proves that at least full scale came in its time */
    assert_near(bench.radiance.data[i], 1 / (camera.responsivity * seconds[0]), 1e-4);
  }
  close_bench(&bench);
}

static void a_cell_that_is_not_seen_has_infinite_deviation(void **state) {
  (void)state;
  merge_bench bench = {0};
  open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, 1);
  bench.footprints.start[1] = bench.footprints.start[0];
  double truth[CELLS] = {0};
  truth[1] = 0.5;
  take_all(&bench, truth, 0);
  assert_true(isinf(bench.deviation.data[0]));
  assert_near(bench.radiance.data[0], 0, 0);
  assert_true(isfinite(bench.deviation.data[1]));
  close_bench(&bench);
}

/* Mean of samples of a camera that rounds to steps and ends at 0, exactly: the sum over its values, each as probable as
 * normal noise about the mean makes it. */
static double rounded_mean(double mean, double noise, double step) {
  double sum = 0;
  for (int k = 1; step * k <= mean + 10 * noise + step; k++) {
    double low = (step * (k - 0.5) - mean) / noise, high = (step * (k + 0.5) - mean) / noise;
    sum += step * k * 0.5 * (erfc(low / sqrt(2)) - erfc(high / sqrt(2)));
  }
  return sum;
}

/* The bias is a bound at any light, noise, step and pedestal, the black level being what the camera itself shows of it;
 * and no idle one: it is reached to a third or more where noise is small, and vanishes where noise dithers far above 0.
 */
static void what_samples_share_is_within_the_bias(void **state) {
  (void)state;
  static const double noises[] = {0.02, 0.1, 0.2, 0.35, 0.6, 1.2}, steps[] = {1, 4, 12.8}, pedestals[] = {0, 2.3, 40};
  for (int n = 0; n < 6 * 3 * 3; n++) {
    double step = steps[n / 6 % 3], noise = noises[n % 6] * step, pedestal = pedestals[n / 18] * step, worst = 0;
    merge_bench bench = {0};
    clt_error error = {0};
    clt_camera_info coarse = camera;
    open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, 1);
    /* As the calibration finds it, which nothing below 0 disturbs. */
    coarse.black_level = rounded_mean(pedestal + 100 * step, noise, step) - 100 * step;
    double range = 4095 - coarse.black_level, t = 0.01;
    coarse.step = step;
    coarse.full_well = 1e12;
    coarse.read_noise = noise / range * coarse.full_well;
    clt_merge_finish(&bench.merge);
    assert_ok(clt_merge_init(&bench.merge, &coarse, &bench.curve, &bench.footprints, 1, &error), error);
    for (int k = 0; k <= 400; k++) {
      double light = 0.02 * step * k, raw = rounded_mean(pedestal + light, noise, step),
             h = (raw - coarse.black_level) / range;
      clt_merge_sum sum = {.light = (float)h, .count = 1, .raw = (float)raw};
      double off = fabs(h - light / range) / t, bias = clt_merge_bias(&bench.merge, &sum, t, h / t);
      assert_true(off <= bias * 1.001 + 1e-7 / t);
      worst = fmax(worst, off / bias);
      if (noises[n % 6] > 1 && pedestal > 30 * step) {
        assert_true(bias < 1e-9 * step / range / t);
      }
    }
    assert_true(noises[n % 6] > 0.2 || worst > 0.3);
    close_bench(&bench);
  }
}

/* One exposure of all cells by a camera of coarse steps, their lights a step's fractions apart by chance: how far means
 * are off, over what is reported, as an rms; and over what the samples' number alone would leave. */
static void measure_honesty(double noise_steps, double step, int draws, double *honest, double *alone) {
  merge_bench bench = {.random = 7};
  clt_error error = {0};
  clt_camera_info coarse = camera;
  double range = 4095 - camera.black_level, t = 0.01, sums[2] = {0, 0};
  coarse.step = step;
  coarse.full_well = 1e12; /* no photon noise */
  coarse.read_noise = noise_steps * step / range * coarse.full_well;
  open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, 1);
  clt_merge_finish(&bench.merge);
  assert_ok(clt_merge_init(&bench.merge, &coarse, &bench.curve, &bench.footprints, 1, &error), error);
  for (int n = 0; n < draws; n++) {
    uint16_t samples[PIXELS];
    double light[CELLS];
    for (int i = 0; i < CELLS; i++) {
      light[i] = step * (3 + 4 * test_random(&bench.random));
    }
    for (int p = 0; p < PIXELS; p++) {
      double v = light[p / camera.width / K * WIDTH + p % camera.width / K] / step;
      v += noise_steps * test_normal(&bench.random);
      samples[p] = (uint16_t)lrint(camera.black_level + step * rint(v));
    }
    clt_frame frame = {camera.width, camera.height, 1, camera.bits, samples, 0, t, 0};
    clt_merge_add(&bench.merge, 0, &frame);
    clt_merge_radiance(&bench.merge, &bench.radiance, &bench.deviation);
    for (int i = 0; i < CELLS; i++) {
      double off = (double)bench.radiance.data[i] - light[i] / range / t / camera.responsivity;
      double lone = (noise_steps * noise_steps + 1 / 12.0) * step * step / (K * K);
      sums[0] += off * off / pow((double)bench.deviation.data[i], 2) / (draws * CELLS);
      sums[1] += off * off * pow(range * t * camera.responsivity, 2) / lone / (draws * CELLS);
    }
  }
  *honest = sqrt(sums[0]);
  *alone = sqrt(sums[1]);
  close_bench(&bench);
}

/* From a camera without noise, all of whose samples round alike, to one whose noise dithers. 16000 values a case: an
 * rms is uncertain by .6 %, by 1.5 % where the samples' error is all shared. */
static void coarse_steps_are_in_the_deviation(void **state) {
  (void)state;
  static const double noises[] = {0, 0.03, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6, 1}, steps[] = {1, 13};
  for (int n = 0; n < 10 * 2; n++) {
    double honest = 0, alone = 0;
    measure_honesty(noises[n % 10], steps[n / 10], 500, &honest, &alone);
    printf("noise of %.2f steps of %g codes: off by %.3f deviations, by %.2f without what is shared\n", noises[n % 10],
           steps[n / 10], honest, alone);
    assert_near(honest, 1, 0.03);
    assert_true(noises[n % 10] > 0.15 || alone > 1.5);
    assert_true(noises[n % 10] < 0.6 || fabs(alone - 1) < 0.03);
  }
}

/* The deviation of a frame belongs to the time that it really had. */
static void a_real_exposure_time_counts(void **state) {
  (void)state;
  merge_bench bench = {0};
  open_bench(&bench, (clt_curve){.kind = CLT_CURVE_LINEAR}, 1);
  double truth[CELLS];
  for (int i = 0; i < CELLS; i++) {
    truth[i] = 10;
  }
  expose(&bench, 0, 1.008e-3, truth, 0);
  clt_merge_radiance(&bench.merge, &bench.radiance, &bench.deviation);
  assert_near(bench.radiance.data[3], 10, 0.004);
  close_bench(&bench);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(merged_noise_is_unbiased_and_as_large_as_reported),
      cmocka_unit_test(a_curved_response_keeps_both),
      cmocka_unit_test(eight_exposures_keep_both),
      cmocka_unit_test(clean_frames_give_the_closed_form),
      cmocka_unit_test(case_29_saturated_or_dead_exposure),
      cmocka_unit_test(one_hot_pixel_does_not_spoil_its_cell),
      cmocka_unit_test(nothing_but_saturation_is_a_bound_of_infinite_deviation),
      cmocka_unit_test(a_cell_that_is_not_seen_has_infinite_deviation),
      cmocka_unit_test(what_samples_share_is_within_the_bias),
      cmocka_unit_test(coarse_steps_are_in_the_deviation),
      cmocka_unit_test(a_real_exposure_time_counts),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
