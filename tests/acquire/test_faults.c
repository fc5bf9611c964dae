/* Twenty scripts of faults for every scheme with default options: T is as exact as without them, or an error says what
 * is wrong; never a wrong T in silence.
 */
#include "counterlight/acquire.h"
#include "counterlight/scene.h"
#include "scripted_camera.h"
#include "support.h"

enum { SCRIPTS = 20, WALKS = 5, CLEAN = 4, PICTURES = 3, EXPOSURES = 3 };
#define MOST 1.5 /* times the error without faults */

/* An open book of white walls; w x h cells of 2 x 2 pixels. */
static clt_scene *open_scene(int width, int height, unsigned seed) {
  char folder[64], path[96];
  clt_scene *scene = NULL;
  clt_error error = {0};
  test_folder(folder);
  snprintf(path, sizeof path, "%s/scene.cfg", folder);
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fprintf(
      file,
      "seed = %u; grid = { width = %d; height = %d; channels = 1; rays = 2; }; projector = { position = [0.06, "
      "-3.2, 0.03]; bits = 12; }; camera = { cell_pixels = 2; }; materials = ( { name = \"m\"; albedo = 0.7; } ); "
      "surfaces = ( { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"m\"; }, "
      "{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"m\"; } );",
      seed, width, height);
  fclose(file);
  assert_ok(clt_scene_open(path, &scene, &error), error);
  unlink(path);
  rmdir(folder);
  return scene;
}

/* The worst of the pictures: ||b0 + T x - y|| / ||y||, in double, y the scene's own light. */
static double worst_error(const clt_scene *scene, const clt_transport *transport, int width, int height) {
  size_t cells = (size_t)width * (size_t)height;
  double *x = calloc(2 * cells, sizeof *x), *y = x + cells, worst = 0;
  uint64_t state = 5;
  clt_error error = {0};
  clt_image drive = {0}, exact = {0};
  assert_ok(clt_image_init(&drive, 1, height, width, &error), error);
  for (int picture = 0; picture < PICTURES; picture++) {
    double apart = 0, size = 0;
    for (size_t j = 0; j < cells; j++) {
      size_t u = j % (size_t)width, v = j / (size_t)width;
      const double values[PICTURES] = {test_random(&state), u < (size_t)width / 2, (double)((u / 4 + v / 4) % 2)};
      drive.data[j] = (float)values[picture];
      x[j] = (double)drive.data[j];
    }
    assert_ok(clt_scene_appearance(scene, &drive, &exact, &error), error);
    clt_transport_apply(transport, 0, x, y);
    for (size_t i = 0; i < cells; i++) {
      double wanted = (double)exact.data[i], off = (double)clt_transport_black(transport, 0)[i] + y[i] - wanted;
      apart += off * off;
      size += wanted * wanted;
    }
    worst = fmax(worst, sqrt(apart / size));
    clt_image_finish(&exact);
  }
  clt_image_finish(&drive);
  free(x);
  return worst;
}

static unsigned scripts = SCRIPTS, walks = WALKS;

typedef struct outcome {
  clt_status status;
  double error, seconds; /* of T; of the devices */
  int patterns;
  long faults;
  char message[CLT_MESSAGE_MAX];
} outcome;

typedef struct measurement {
  const char *scheme;
  int width, height;
  double patience_s; /* 0: the default, as all else */
} measurement;

static outcome measure(const measurement *with, const fault_script *script, unsigned seed) {
  static scripted_camera camera;
  clt_scene *scene = open_scene(with->width, with->height, seed);
  clt_projector *projector = NULL;
  clt_camera *inner = NULL;
  clt_rig *rig = NULL;
  clt_transport *transport = NULL;
  clt_rig_config config;
  clt_error error = {0};
  outcome out = {0};
  assert_ok(clt_scene_open_projector(scene, &projector, &error), error);
  assert_ok(clt_scene_open_camera(scene, &inner, &error), error);
  scripted_init(&camera, inner, script, seed);
  clt_scene_rig_config(scene, &config);
  config.verify = true;
  config.exposure_count = EXPOSURES; /* none saturated by white, which a figure is scaled from */
  for (int k = 0; k < EXPOSURES; k++) {
    config.exposures_s[k] = (1 << k) / 240.0;
  }
  assert_ok(clt_rig_open(&config, projector, &camera.base, &rig, &error), error);
  const clt_acquire_options options = {
      .scheme = with->scheme, .error = 0.005, .watch = -1, .patience_s = with->patience_s};
  out.status = clt_acquire(rig, &options, &transport, &error);
  out.seconds = camera.last_s;
  out.faults = camera.faults;
  if (out.status == CLT_OK) {
    out.error = worst_error(scene, transport, with->width, with->height);
    out.patterns = clt_transport_origin(transport)->patterns;
  }
  memcpy(out.message, error.message, sizeof out.message);
  clt_transport_destroy(transport);
  rig->operations->close(rig);
  inner->driver->close(inner);
  projector->driver->close(projector);
  clt_scene_close(scene);
  return out;
}

/* One or more kinds of trouble somewhere in an acquisition of so many seconds. */
static fault_script draw_script(unsigned seed, double seconds) {
  uint64_t random = 1000 + seed;
  unsigned kind = seed % 5;
  fault_script script = {.gone_as = test_random(&random) < 0.5 ? CLT_GONE : CLT_TIMEOUT};
  script.dropped = 0.05 * test_random(&random);
  script.duplicated = kind == 1 || kind == 4 ? 0.05 : 0;
  script.late = kind == 2 || kind == 4 ? 0.04 : 0;
  script.half_dark = kind == 3 || kind == 4 ? 0.04 : 0;
  if (kind == 0 || kind == 2 || kind == 4) {
    script.walk_for_s = 1 + 2 * test_random(&random);
    script.walk_s = seconds * test_random(&random);
    script.walk_gain = test_random(&random) < 0.5 ? 0.3 : 1.6;
  }
  if (kind == 1 || kind == 3) {
    script.gone_for_s = 5;
    script.gone_s = seconds * test_random(&random);
  }
  script.stuck_for_s = kind == 1 ? 0.5 : 0;
  script.stuck_s = seconds * test_random(&random);
  return script;
}

/* Nothing but someone who crosses, wholly within the acquisition. */
static fault_script draw_walk(unsigned seed, double seconds) {
  uint64_t random = 500 + seed;
  fault_script script = {.walk_for_s = 1 + 2 * test_random(&random)};
  script.walk_s = (seconds - script.walk_for_s) * test_random(&random);
  script.walk_gain = test_random(&random) < 0.5 ? 0.3 : 1.6;
  return script;
}

static void print_outcome(const measurement *with, unsigned seed, const fault_script *script, const outcome *clean,
                          const outcome *out) {
  printf("%-12s seed %2u: dropped %.3f dup %.2f late %.2f half %.2f", with->scheme, seed, script->dropped,
         script->duplicated, script->late, script->half_dark);
  if (script->walk_for_s > 0) {
    printf(", walk x%.1f at %.1f s for %.1f s", script->walk_gain, script->walk_s, script->walk_for_s);
  }
  if (script->gone_for_s > 0) {
    printf(", %s at %.1f s for 5 s", clt_status_name(script->gone_as), script->gone_s);
  }
  printf(" -> ");
  if (out->status == CLT_OK) {
    printf("%.3f %% (%.2fx), %d patterns for %d, %.1f s for %.1f s, %ld faults\n", 100 * out->error,
           out->error / clean->error, out->patterns, clean->patterns, out->seconds, clean->seconds, out->faults);
  } else {
    printf("%s: %s\n", clt_status_name(out->status), out->message);
  }
}

/* The mean error, and the rest of the last one. */
static outcome measure_undisturbed(const measurement *with) {
  outcome clean = {0};
  double mean = 0;
  for (unsigned seed = 1; seed <= CLEAN; seed++) {
    clean = measure(with, &(fault_script){0}, seed);
    assert_int_equal(clean.status, CLT_OK);
    mean += clean.error / CLEAN;
  }
  clean.error = mean;
  return clean;
}

/* None may be wrong without a word, and most are to be measured. */
static void run_scripts(const measurement *with, const outcome *clean, unsigned seeds,
                        fault_script (*draw)(unsigned seed, double seconds)) {
  unsigned right = 0, wrong = 0;
  double worst = 0;
  for (unsigned seed = 1; seed <= seeds; seed++) {
    fault_script script = draw(seed, clean->seconds);
    outcome out = measure(with, &script, seed);
    print_outcome(with, seed, &script, clean, &out);
    right += out.status == CLT_OK;
    wrong += out.status != CLT_OK ? out.message[0] == '\0' : out.error > MOST * clean->error;
    worst = fmax(worst, out.error / clean->error);
  }
  printf("%s: %u of %u measured, the others refused; worst %.2fx, %u wrong in silence\n", with->scheme, right, seeds,
         worst, wrong);
  assert_int_equal(wrong, 0);
  assert_true(right >= seeds * 3 / 4);
}

static void survive(const measurement *with) {
  outcome clean = measure_undisturbed(with);
  run_scripts(with, &clean, scripts, draw_script);
  run_scripts(with, &clean, walks, draw_walk);
}

static void brute_force_survives_the_scripts(void **state) {
  (void)state;
  survive(&(measurement){"brute", 12, 8, 0});
}

static void hadamard_survives_the_scripts(void **state) {
  (void)state;
  survive(&(measurement){"hadamard", 12, 8, 0});
}

static void hierarchical_survives_the_scripts(void **state) {
  (void)state;
  survive(&(measurement){"hierarchical", 16, 12, 0});
}

static void blocks_survive_the_scripts(void **state) {
  (void)state;
  survive(&(measurement){"blocks", 16, 12, 0});
}

static void a_change_that_stays_is_an_error(void **state) {
  (void)state;
  outcome out = measure(&(measurement){"hierarchical", 16, 12, 1}, &(fault_script){.stays_s = 12}, 1);
  printf("%s\n", out.message);
  assert_int_equal(out.status, CLT_FAILED);
  assert_non_null(strstr(out.message, "the room changed while it was measured: cells around ("));
  assert_non_null(strstr(out.message, "% darker"));
}

static void a_camera_that_stays_away_is_an_error(void **state) {
  (void)state;
  outcome out = measure(&(measurement){"hierarchical", 16, 12, 0.1},
                        &(fault_script){.gone_as = CLT_GONE, .gone_s = 12, .gone_for_s = 1e6}, 1);
  printf("%s\n", out.message);
  assert_int_equal(out.status, CLT_GONE);
  assert_non_null(strstr(out.message, "the camera is gone"));
}

/* The number of seeds may be given. */
int main(int count, char **words) {
  scripts = count > 1 ? (unsigned)atoi(words[1]) : scripts;
  walks = count > 1 ? scripts : walks;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_change_that_stays_is_an_error),   cmocka_unit_test(a_camera_that_stays_away_is_an_error),
      cmocka_unit_test(brute_force_survives_the_scripts),  cmocka_unit_test(hadamard_survives_the_scripts),
      cmocka_unit_test(hierarchical_survives_the_scripts), cmocka_unit_test(blocks_survive_the_scripts),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
