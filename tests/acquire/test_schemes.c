/* Hadamard, blocks and optical solving on dihedrals whose T is known (point-to-point form factors, LAPACK). */
#include "counterlight/acquire.h"
#include "dihedral.h"
#include "fake_rig.h"

enum { WIDTH = 32, HEIGHT = 24, CELLS = WIDTH * HEIGHT };

static clt_transport *acquire(fake_rig *rig, const clt_acquire_options *options) {
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_ok(clt_acquire(&rig->base, options, &transport, &error), error);
  return transport;
}

/* Pictures: 0 random, 1 half, 2 fields of 8 cells, 3 a smooth slope. */
enum { PICTURES = 4 };
static double picture_value(int picture, int width, size_t j, uint64_t *state) {
  const size_t x = j % (size_t)width, y = j / (size_t)width;
  const double values[PICTURES] = {test_random(state), x < (size_t)width / 2, (double)((x / 8 + y / 8) % 2),
                                   (double)x / width};
  return values[picture];
}

static void multiply(const double *transport, int cells, const double *x, double *y) {
  for (int i = 0; i < cells; i++) {
    y[i] = 0;
    for (int j = 0; j < cells; j++) {
      y[i] += transport[(size_t)i * (size_t)cells + (size_t)j] * x[j];
    }
  }
}

static double distance(const double *a, const double *b, int count) {
  double apart = 0, size = 0;
  for (int i = 0; i < count; i++) {
    apart += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return sqrt(apart / size);
}

/* The worst of the pictures: ||(T~ - T) x|| / ||T x|| of channel 0, in double. */
static double worst_error(const clt_transport *transport, const double *exact, int width, int cells) {
  double *x = calloc(3 * (size_t)cells, sizeof *x), *y = x + cells, *wanted = y + cells, worst = 0;
  uint64_t state = 11;
  for (int picture = 0; picture < PICTURES; picture++) {
    for (int j = 0; j < cells; j++) {
      x[j] = picture_value(picture, width, (size_t)j, &state);
    }
    clt_transport_apply(transport, 0, x, y);
    multiply(exact, cells, x, wanted);
    worst = fmax(worst, distance(y, wanted, cells));
  }
  free(x);
  return worst;
}

static void hadamard_without_noise_is_exact(void **state) {
  (void)state;
  double *exact = dihedral_transport(16, 12, 0.8);
  fake_rig rig = fake_rig_make(16, 12, 2, exact, 1);
  clt_transport *transport = acquire(&rig, &(clt_acquire_options){.scheme = "hadamard", .repeats = 1});
  assert_int_equal(clt_transport_origin(transport)->patterns, 2 + 255);
  for (int c = 0; c < 2; c++) {
    const float *entries = clt_transport_entries(transport, c);
    for (size_t at = 0; at < 192 * 192; at++) {
      assert_near(entries[at], exact[at], 2e-6);
    }
  }
  clt_transport_destroy(transport);
  free(exact);
}

/* The rms of what noise did to the entries, the flood correction aside; *sigma: what the transport says it is. */
static double entry_noise(const char *scheme, const double *exact, int cells, double dark, double photon,
                          double *sigma) {
  fake_rig rig = fake_rig_make(16, cells / 16, 1, exact, 1);
  rig.dark = dark;
  rig.photon = photon;
  rig.random = 77;
  clt_transport *transport = acquire(&rig, &(clt_acquire_options){.scheme = scheme, .repeats = 256});
  const float *entries = clt_transport_entries(transport, 0);
  double square = 0, expected = 0;
  for (int at = 0; at < cells * cells; at++) {
    square += (entries[at] - exact[at]) * (entries[at] - exact[at]);
    double row = (double)clt_transport_sigma(transport, 0)[at / cells];
    expected += row * row;
  }
  clt_transport_destroy(transport);
  *sigma = sqrt(expected / (cells * cells));
  return sqrt(square / (cells * cells));
}

/* Harwit and Sloane 1979: 2 sqrt(n) / (n + 1) of the noise of single cells, as far as it does not grow with light. */
static void hadamard_gains_what_theory_says(void **state) {
  (void)state;
  enum { SIDE = 16, ALL = SIDE * 15, ORDER = 256 };
  double *exact = dihedral_transport(SIDE, ALL / SIDE, 0.5), sigma;
  const double single = entry_noise("brute", exact, ALL, 1e-3, 0, &sigma);
  const double multiplexed = entry_noise("hadamard", exact, ALL, 1e-3, 0, &sigma);
  print_message("noise of entries: %.3g single, %.3g multiplexed, sigma %.3g\n", single, multiplexed, sigma);
  assert_near(multiplexed / single, 2 * sqrt(ORDER - 1) / ORDER, 0.03 * 2 * sqrt(ORDER - 1) / ORDER);
  assert_near(sigma / multiplexed, 1, 0.03);
  /* Photons: every photograph of half the cells has half the flood's. var = 4 / (n + 1)^2 n photon (b0 + flood / 2) */
  double light = 0;
  for (size_t at = 0; at < ALL * ALL; at++) {
    light += exact[at] / ALL;
  }
  const double photons = entry_noise("hadamard", exact, ALL, 0, 1e-4, &sigma);
  const double wanted = 2 * sqrt((ORDER - 1) * 1e-4 * (0.01 + light * ORDER / 2 / (ORDER - 1))) / ORDER;
  print_message("of photons: %.4g, expected %.4g\n", photons, wanted);
  assert_near(photons / wanted, 1, 0.03);
  free(exact);
}

static void hadamard_refuses_large_grids(void **state) {
  (void)state;
  static const double nothing[1];
  fake_rig rig = fake_rig_make(1, 1, 1, nothing, 1);
  rig.width = 4097;
  rig.fails_with = CLT_FAILED;
  rig.fails_at = 1000;
  clt_transport *transport = NULL;
  clt_error error = {0};
  rig.transport = calloc(4097 * 4097, sizeof *rig.transport);
  assert_int_equal(
      clt_acquire(&rig.base, &(clt_acquire_options){.scheme = "hadamard", .repeats = 1}, &transport, &error),
      CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "up to 4096 cells"));
  free((void *)(uintptr_t)rig.transport);
}

/* Fewer patterns than the hierarchical scheme takes, with the noise of a good camera: .5 % of a fully lit cell. */
static void blocks_reach_the_wanted_error(void **state) {
  (void)state;
  static const struct {
    double wanted, albedo;
    int most;
  } cases[] = {{0.02, 0.5, 40}, {0.02, 0.8, 60}, {0.01, 0.8, 140}};
  for (int n = 0; n < 3; n++) {
    double *exact = dihedral_transport(WIDTH, HEIGHT, cases[n].albedo);
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
    rig.dark = 1e-5;
    rig.photon = 1e-5;
    clt_acquire_options options = {.scheme = "blocks", .error = cases[n].wanted, .checks = 2};
    clt_transport *transport = acquire(&rig, &options);
    const double worst = worst_error(transport, exact, WIDTH, CELLS);
    const clt_provenance *origin = clt_transport_origin(transport);
    print_message("wanted %.3g: %d patterns, worst picture %.3f %%, check %.3f %%\n", cases[n].wanted, origin->patterns,
                  100 * worst, 100 * origin->error);
    assert_string_equal(clt_transport_describe(transport).storage, "blocks");
    assert_true(worst <= cases[n].wanted);
    assert_true(origin->error <= cases[n].wanted);
    assert_true(origin->patterns <= cases[n].most);
    clt_transport_destroy(transport);
    free(exact);
  }
}

/* A cell that the camera never sees, cells without light, and a grid of one line. */
static void blocks_bear_odd_rooms(void **state) {
  (void)state;
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.5);
  for (size_t k = 0; k < CELLS; k++) {
    for (size_t dark = 100; dark < 105; dark++) {
      exact[dark * CELLS + k] = exact[k * CELLS + dark] = 0;
    }
  }
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  rig.dark = 1e-4;
  rig.blind = 40;
  clt_transport *transport = acquire(&rig, &(clt_acquire_options){.scheme = "blocks", .error = 0.02});
  double *x = calloc(2 * CELLS, sizeof *x);
  for (int dark = 100; dark < 105; dark++) {
    x[dark] = 1;
  }
  clt_transport_apply(transport, 0, x, x + CELLS);
  for (int i = 0; i < CELLS; i++) {
    assert_true(fabs(x[CELLS + i]) < 5e-3);
  }
  assert_true(isinf(clt_transport_sigma(transport, 0)[40]) && isfinite(clt_transport_sigma(transport, 0)[41]));
  clt_transport_destroy(transport);
  rig = fake_rig_make(WIDTH * 8, 1, 1, exact, 1);
  rig.dark = 1e-4;
  double *line = dihedral_first_bounce(WIDTH * 8, 1, 0.5);
  rig.transport = line;
  transport = acquire(&rig, &(clt_acquire_options){.scheme = "blocks", .error = 0.02});
  const double worst = worst_error(transport, line, WIDTH * 8, WIDTH * 8);
  print_message("a line: %d patterns, %.3f %%\n", clt_transport_origin(transport)->patterns, 100 * worst);
  assert_true(worst < 0.03); /* where to stop is estimated from one picture: half as much again is borne */
  clt_transport_destroy(transport);
  free(line);
  free(x);
  free(exact);
}

/* y - target of a drive, relative, in double. */
static double compensated_error(const double *exact, double black, const clt_image *target, const clt_image *drive) {
  double *x = calloc(3 * CELLS, sizeof *x);
  for (int j = 0; j < CELLS; j++) {
    x[j] = (double)drive->data[j];
    x[2 * CELLS + j] = (double)target->data[j];
  }
  multiply(exact, CELLS, x, x + CELLS);
  for (int j = 0; j < CELLS; j++) {
    x[CELLS + j] += black;
  }
  double apart = distance(x + CELLS, x + 2 * CELLS, CELLS);
  free(x);
  return apart;
}

static void optical_solving_needs_few_photographs(void **state) {
  (void)state;
  for (int picture = 1; picture < PICTURES; picture++) {
    double *exact = dihedral_transport(WIDTH, HEIGHT, 0.8);
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
    rig.dark = 1e-5;
    rig.photon = 1e-5;
    clt_image target = {0}, drive = {0};
    clt_error error = {0};
    uint64_t random = 5;
    assert_ok(clt_image_init(&target, 1, HEIGHT, WIDTH, &error), error);
    for (size_t j = 0; j < CELLS; j++) {
      target.data[j] = (float)(0.3 + 0.3 * picture_value(picture, WIDTH, j, &random));
    }
    clt_optical_options options = {.tolerance = 0.01, .white = {.kind = CLT_WHITE_VALUE, .value = 1}};
    clt_optical_result result;
    assert_ok(clt_optical_compensate(&rig.base, &target, &options, &drive, &result, &error), error);
    const double after = compensated_error(exact, 0.01, &target, &drive);
    print_message("picture %d: %d photographs, %.3f %% off, said %.3f %%, before %.1f %%: %s\n", picture,
                  result.photographs, 100 * after, 100 * result.error_after, 100 * result.error_before, result.reason);
    assert_true(result.converged && result.photographs == rig.patterns && result.photographs <= 15);
    assert_true(after < 0.012);
    assert_near(result.error_after, after, 0.003);
    assert_true(result.error_before > 3 * after);
    clt_image_finish(&target);
    clt_image_finish(&drive);
    free(exact);
  }
}

/* Where a cell cannot follow, the answer comes close to the least squares of the "bounded" solver on the true T. */
static void optical_solving_keeps_the_bounds(void **state) {
  (void)state;
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.8);
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  clt_transport *transport = NULL;
  clt_certificate *certificate = NULL;
  clt_image target = {0}, drive = {0}, best = {0};
  clt_error error = {0};
  assert_ok(clt_transport_create_dense(WIDTH, HEIGHT, 1, CELLS, &transport, &error), error);
  for (size_t at = 0; at < (size_t)CELLS * CELLS; at++) {
    clt_transport_entries(transport, 0)[at] = (float)exact[at];
  }
  for (size_t i = 0; i < CELLS; i++) {
    clt_transport_black(transport, 0)[i] = 0.01f;
  }
  assert_ok(clt_image_init(&target, 1, HEIGHT, WIDTH, &error), error);
  for (size_t j = 0; j < CELLS; j++) {
    target.data[j] = (j / 4 + j / WIDTH / 4) % 2 ? 0.9f : 0.0f; /* black that the other wall lights */
  }
  const clt_white white = {.kind = CLT_WHITE_VALUE, .value = 1};
  clt_compensation found;
  assert_ok(clt_certify(transport, &certificate, &error), error);
  assert_ok(clt_compensate(transport, certificate, &target, &white, &(clt_solve_options){.method = "bounded"}, true,
                           &best, &found, &error),
            error);
  clt_optical_result result;
  assert_ok(clt_optical_compensate(&rig.base, &target, &(clt_optical_options){.white = white}, &drive, &result, &error),
            error);
  const double after = compensated_error(exact, 0.01, &target, &drive);
  print_message("bounds: %.3f %% off after %d photographs, limit %.3f %%\n", 100 * after, result.photographs,
                100 * found.error_limit);
  assert_true(result.clipped_fraction > 0.1 && result.photographs <= 40);
  assert_true(after >= found.error_limit - 1e-6 && after <= 1.1 * found.error_limit);
  clt_image_finish(&target);
  clt_image_finish(&drive);
  clt_image_finish(&best);
  clt_certificate_destroy(certificate);
  clt_transport_destroy(transport);
  free(exact);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(hadamard_without_noise_is_exact),
      cmocka_unit_test(hadamard_gains_what_theory_says),
      cmocka_unit_test(hadamard_refuses_large_grids),
      cmocka_unit_test(blocks_reach_the_wanted_error),
      cmocka_unit_test(blocks_bear_odd_rooms),
      cmocka_unit_test(optical_solving_needs_few_photographs),
      cmocka_unit_test(optical_solving_keeps_the_bounds),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
