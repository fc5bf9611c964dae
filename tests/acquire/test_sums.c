/* Sums of patterns: one photograph tells whether any of those that it stands for was disturbed. */
#include "counterlight/acquire.h"

#include "acquire/group.h"
#include "dihedral.h"
#include "fake_rig.h"

enum { WIDTH = 16, HEIGHT = 12, CELLS = WIDTH * HEIGHT, SEEDS = 20 };
static const char *const schemes[] = {"brute", "hadamard", "hierarchical", "blocks"};
enum { SCHEMES = sizeof schemes / sizeof schemes[0] };

/* A rig in a corner with the noise of a camera. */
static fake_rig make_rig(const double *exact, uint64_t seed) {
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  rig.dark = 2e-4;
  rig.photon = 1e-6;
  rig.random = seed;
  return rig;
}

/* ||T - exact|| / ||exact||, in double. */
static double transport_error(const clt_transport *transport, const double *exact) {
  double x[CELLS] = {0}, y[CELLS], off = 0, whole = 0;
  for (int j = 0; j < CELLS; j++) {
    x[j] = 1;
    clt_transport_apply(transport, 0, x, y);
    x[j] = 0;
    for (int i = 0; i < CELLS; i++) {
      double entry = exact[i * CELLS + j];
      off += (y[i] - entry) * (y[i] - entry);
      whole += entry * entry;
    }
  }
  return sqrt(off / whole);
}

static double acquire_error(fake_rig *rig, const clt_acquire_options *options, int *patterns) {
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_ok(clt_acquire(&rig->base, options, &transport, &error), error);
  *patterns = clt_transport_origin(transport)->patterns;
  double off = transport_error(transport, rig->transport);
  clt_transport_destroy(transport);
  return off;
}

/* One photograph out of all, wherever it is, is dark by half on the left. */
static void one_disturbed_photograph_is_found(void **state) {
  (void)state;
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  for (int n = 0; n < SCHEMES; n++) {
    double clean = 0, worst = 0, blind = 0;
    int plain = 0, patterns = 0, unseen = 0;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
      uint64_t random = 77 * seed;
      fake_rig rig = make_rig(exact, seed);
      clt_acquire_options options = {.scheme = schemes[n], .error = 0.005, .watch = -1};
      clean = acquire_error(&rig, &options, &plain);
      rig = make_rig(exact, seed);
      rig.shaded_at = 17 + (long)((plain - 17) * test_random(&random));
      rig.shade = 0.5;
      worst = fmax(worst, acquire_error(&rig, &options, &patterns) / clean);
      rig.patterns = 0;
      options.watch = 0;
      double without = acquire_error(&rig, &options, &patterns) / clean;
      blind = fmax(blind, without);
      unseen += without > 1.5;
    }
    printf("%-12s T off by %.2f %%; one photograph disturbed: at most %.2f times that; without looks %.2f (%d of %d)\n",
           schemes[n], 100 * clean, worst, blind, unseen, SEEDS);
    assert_true(worst <= 1.5);
    assert_true(unseen > 0 && blind > 2);
  }
  free(exact);
}

/* The weights of the schemes' patterns: 16 of a Walsh-Hadamard matrix are one of zeros and ones, and not before; others
 * by what they have in common. The sum's light is what its drive shows. */
static void sums_are_drives(void **state) {
  (void)state;
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  clt_image drive = {0}, seen = {0}, deviation = {0}, black = {0};
  clt_image *const images[] = {&drive, &seen, &deviation, &black};
  clt_error error = {0};
  clt_group group;
  assert_ok(clt_group_init(&group, 1, HEIGHT, WIDTH, &error), error);
  for (int k = 0; k < 4; k++) {
    assert_ok(clt_image_init(images[k], 1, HEIGHT, WIDTH, &error), error);
  }
  assert_ok(rig.base.operations->observe(&rig.base, &drive, &black, &deviation, &error), error);
  for (unsigned i = 1; i < 256; i++) {
    for (unsigned j = 0; j < CELLS; j++) {
      drive.data[j] = (float)__builtin_parity(i & (j + 1));
    }
    assert_ok(rig.base.operations->observe(&rig.base, &drive, &seen, &deviation, &error), error);
    if (i % 16 == 0) {
      assert_true(clt_group_is_drive(&group));
      clt_group_clear(&group);
    }
    assert_true(group.count == 0 || !clt_group_is_drive(&group));
    unsigned both = (i & (i >> 1) & 1) + ((i >> 2) & (i >> 3) & 1);
    clt_group_add(&group, both == 1 ? -0.25 : 0.25, &drive, &seen, &deviation, &black);
  }
  assert_ok(rig.base.operations->observe(&rig.base, &group.drive, &seen, &deviation, &error), error);
  clt_group_expect(&group, &black, &deviation, 0);
  for (unsigned j = 0; j < CELLS; j++) {
    assert_near(group.light.data[j], seen.data[j], 1e-5);
  }
  clt_group_finish(&group);
  for (int k = 0; k < 4; k++) {
    clt_image_finish(images[k]);
  }
  free(exact);
}

static void drives_fit_apart_or_within(void **state) {
  (void)state;
  static const struct {
    float drive[4];
    double fit;
  } next[] = {{{1, 1, 0, 0}, 1}, {{0, 1, 1, 0}, 0},  {{0, 1, 0, 0}, -1},
              {{0, 1, 1, 1}, 1}, {{1, 1, 1, 1}, -1}, {{0}, 1}};
  clt_image drive = {0}, light = {0}, noise = {0};
  clt_error error = {0};
  clt_group group;
  double sum = 0, squares = 0;
  assert_ok(clt_group_init(&group, 1, 1, 4, &error), error);
  assert_ok(clt_image_init(&drive, 1, 1, 4, &error), error);
  assert_ok(clt_image_init(&light, 1, 1, 4, &error), error);
  assert_ok(clt_image_init(&noise, 1, 1, 4, &error), error);
  for (size_t n = 0; n < sizeof next / sizeof next[0]; n++) {
    memcpy(drive.data, next[n].drive, sizeof next[n].drive);
    double fit = clt_group_fit(&group, &drive);
    assert_true(fit == next[n].fit);
    for (int k = 0; k < 4; k++) {
      light.data[k] = (float)(2 + n);
      noise.data[k] = 0.5F;
    }
    if (fit != 0) {
      clt_image black = noise; /* 0.5 too */
      clt_group_add(&group, fit, &drive, &light, &noise, &black);
      sum += fit * (1.5 + (double)n);
      squares += 0.25;
      assert_true(clt_group_is_drive(&group));
    }
    assert_near(group.light.data[2], sum, 1e-6);
    assert_near(group.variance.data[2], squares, 1e-6);
  }
  clt_group_finish(&group);
  clt_image_finish(&drive);
  clt_image_finish(&light);
  clt_image_finish(&noise);
}

/* A camera that is not in proportion to light is told from a room that is disturbed: T is measured, and says so. */
static void a_crooked_camera_is_not_a_disturbance(void **state) {
  (void)state;
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  fake_rig rig = make_rig(exact, 3);
  int plain = 0;
  acquire_error(&rig, &(clt_acquire_options){.scheme = "brute", .watch = -1}, &plain);
  rig = make_rig(exact, 3);
  rig.bend = 0.1;
  clt_transport *transport = NULL;
  clt_error error = {0};
  const clt_acquire_options options = {.scheme = "brute", .watch = -1};
  assert_ok(clt_acquire(&rig.base, &options, &transport, &error), error);
  const clt_provenance *origin = clt_transport_origin(transport);
  printf("%s (%d patterns, %d in proportion)\n", origin->plan, origin->patterns, plain);
  assert_non_null(strstr(origin->plan, "did not add up"));
  assert_true(origin->patterns < 3 * plain);
  clt_transport_destroy(transport);
  free(exact);
}

static bool stop_there(void *context, const clt_progress *progress) {
  (void)progress;
  return --*(long *)context != 0;
}

/* A random picture comes before black and white, at most eight times each; six patterns confirm them, and a sum and
 * white tell at once how bright the lamp is; sums that begin elsewhere may then be one more. */
enum { FIRST = 17, CONFIRM = 6, LOOK = 4 };

/* Wherever it is broken off, within sums too, what is looked at and T are the same; without noise, which would be
 * another. */
static void what_is_resumed_looks_as_it_would_have(void **state) {
  (void)state;
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  char folder[64], path[96];
  clt_error error = {0};
  test_folder(folder);
  snprintf(path, sizeof path, "%s/journal", folder);
  for (uint64_t run = 0; run < 3 * SCHEMES; run++) {
    uint64_t random = 900 + run;
    fake_rig rig = make_rig(exact, run);
    rig.dark = rig.photon = 0;
    fake_rig other = rig;
    int whole = 0, parts = 0;
    clt_acquire_options options = {.scheme = schemes[run % SCHEMES], .error = 0.005, .watch = -1};
    double wanted = acquire_error(&rig, &options, &whole);
    long until = FIRST + 1 + (long)((whole - FIRST - 1) * test_random(&random));
    options.journal = path;
    options.progress = stop_there;
    options.context = &until;
    clt_transport *transport = NULL;
    assert_int_equal(clt_acquire(&other.base, &options, &transport, &error), CLT_CANCELLED);
    options.progress = NULL;
    assert_true(fabs(acquire_error(&other, &options, &parts) - wanted) < 1e-6);
    assert_in_range(parts, whole + 1 + CONFIRM, whole + 1 + CONFIRM + LOOK);
    assert_int_equal(other.patterns, parts);
    unlink(path);
  }
  rmdir(folder);
  free(exact);
}

/* Every cell gives light to itself only. */
typedef struct mirror_rig {
  clt_rig base;
  clt_rig_info info;
  long disturbed_at;
} mirror_rig;

static void mirror_describe(const clt_rig *base, clt_rig_info *info) {
  *info = ((const mirror_rig *)base)->info;
}

static clt_status mirror_observe(clt_rig *base, const clt_image *drive, clt_image *radiance, clt_image *deviation,
                                 clt_error *error) {
  (void)error;
  mirror_rig *rig = (mirror_rig *)base;
  rig->info.patterns++;
  for (size_t i = 0; i < clt_image_size(drive); i++) {
    bool shaded = labs(rig->info.patterns - rig->disturbed_at) < 3 && i % 512 < 100;
    radiance->data[i] = 0.01F + drive->data[i] * (shaded ? 0.5F : 1);
    deviation->data[i] = 1e-4F;
  }
  return CLT_OK;
}

/* Where so much light is not kept that what was disturbed could be measured again, it is an error. */
static void a_large_grid_is_looked_at_too(void **state) {
  (void)state;
  static const clt_rig_operations operations = {mirror_describe, mirror_observe, NULL};
  for (int n = 0; n < 2; n++) {
    mirror_rig rig = {
        .base = {&operations},
        .info = {.width = 512, .height = 256, .channels = 3, .response = "gamma 2.2", .source = "mirrors"},
        .disturbed_at = n == 0 ? -9 : 22};
    const clt_acquire_options options = {.scheme = "hierarchical", .watch = -1};
    clt_transport *transport = NULL;
    clt_error error = {0};
    clt_status status = clt_acquire(&rig.base, &options, &transport, &error);
    printf("%ld patterns: %s\n", rig.info.patterns, status == CLT_OK ? "measured" : error.message);
    assert_int_equal(status, n == 0 ? CLT_OK : CLT_FAILED);
    assert_true(n == 0 || strstr(error.message, "do not add up") != NULL);
    clt_transport_destroy(transport);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(sums_are_drives),
      cmocka_unit_test(drives_fit_apart_or_within),
      cmocka_unit_test(one_disturbed_photograph_is_found),
      cmocka_unit_test(a_crooked_camera_is_not_a_disturbance),
      cmocka_unit_test(what_is_resumed_looks_as_it_would_have),
      cmocka_unit_test(a_large_grid_is_looked_at_too),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
