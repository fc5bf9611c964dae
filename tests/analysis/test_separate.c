/* Direct and global light by shifted checkerboards: a rig with even global light, and simulated rooms. */
#include "acquire/fake_rig.h"
#include "rooms.h"

enum { WIDTH = 24, HEIGHT = 16, CELLS = WIDTH * HEIGHT };

/* T = diag(F) + g_i / N: global light that is the same whichever cells are lit. */
static double *even_room(double *first, double *global) {
  double *transport = numbers((size_t)CELLS * CELLS);
  uint64_t random = 11;
  for (size_t i = 0; i < CELLS; i++) {
    first[i] = 0.2 + test_random(&random);
    global[i] = 0.5 * test_random(&random);
    for (size_t j = 0; j < CELLS; j++) {
      transport[i * CELLS + j] = (i == j ? first[i] : 0) + global[i] / CELLS;
    }
  }
  return transport;
}

static clt_separation separate(clt_rig *rig, clt_separation_options options) {
  clt_separation light;
  clt_error error = {0};
  assert_ok(clt_separate(rig, &options, &light, &error), error);
  return light;
}

static double image_distance(const clt_image *found, const double *wanted) {
  double rest = 0, whole = 0;
  for (size_t i = 0; i < clt_image_size(found); i++) {
    rest += pow(found->data[i] - wanted[i], 2);
    whole += wanted[i] * wanted[i];
  }
  return sqrt(rest / whole);
}

/* Direct light is F and global light g, whatever the squares, the level and the projector's black (which is in b0). */
static void even_global_light_is_told_apart(void **state) {
  (void)state;
  static const clt_separation_options cases[] = {{0},
                                                 {.square = 1},
                                                 {.square = 2, .step = 1},
                                                 {.square = 2, .step = 2},
                                                 {.square = 3},
                                                 {.square = 4, .step = 1},
                                                 {.square = 6, .level = 0.4},
                                                 {.square = 5, .step = 5, .repeats = 2}};
  double first[CELLS], global[CELLS], *transport = even_room(first, global);
  for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 2, transport, 1);
    clt_separation light = separate(&rig.base, cases[n]);
    int square = cases[n].square, step = cases[n].step;
    step = step ? step : square % 2 ? 1 : square / 2;
    long patterns =
        square == 0 ? 20 : (2 + 2L * square / step * (square / step)) * (cases[n].repeats ? cases[n].repeats : 1);
    assert_int_equal(rig.patterns, patterns);
    assert_int_equal(light.patterns, patterns);
    assert_int_equal(light.unseen, 0);
    assert_near(light.active, 0.5, 0.02);
    for (size_t i = 0; i < 2 * CELLS; i++) {
      /* grids that the squares do not divide are not half on in every pattern */
      assert_near(light.direct.data[i], first[i % CELLS], 0.04 * global[i % CELLS] + 1e-5);
      assert_near(light.global.data[i], global[i % CELLS], 0.04 * global[i % CELLS] + 1e-5);
    }
    assert_near(light.closure, 0, 2e-3);
    clt_separation_finish(&light);
  }
  free(transport);
}

/* Means have no bias, and scatter as their deviations say: over 40 seeds. */
static void noise_neither_biases_nor_hides(void **state) {
  (void)state;
  enum { SEEDS = 40 };
  double first[CELLS], global[CELLS], *transport = even_room(first, global);
  double direct_mean = 0, direct_square = 0, global_mean = 0, global_square = 0;
  for (int seed = 1; seed <= SEEDS; seed++) {
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, transport, 1);
    rig.dark = 0.01;
    rig.photon = 1e-3;
    rig.random = (uint64_t)seed;
    clt_separation light = separate(&rig.base, (clt_separation_options){.square = 2});
    for (size_t i = 0; i < CELLS; i++) {
      double d = (light.direct.data[i] - first[i]) / light.direct_deviation.data[i];
      double g = (light.global.data[i] - global[i]) / light.global_deviation.data[i];
      direct_mean += d;
      direct_square += d * d;
      global_mean += g;
      global_square += g * g;
    }
    assert_true(light.closure < 1.3 * light.closure_noise);
    clt_separation_finish(&light);
  }
  double count = (double)SEEDS * CELLS;
  print_message("direct: mean %.3f, rms %.3f deviations; global: %.3f, %.3f\n", direct_mean / count,
                sqrt(direct_square / count), global_mean / count, sqrt(global_square / count));
  assert_near(direct_mean / count, 0, 0.03); /* 4 standard errors; the maximum of two would be off by 0.5 */
  assert_near(global_mean / count, 0, 0.03);
  assert_near(sqrt(direct_square / count), 1, 0.03);
  assert_near(sqrt(global_square / count), 1, 0.03);
  free(transport);
}

static void a_blind_cell_is_counted(void **state) {
  (void)state;
  double first[CELLS], global[CELLS], *transport = even_room(first, global);
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, transport, 1);
  rig.blind = 37;
  clt_separation light = separate(&rig.base, (clt_separation_options){0});
  assert_int_equal(light.unseen, 1);
  assert_true(isinf(light.direct_deviation.data[37]) && isinf(light.global_deviation.data[37]));
  assert_true(light.direct.data[37] == 0 && isfinite(light.direct.data[38]) && isfinite(light.closure));
  clt_separation_finish(&light);
  clt_separation_finish(NULL);
  free(transport);
}

static bool stop_at_three(void *context, long done, long total) {
  *(long *)context = total;
  return done < 3;
}

static void failures_are_passed_on(void **state) {
  (void)state;
  double first[CELLS], global[CELLS], *transport = even_room(first, global);
  clt_separation light;
  clt_error error = {0};
  static const struct {
    clt_separation_options options;
    const char *wanted;
  } cases[] = {{{.square = 17}, "1 to 16"}, {{.square = -1}, "1 to 16"},  {{.square = 4, .step = 3}, "does not divide"},
               {{.step = 2}, "give both"},  {{.repeats = 65}, "1 to 64"}, {{.level = 1.5}, "level 1.5"},
               {{.level = NAN}, "level"},   {{.square = 13}, "too small"}};
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, transport, 1);
  for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
    assert_int_equal(clt_separate(&rig.base, &cases[n].options, &light, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, cases[n].wanted));
  }
  assert_int_equal(rig.patterns, 0);
  long total = 0;
  clt_separation_options stopped = {.progress = stop_at_three, .context = &total};
  assert_int_equal(clt_separate(&rig.base, &stopped, &light, &error), CLT_CANCELLED);
  assert_int_equal(rig.patterns, 3);
  assert_int_equal(total, 20);
  assert_null(light.direct.data);
  rig.fails_with = CLT_GONE;
  rig.fails_at = 6;
  assert_int_equal(clt_separate(&rig.base, NULL, &light, &error), CLT_GONE);
  free(transport);
}

/* A room through its own simulated devices; direct light against F (exact), global against T 1 - F. */
static void see(const char *name, const char *text, clt_separation_options options, double most_direct,
                double most_global) {
  clt_error error = {0};
  clt_station_config config;
  clt_station station = {0};
  room made = room_write(text);
  assert_ok(clt_station_for_scene(made.path, &config, &error), error);
  assert_ok(clt_station_open(&config, &station, &error), error);
  assert_ok(clt_station_open_rig(&config, &station, NULL, &error), error);
  const clt_transport *transport = clt_scene_transport(station.scene);
  clt_certificate *certificate = NULL;
  assert_ok(clt_certify(transport, &certificate, &error), error);
  clt_interreflection *op = analyse(transport, certificate, true, 0);
  size_t n = clt_transport_describe(transport).cols;
  double *global = numbers(n), whole = 0, rest = 0;
  const double *first = clt_interreflection_first_bounce(op, 0);
  clt_transport_row_sums(transport, 0, global);
  clt_separation light = separate(station.rig, options);
  for (size_t i = 0; i < n; i++) {
    whole += global[i] * global[i];
    global[i] -= first[i];
    rest += pow(light.global.data[i] - global[i], 2);
  }
  double direct = image_distance(&light.direct, first), far = sqrt(rest / whole);
  print_message("%s, squares of %d (asked for %d): direct %.3f %% off, global %.3f %% of the picture off (noise: %.3f "
                "%%), closure "
                "%.3f %%\n",
                name, light.square, options.square, 100 * direct, 100 * far, 100 * light.closure_noise,
                100 * light.closure);
  assert_true(direct < most_direct && far < most_global);
  assert_true(light.closure < 1.5 * light.closure_noise + 1e-3);
  clt_separation_finish(&light);
  clt_interreflection_destroy(op);
  clt_certificate_destroy(certificate);
  free(global);
  clt_station_close(&station);
  unlink(made.path);
  rmdir(made.folder);
}

static const double white[2] = {0.7, 0.7};
static const char clean[] = "camera = { bits = 16; photon_noise = false; read_noise = 0.0; black_level = 0; };\n"
                            "ambient = 0.01;\n";

static void walls_without_noise(void **state) {
  (void)state;
  char text[2048];
  dihedral_text(text, 32, 24, "[0.44, 0.33]", white, clean);
  for (int square = 0; square <= 6; square++) {
    double most = square <= 2 ? 0.01 : 0.08;
    see("walls", text, (clt_separation_options){.square = square}, most, most);
  }
}

static void walls_with_noise(void **state) {
  (void)state;
  char text[2048];
  for (int seed = 1; seed <= 2; seed++) {
    char more[64];
    snprintf(more, sizeof more, "ambient = 0.01;\nseed = %d;\n", seed);
    dihedral_text(text, 32, 24, "[0.44, 0.33]", white, more);
    see("noisy walls", text, (clt_separation_options){.repeats = 2}, 0.02, 0.02);
  }
}

/* No light bounces from a flat wall to itself: global light is 0. */
static void a_flat_wall_has_no_global_light(void **state) {
  (void)state;
  char text[2048];
  snprintf(
      text, sizeof text,
      "grid = { width = 24; height = 16; channels = 1; };\n"
      "projector = { position = [0.0, -3.0, 0.0]; target = [0.0, 0.0, 0.0]; intensity = 40.0; black = 0.01; };\n"
      "materials = ( { name = \"white\"; albedo = 0.7; } );\n"
      "surfaces = ( { corner = [-1.5, 0.0, -1.2]; u = [3.0, 0.0, 0.0]; v = [0.0, 0.0, 2.4]; material = \"white\"; }"
      ");\n%s",
      clean);
  see("flat wall", text, (clt_separation_options){0}, 2e-3, 2e-3);
  see("flat wall", text, (clt_separation_options){.level = 0.3}, 2e-3, 2e-3);
}

/* Blur by the projector leaks light over the squares' borders, which cells well inside larger squares do not see. */
static void larger_squares_stand_blur(void **state) {
  (void)state;
  char text[2048], blurred[2048];
  dihedral_text(text, 32, 24, "[0.44, 0.33]", white, clean);
  const char *at = strstr(text, "intensity = 40.0;");
  snprintf(blurred, sizeof blurred, "%.*sdefocus = 0.4; %s", (int)(at - text), text, at);
  static const double most[] = {0.05, 1, 1, 0.05, 0.05}; /* of squares that are chosen, of 1, 2, 3, 4 */
  for (int square = 0; square <= 4; square++) {
    see("blurred walls", blurred, (clt_separation_options){.square = square}, most[square], most[square]);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(even_global_light_is_told_apart),
      cmocka_unit_test(noise_neither_biases_nor_hides),
      cmocka_unit_test(a_blind_cell_is_counted),
      cmocka_unit_test(failures_are_passed_on),
      cmocka_unit_test(walls_without_noise),
      cmocka_unit_test(walls_with_noise),
      cmocka_unit_test(a_flat_wall_has_no_global_light),
      cmocka_unit_test(larger_squares_stand_blur),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
