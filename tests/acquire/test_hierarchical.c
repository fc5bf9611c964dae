/* Hierarchical acquisition on dihedrals whose T is known: patterns, appearance errors, storage, noise. */
#include "counterlight/acquire.h"
#include "dihedral.h"
#include "fake_rig.h"

typedef struct test_room {
  int width, height;
  double *transport;
} test_room;

static test_room make_room(int width, int height, double albedo) {
  return (test_room){width, height, dihedral_transport(width, height, albedo)};
}

/* ||(T~ - T) x|| / ||T x|| of channel 0, in double. */
static double appearance_error(const clt_transport *transport, const test_room *room, const double *x) {
  size_t cells = (size_t)room->width * (size_t)room->height;
  double *y = calloc(cells, sizeof *y), wrong = 0, whole = 0;
  clt_transport_apply(transport, 0, x, y);
  for (size_t i = 0; i < cells; i++) {
    double light = 0;
    for (size_t j = 0; j < cells; j++) {
      light += room->transport[i * cells + j] * x[j];
    }
    wrong += (y[i] - light) * (y[i] - light);
    whole += light * light;
  }
  free(y);
  return sqrt(wrong / whole);
}

typedef struct outcome {
  int patterns;
  double random, half, checker, reported; /* appearance errors by picture; of the check patterns */
} outcome;

static outcome measure(const test_room *room, const clt_acquire_options *options, double dark, double photon,
                       uint64_t seed) {
  size_t cells = (size_t)room->width * (size_t)room->height;
  fake_rig rig = fake_rig_make(room->width, room->height, 1, room->transport, 1);
  rig.dark = dark;
  rig.photon = photon;
  rig.random = seed;
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_ok(clt_acquire(&rig.base, options, &transport, &error), error);
  double *random = calloc(cells, sizeof *random), *half = calloc(cells, sizeof *half);
  double *checker = calloc(cells, sizeof *checker);
  for (size_t j = 0; j < cells; j++) {
    size_t x = j % (size_t)room->width, y = j / (size_t)room->width;
    random[j] = test_random(&seed);
    half[j] = x < (size_t)room->width / 2;
    checker[j] = (x / 8 + y / 8) % 2 == 0;
  }
  outcome result = {.patterns = clt_transport_origin(transport)->patterns,
                    .random = appearance_error(transport, room, random),
                    .half = appearance_error(transport, room, half),
                    .checker = appearance_error(transport, room, checker),
                    .reported = clt_transport_origin(transport)->error};
  clt_transport_destroy(transport);
  free(random);
  free(half);
  free(checker);
  print_message("%dx%d tau %g: %d patterns, errors %.3f %% random, %.3f %% half, %.3f %% checker\n", room->width,
                room->height, options->threshold, result.patterns, 100 * result.random, 100 * result.half,
                100 * result.checker);
  return result;
}

/* NUMERICS section 6: tau .03/.01/.001 took 87/171/683 patterns to 4.0/2.6/.7 % with flood-consistent rows. */
static void fewer_patterns_and_errors_than_the_prototype(void **state) {
  (void)state;
  static const struct {
    double threshold, error;
    int patterns;
  } cases[] = {{0.03, 0.04, 87}, {0.01, 0.026, 171}, {0.001, 0.007, 683}};
  test_room room = make_room(64, 32, 0.5);
  for (int n = 0; n < 3; n++) {
    clt_acquire_options options = {.scheme = "hierarchical", .threshold = cases[n].threshold, .repeats = 1};
    outcome result = measure(&room, &options, 0, 0, 5);
    assert_true(result.patterns <= cases[n].patterns);
    assert_true(result.random <= cases[n].error && result.half <= cases[n].error && result.checker <= cases[n].error);
  }
  free(room.transport);
}

/* The default threshold with the noise of a camera: deviation 1e-5 of white for a dark cell, 1e-3 for a white one. */
static void the_default_stays_below_half_a_percent(void **state) {
  (void)state;
  test_room room = make_room(48, 32, 0.7);
  for (uint64_t seed = 1; seed <= 2; seed++) {
    clt_acquire_options options = {.scheme = "hierarchical", .checks = 2, .seed = (unsigned)seed};
    outcome result = measure(&room, &options, 0.7e-5, 0.7e-6, seed);
    assert_true(result.patterns < 400);
    assert_true(result.random < 0.005 && result.half < 0.005 && result.checker < 0.005);
    assert_true(result.reported > 0 && result.reported < 0.007);
  }
  free(room.transport);
}

/* Without interreflection all blocks of a level go in one photograph each for all but the last child. */
static void direct_light_alone_takes_three_patterns_a_level(void **state) {
  (void)state;
  enum { WIDTH = 32, HEIGHT = 16, CELLS = WIDTH * HEIGHT };
  test_room room = {WIDTH, HEIGHT, calloc(CELLS * CELLS, sizeof(double))};
  for (int i = 0; i < CELLS; i++) {
    room.transport[i * (CELLS + 1)] = 0.5 + 0.3 * sin(i);
  }
  outcome result = measure(&room, &(clt_acquire_options){.scheme = "hierarchical", .repeats = 1}, 0, 0, 1);
  /* 5 levels; the first splits 32 x 16 into two halves */
  assert_int_equal(result.patterns, 2 + 1 + 4 * 3);
  assert_near(result.random, 0, 1e-6);
  free(room.transport);
}

/* A mirror: the light of every cell appears at another place, sharply. */
static void sharp_indirect_light_is_found(void **state) {
  (void)state;
  enum { WIDTH = 24, HEIGHT = 20, CELLS = WIDTH * HEIGHT };
  test_room room = {WIDTH, HEIGHT, calloc(CELLS * CELLS, sizeof(double))};
  for (int i = 0; i < CELLS; i++) {
    room.transport[i * (CELLS + 1)] = 0.6;
    room.transport[i * CELLS + i / WIDTH * WIDTH + WIDTH - 1 - i % WIDTH] += 0.3;
  }
  outcome result = measure(&room, &(clt_acquire_options){.scheme = "hierarchical", .repeats = 1}, 0, 0, 1);
  assert_true(result.patterns < 60);
  assert_near(result.random, 0, 1e-5);
  assert_near(result.checker, 0, 1e-5);
  free(room.transport);
}

/* Above 4096 cells the result is a tree, whose entries say the same. */
static void large_grids_become_trees(void **state) {
  (void)state;
  test_room room = {65, 64, dihedral_first_bounce(65, 64, 0.5)};
  size_t cells = 65 * 64;
  fake_rig rig = fake_rig_make(65, 64, 1, room.transport, 1);
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_ok(clt_acquire(&rig.base, &(clt_acquire_options){.threshold = 0.01, .repeats = 1}, &transport, &error), error);
  clt_transport_info info = clt_transport_describe(transport);
  assert_string_equal(info.storage, "tree");
  assert_true(info.bytes < cells * cells);
  double *x = calloc(cells, sizeof *x);
  uint64_t random = 4;
  for (size_t j = 0; j < cells; j++) {
    x[j] = test_random(&random);
  }
  assert_true(appearance_error(transport, &room, x) < 0.005);
  double *sums = calloc(cells, sizeof *sums);
  clt_transport_row_sums(transport, 0, sums);
  for (size_t i = 0; i < cells; i++) {
    double flood = clt_transport_flood(transport, 0)[i];
    assert_near(sums[i], flood, 2e-6 * flood);
  }
  free(sums);
  free(x);
  free(room.transport);
  clt_transport_destroy(transport);
}

/* Channels of other albedo, one of them nearly dark, through one set of white patterns. */
static void channels_share_their_patterns(void **state) {
  (void)state;
  enum { WIDTH = 32, HEIGHT = 24, CELLS = WIDTH * HEIGHT };
  static const double albedos[] = {0.8, 0.5, 0.01};
  double *all = calloc(3 * (size_t)CELLS * CELLS, sizeof *all);
  for (int c = 0; c < 3; c++) {
    double *one = dihedral_transport(WIDTH, HEIGHT, albedos[c]);
    memcpy(all + (size_t)c * CELLS * CELLS, one, sizeof *one * CELLS * CELLS);
    free(one);
  }
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 3, all, 3);
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_ok(clt_acquire(&rig.base, &(clt_acquire_options){.scheme = "hierarchical"}, &transport, &error), error);
  for (int c = 0; c < 3; c++) {
    uint64_t random = 8;
    double x[CELLS], y[CELLS], wrong = 0, whole = 0;
    for (int j = 0; j < CELLS; j++) {
      x[j] = test_random(&random);
    }
    clt_transport_apply(transport, c, x, y);
    for (size_t i = 0; i < CELLS; i++) {
      double light = 0;
      for (size_t j = 0; j < CELLS; j++) {
        light += all[((size_t)c * CELLS + i) * CELLS + j] * x[j];
      }
      wrong += (y[i] - light) * (y[i] - light);
      whole += light * light;
    }
    assert_true(sqrt(wrong / whole) < 0.003);
  }
  clt_transport_destroy(transport);
  free(all);
}

/* With noise of .3 % of a cell's light a hundredth of that as tau asks for no more patterns than the noise is worth,
 * and costs no accuracy; without noise the same tau takes what it says. */
static void refinement_stops_at_the_noise(void **state) {
  (void)state;
  test_room room = make_room(24, 20, 0.5);
  const clt_acquire_options fine = {.scheme = "hierarchical", .threshold = 3e-5},
                            coarse = {.scheme = "hierarchical", .threshold = 3e-3};
  const outcome clean = measure(&room, &fine, 0, 0, 5), noisy = measure(&room, &fine, 3e-3, 0, 5);
  const outcome enough = measure(&room, &coarse, 3e-3, 0, 5);
  assert_true(noisy.patterns < clean.patterns / 4);
  assert_true(noisy.patterns <= 1.2 * enough.patterns);
  assert_true(noisy.random < 1.3 * enough.random && noisy.half < 1.3 * enough.half);
  free(room.transport);
}

/* Noisy light must neither leave entries that a transport file refuses (below -1 % of the largest) nor spoil the row
 * sums: here the own light of a cell is uncertain by 2 %. */
static void noise_leaves_no_negative_light(void **state) {
  (void)state;
  enum { WIDTH = 40, HEIGHT = 26, CELLS = WIDTH * HEIGHT };
  test_room room = make_room(WIDTH, HEIGHT, 0.7);
  static const double thresholds[] = {0.05, 0.005, 0.001};
  for (int n = 0; n < 3; n++) {
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, room.transport, 1);
    rig.dark = 1e-4;
    rig.photon = 4e-4;
    clt_transport *transport = NULL;
    clt_error error = {0};
    clt_acquire_options options = {.scheme = "hierarchical", .threshold = thresholds[n]};
    assert_ok(clt_acquire(&rig.base, &options, &transport, &error), error);
    const float *entries = clt_transport_entries(transport, 0), *flood = clt_transport_flood(transport, 0);
    double least = 0, largest = 0;
    for (size_t i = 0; i < CELLS; i++) {
      double sum = 0;
      for (size_t j = 0; j < CELLS; j++) {
        sum += entries[i * CELLS + j];
        least = fmin(least, entries[i * CELLS + j]);
        largest = fmax(largest, entries[i * CELLS + j]);
      }
      assert_near(sum, flood[i], 1e-5 * flood[i]);
    }
    assert_true(least > -0.005 * largest);
    clt_transport_destroy(transport);
  }
  free(room.transport);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(fewer_patterns_and_errors_than_the_prototype),
      cmocka_unit_test(the_default_stays_below_half_a_percent),
      cmocka_unit_test(direct_light_alone_takes_three_patterns_a_level),
      cmocka_unit_test(sharp_indirect_light_is_found),
      cmocka_unit_test(large_grids_become_trees),
      cmocka_unit_test(channels_share_their_patterns),
      cmocka_unit_test(refinement_stops_at_the_noise),
      cmocka_unit_test(noise_leaves_no_negative_light),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
