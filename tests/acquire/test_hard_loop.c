/* Hard cases of a rig: a wrong black, a projector that moved, a loop that sees late. */
#include "counterlight/acquire.h"
#include "counterlight/loop.h"
#include "dihedral.h"
#include "fake_rig.h"

enum { WIDTH = 10, HEIGHT = 8, CELLS = WIDTH * HEIGHT };

/* A fake whose black is photographed too dark by `offset`, as by a projector that is not black at once. */
typedef struct biased_rig {
  fake_rig rig;
  float offset;
} biased_rig;

static clt_status biased_observe(clt_rig *base, const clt_image *drive, clt_image *radiance, clt_image *deviation,
                                 clt_error *error) {
  bool black = true;
  for (size_t i = 0; i < clt_image_size(drive); i++) {
    black = black && drive->data[i] == 0;
  }
  clt_status status = fake_observe(base, drive, radiance, deviation, error);
  for (size_t i = 0; i < clt_image_size(radiance) && !black; i++) {
    radiance->data[i] += ((biased_rig *)(void *)base)->offset;
  }
  return status;
}

/* ||T' x - T x|| / ||T x|| for an even drive, of an acquired T' against the room's, and of the room's with beta added
 * to every entry. */
static void appearance(const clt_transport *got, const double *room, double beta, double *ours, double *naive) {
  double x[CELLS], y[CELLS], off[2] = {0}, size = 0;
  for (int j = 0; j < CELLS; j++) {
    x[j] = .5 + .3 * sin(.7 * j);
  }
  clt_transport_apply(got, 0, x, y);
  for (int i = 0; i < CELLS; i++) {
    double exact = 0, shifted = 0;
    for (int j = 0; j < CELLS; j++) {
      exact += room[i * CELLS + j] * x[j];
      shifted += beta * x[j];
    }
    off[0] += (y[i] - exact) * (y[i] - exact);
    off[1] += shifted * shifted;
    size += exact * exact;
  }
  *ours = sqrt(off[0] / size);
  *naive = sqrt(off[1] / size);
}

/* An offset beta of every entry with N beta = .2 F, which the rows' sums, made those of the flood, take away. */
static void case_12_bias_in_every_entry(void **state) {
  (void)state;
  static const clt_rig_operations operations = {fake_describe, biased_observe, NULL};
  double *room = dihedral_transport(WIDTH, HEIGHT, .6);
  for (uint64_t seed = 1; seed <= 5; seed++) {
    double beta = .2 * .6 / CELLS, ours, naive;
    biased_rig rig = {.rig = fake_rig_make(WIDTH, HEIGHT, 1, room, 1), .offset = (float)beta};
    rig.rig.base.operations = &operations;
    rig.rig.dark = 1e-5;
    rig.rig.random = seed;
    clt_transport *got = NULL;
    clt_error error = {0};
    clt_acquire_options options = {.scheme = "brute", .seed = (unsigned)seed};
    assert_ok(clt_acquire(&rig.rig.base, &options, &got, &error), error);
    appearance(got, room, beta, &ours, &naive);
    print_message("bias: %.2f %% of the appearance without the flood, %.3f %% with it\n", 100 * naive, 100 * ours);
    assert_true(naive > .07 && ours < naive / 20);
    clt_transport_destroy(got);
  }
  free(room);
}

/* The dihedral as a dense transport, with noise of its entries where sigma > 0. */
static clt_transport *measured(const double *room, double sigma, uint64_t *random) {
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_dense(WIDTH, HEIGHT, 1, CELLS, &made, &error), error);
  assert_ok(clt_transport_keep_sigma(made, &error), error);
  for (int k = 0; k < CELLS * CELLS; k++) {
    clt_transport_entries(made, 0)[k] = (float)(room[k] + sigma * test_normal(random));
  }
  for (int i = 0; i < CELLS; i++) {
    clt_transport_sigma_values(made, 0)[i] = (float)sigma;
    clt_transport_black(made, 0)[i] = .01f;
  }
  return made;
}

static void fill_picture(clt_image *drive, uint64_t *random) {
  for (int j = 0; j < CELLS; j++) {
    drive->data[j] = (float)(.2 + .6 * test_random(random));
  }
}

/* The photograph of `drive` by a projector that has moved by `shift` cells to the right. */
static void photograph(const double *room, const clt_image *drive, int shift, double noise, uint64_t *random,
                       clt_image *seen, clt_image *deviation) {
  for (int i = 0; i < CELLS; i++) {
    double light = .01;
    for (int j = 0; j < CELLS; j++) {
      int from = j % WIDTH - shift;
      light += from >= 0 && from < WIDTH ? room[i * CELLS + j] * (double)drive->data[j - shift] : 0;
    }
    seen->data[i] = (float)(light + noise * test_normal(random));
    deviation->data[i] = (float)noise;
  }
}

/* The error's expected value, recomputed: sigma_c^2 + sigma_T^2 ||x||^2 in every cell. */
static double expected_noise(const double *room, const clt_image *drive, double sigma, double noise) {
  double driven = 0, size = 0;
  for (int j = 0; j < CELLS; j++) {
    driven += (double)drive->data[j] * drive->data[j];
  }
  for (int i = 0; i < CELLS; i++) {
    double light = 0;
    for (int j = 0; j < CELLS; j++) {
      light += room[i * CELLS + j] * (double)drive->data[j];
    }
    size += light * light;
  }
  return sqrt(CELLS * (noise * noise + sigma * sigma * driven) / size);
}

static void case_24_projector_moved_by_one_pixel(void **state) {
  (void)state;
  double *room = dihedral_transport(WIDTH, HEIGHT, .6);
  clt_image drive = {0}, seen = {0}, deviation = {0};
  clt_error error = {0};
  assert_ok(clt_image_init(&drive, 1, HEIGHT, WIDTH, &error), error);
  assert_ok(clt_image_init(&seen, 1, HEIGHT, WIDTH, &error), error);
  assert_ok(clt_image_init(&deviation, 1, HEIGHT, WIDTH, &error), error);
  double calm = 0, moved = INFINITY;
  for (uint64_t seed = 1; seed <= 200; seed++) {
    uint64_t random = seed;
    double sigma = seed % 2 ? 0 : 1e-4, noise = pow(10, -4 + 2.5 * test_random(&random));
    clt_transport *transport = measured(room, sigma, &random);
    clt_certificate *certificate = NULL;
    clt_fit fit;
    assert_ok(clt_certify(transport, &certificate, &error), error);
    fill_picture(&drive, &random);
    photograph(room, &drive, 0, noise, &random, &seen, &deviation);
    assert_ok(clt_loop_check(transport, certificate, &drive, &seen, &deviation, &fit, &error), error);
    double wanted = expected_noise(room, &drive, sigma, noise);
    assert_near(fit.noise, wanted, .05 * wanted);
    assert_true(fit.fits);
    calm = fmax(calm, fit.off / fit.limit);
    photograph(room, &drive, 1, noise, &random, &seen, &deviation);
    assert_ok(clt_loop_check(transport, certificate, &drive, &seen, &deviation, &fit, &error), error);
    assert_false(fit.fits);
    moved = fmin(moved, fit.off / fit.limit);
    clt_certificate_destroy(certificate);
    clt_transport_destroy(transport);
  }
  print_message("residual over limit: at most %.2f in place, at least %.1f moved\n", calm, moved);
  clt_image_finish(&drive);
  clt_image_finish(&seen);
  clt_image_finish(&deviation);
  free(room);
}

/* A panel of 8 bits and a camera of little noise: the drive that was asked for is a misfit by the panel's rounding
 * alone, the one that was shown fits. */
static void a_rounded_drive_is_no_misfit(void **state) {
  (void)state;
  double *room = dihedral_transport(WIDTH, HEIGHT, .6);
  const clt_curve curve = {.kind = CLT_CURVE_GAMMA, .gamma = 2.2};
  const clt_panel panel = clt_panel_of_curve(&curve);
  clt_image drive = {0}, seen = {0}, deviation = {0};
  clt_error error = {0};
  assert_ok(clt_image_init(&drive, 1, HEIGHT, WIDTH, &error), error);
  assert_ok(clt_image_init(&seen, 1, HEIGHT, WIDTH, &error), error);
  assert_ok(clt_image_init(&deviation, 1, HEIGHT, WIDTH, &error), error);
  int misfits = 0;
  for (uint64_t seed = 1; seed <= 100; seed++) {
    uint64_t random = seed;
    clt_transport *transport = measured(room, 0, &random);
    clt_certificate *certificate = NULL;
    clt_image shown = {0};
    clt_fit fit;
    assert_ok(clt_certify(transport, &certificate, &error), error);
    fill_picture(&drive, &random);
    assert_ok(clt_panel_shown(&panel, 8, &drive, &shown, &error), error);
    photograph(room, &shown, 0, 2e-4, &random, &seen, &deviation);
    assert_ok(clt_loop_check(transport, certificate, &drive, &seen, &deviation, &fit, &error), error);
    misfits += !fit.fits;
    assert_ok(clt_loop_check(transport, certificate, &shown, &seen, &deviation, &fit, &error), error);
    assert_true(fit.fits);
    photograph(room, &shown, 1, 2e-4, &random, &seen, &deviation);
    assert_ok(clt_loop_check(transport, certificate, &shown, &seen, &deviation, &fit, &error), error);
    assert_false(fit.fits);
    clt_image_finish(&shown);
    clt_certificate_destroy(certificate);
    clt_transport_destroy(transport);
  }
  print_message("the drive as it was asked for is a misfit in %d of 100\n", misfits);
  assert_true(misfits > 90);
  clt_image_finish(&drive);
  clt_image_finish(&seen);
  clt_image_finish(&deviation);
  free(room);
}

/* The growth of a small deviation, per step, of a loop whose room is `bright` times as bright as its T says: omega
 * sigma is gain * bright where T^-1 corrects, whatever the albedo. */
static double growth(const clt_transport *transport, const clt_certificate *certificate, clt_loop_options options,
                     double bright, const double *direction, uint64_t seed) {
  enum { STEPS = 160, HALF = STEPS / 2 };
  clt_loop *loop = NULL;
  clt_error error = {0};
  assert_ok(clt_loop_create(transport, certificate, &options, &loop, &error), error);
  static double drive[(STEPS + 1) * CELLS];
  double wanted[CELLS], seen[CELLS], even[CELLS], early = 0, late = 0;
  for (int j = 0; j < CELLS; j++) {
    even[j] = .5;
    drive[j] = .5 + 1e-7 * (direction != NULL ? direction[j] : test_random(&seed) - .5);
  }
  clt_transport_apply(transport, 0, even, wanted);
  for (int k = 0; k < STEPS; k++) {
    const double *shown = drive + (k < options.delay ? 0 : k - options.delay) * CELLS;
    double *next = drive + (k + 1) * CELLS, size = 0;
    clt_transport_apply(transport, 0, shown, seen);
    for (int j = 0; j < CELLS; j++) {
      seen[j] = wanted[j] + bright * (seen[j] - wanted[j]);
      next[j] = drive[k * CELLS + j];
    }
    assert_ok(clt_loop_step(loop, wanted, seen, next, &error), error);
    for (int j = 0; j < CELLS; j++) {
      size += (next[j] - .5) * (next[j] - .5);
    }
    early += k < HALF ? size : 0;
    late += k < HALF ? 0 : size;
  }
  clt_loop_destroy(loop);
  return late / early;
}

/* The least brightness at which the loop no longer settles, by bisection, times its gain. */
static double measured_limit(const clt_transport *transport, const clt_certificate *certificate,
                             clt_loop_options options, double low, double high, const double *direction,
                             uint64_t seed) {
  for (int step = 0; step < 7; step++) {
    double middle = sqrt(low * high);
    if (growth(transport, certificate, options, middle, direction, seed) < 1) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return options.gain * sqrt(low * high);
}

/* The eigenvector of T / albedo = F^-1 T of the greatest eigenvalue, by power steps; returns that eigenvalue. */
static double brightest(const double *room, const double *first, double *x) {
  double y[CELLS], value = 0;
  for (int j = 0; j < CELLS; j++) {
    x[j] = 1;
  }
  for (int step = 0; step < 200; step++) {
    value = 0;
    for (int i = 0; i < CELLS; i++) {
      y[i] = 0;
      for (int j = 0; j < CELLS; j++) {
        y[i] += room[i * CELLS + j] * x[j] / first[i];
      }
      value = fmax(value, y[i]);
    }
    for (int i = 0; i < CELLS; i++) {
      x[i] = y[i] / value;
    }
  }
  return value;
}

static void case_27_loop_delay(void **state) {
  (void)state;
  const double law[] = {2, 1, .6180339887, .4450418679, .3472963553};
  for (int delay = 0; delay <= 4; delay++) {
    assert_near(clt_loop_limit(delay), law[delay], 1e-9);
    for (uint64_t seed = 1; seed <= 3; seed++) {
      double albedo = .3 + .2 * (double)seed, x[CELLS];
      double *room = dihedral_transport(WIDTH, HEIGHT, albedo);
      clt_transport *transport = measured(room, 0, &(uint64_t){seed});
      clt_certificate *certificate = NULL;
      clt_error error = {0};
      assert_ok(clt_certify(transport, &certificate, &error), error);
      double sigma = brightest(room, clt_certificate_first_bounce(certificate, 0), x);
      clt_loop_options plain = {.delay = delay, .gain = .4 * law[delay] / sigma};
      double limit = measured_limit(transport, certificate, plain, 1.2, 5, x, seed) * sigma;
      assert_near(limit / law[delay], 1, .05);
      /* T^-1 makes sigma 1 at every albedo; with the predictor there is no delay to be stable against */
      clt_loop_options inverse = {.delay = delay, .gain = .4 * law[delay], .inverse = true, .tolerance = 1e-3};
      double free_of_albedo = measured_limit(transport, certificate, inverse, 1.2, 5, NULL, seed);
      assert_near(free_of_albedo / law[delay], 1, .05);
      clt_loop_options smith = {.delay = delay, .gain = 1.9, .inverse = true, .predict = true, .tolerance = 1e-4};
      assert_true(growth(transport, certificate, smith, 1, NULL, seed) < 1e-3);
      if (seed == 1) {
        print_message("delay %d: settles below %.3f (F^-1), %.3f (T^-1); 2 cos(d pi / (2d + 1)) = %.3f\n", delay, limit,
                      free_of_albedo, law[delay]);
      }
      clt_certificate_destroy(certificate);
      clt_transport_destroy(transport);
      free(room);
    }
  }
}

static void a_gain_that_does_not_settle_is_refused(void **state) {
  (void)state;
  double *room = dihedral_transport(WIDTH, HEIGHT, .5);
  clt_transport *transport = measured(room, 0, &(uint64_t){1});
  clt_certificate *certificate = NULL;
  clt_loop *loop = NULL;
  clt_error error = {0};
  assert_ok(clt_certify(transport, &certificate, &error), error);
  const clt_loop_options bad[] = {{.gain = 1.01, .delay = 1, .inverse = true},
                                  {.gain = 1, .delay = 1},
                                  {.gain = -1},
                                  {.gain = NAN},
                                  {.delay = -1},
                                  {.delay = CLT_LOOP_DELAY_MAX + 1}};
  const char *phrases[] = {"below 1", "does not settle", "above 0", "does not settle", "delay of -1", "0..32"};
  for (int k = 0; k < 6; k++) {
    assert_int_equal(clt_loop_create(transport, certificate, &bad[k], &loop, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, phrases[k]));
  }
  assert_ok(clt_loop_create(transport, certificate, NULL, &loop, &error), error);
  clt_loop_info info = clt_loop_describe(loop);
  assert_near(info.limit, 2 / (1 + clt_certificate_channel(certificate, 0)->radius_high), 1e-12);
  assert_near(info.gain, info.limit / 2, 1e-12);
  clt_loop_destroy(loop);
  clt_certificate_destroy(certificate);
  clt_transport_destroy(transport);
  free(room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(case_12_bias_in_every_entry),
      cmocka_unit_test(a_rounded_drive_is_no_misfit),
      cmocka_unit_test(case_24_projector_moved_by_one_pixel),
      cmocka_unit_test(case_27_loop_delay),
      cmocka_unit_test(a_gain_that_does_not_settle_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
