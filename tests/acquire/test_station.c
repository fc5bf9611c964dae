/* Stations on simulated scenes: opening, refusing, and a whole acquisition through noisy frames. */
#include "counterlight/station.h"
#include "support.h"

static char folder[64], scene_path[128], station_path[128];

static void write_file(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
}

/* A small dihedral whose camera noise is seeded. */
static void write_scene(int seed) {
  char text[1024];
  snprintf(text, sizeof text,
           "grid = { width = 24; height = 18; channels = 3; rays = 4; };\n"
           "projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; intensity = 40.0; };\n"
           "camera = { cell_pixels = 2; };\n"
           "seed = %d;\n"
           "materials = ( { name = \"warm\"; albedo = [0.8, 0.6, 0.4]; } );\n"
           "surfaces = (\n"
           "  { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"warm\"; },\n"
           "  { corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"warm\"; }\n"
           ");\n",
           seed);
  write_file(scene_path, text);
}

static int make_folder(void **state) {
  (void)state;
  test_folder(folder);
  snprintf(scene_path, sizeof scene_path, "%s/room.cfg", folder);
  snprintf(station_path, sizeof station_path, "%s/station.cfg", folder);
  write_scene(1);
  return 0;
}

static int remove_folder(void **state) {
  (void)state;
  unlink(scene_path);
  unlink(station_path);
  return rmdir(folder);
}

static clt_status open_text(const char *text, clt_station *station, clt_error *error) {
  clt_station_config config;
  *error = (clt_error){0};
  write_file(station_path, text);
  *station = (clt_station){0};
  clt_status status = clt_station_read(station_path, &config, error);
  if (status == CLT_OK) {
    status = clt_station_open(&config, station, error);
  }
  return status == CLT_OK ? clt_station_open_rig(&config, station, NULL, error) : status;
}

static void a_scene_alone_makes_a_station(void **state) {
  (void)state;
  clt_station station;
  clt_error error;
  assert_ok(open_text("scene = \"room.cfg\";", &station, &error), error);
  clt_rig_info info;
  station.rig->operations->describe(station.rig, &info);
  assert_int_equal(info.width, 24);
  assert_int_equal(info.height, 18);
  assert_int_equal(info.channels, 3);
  clt_station_close(&station);
  assert_null(station.rig);
  clt_station_close(&station);
  clt_station_close(NULL);
}

/* A coarser grid on the same devices: each cell is 2 x 2 of the scene's. */
static void the_file_overrides_the_scene(void **state) {
  (void)state;
  clt_station station;
  clt_error error;
  assert_ok(open_text("scene = \"room.cfg\"; rig = { width = 12; height = 9; exposures_ms = [20.0]; };"
                      "projector = { response = \"linear\"; };",
                      &station, &error),
            error);
  clt_rig_info info;
  station.rig->operations->describe(station.rig, &info);
  assert_int_equal(info.width, 12);
  assert_string_equal(info.response, "linear");
  clt_image images[3] = {{0}};
  for (int i = 0; i < 3; i++) {
    assert_ok(clt_image_init(&images[i], 3, 9, 12, &error), error);
  }
  assert_ok(station.rig->operations->observe(station.rig, &images[0], &images[1], &images[2], &error), error);
  station.rig->operations->describe(station.rig, &info);
  assert_int_equal(info.frames, 1);
  for (int i = 0; i < 3; i++) {
    clt_image_finish(&images[i]);
  }
  clt_station_close(&station);
}

static void what_does_not_fit_is_refused(void **state) {
  (void)state;
  static const struct {
    const char *text, *wanted;
  } cases[] = {
      {"projector = { driver = \"lantern\"; };", "no projector driver \"lantern\"; there are: simulated"},
      {"scene = \"room.cfg\"; camera = { driver = \"v4l3\"; };", "no camera driver \"v4l3\"; there are: simulated"},
      {"rig = { attempts = 3; };", "need a scene"},
      {"scene = \"no-such-room.cfg\";", "no-such-room.cfg"},
      {"scene = \"room.cfg\"; rig = { width = 25; height = 18; };", "24 x 18 pixels are no whole multiple of the "
                                                                    "grid's 25 x 18"},
      {"scene = \"room.cfg\"; rig = { width = 12; height = 18; };", "48 x 36 pixels are not a whole multiple"},
      {"scene = \"room.cfg\"; rig = { exposures_ms = [50000.0]; };", "exposure of 50000 ms"},
  };
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    clt_station station;
    clt_error error;
    assert_int_equal(open_text(cases[n].text, &station, &error), CLT_BAD_INPUT);
    if (strstr(error.message, cases[n].wanted) == NULL) {
      fail_msg("%s gave \"%s\", wanted \"%s\"", cases[n].text, error.message, cases[n].wanted);
    }
    clt_station_close(&station);
  }
}

/* A drive with structure at every scale. */
static void draw_picture(clt_image *drive, uint64_t seed) {
  size_t cells = (size_t)drive->width * (size_t)drive->height;
  for (size_t at = 0; at < clt_image_size(drive); at++) {
    double x = (double)(at % cells % (size_t)drive->width) / drive->width;
    drive->data[at] = (float)(0.5 * (x < 0.5) + 0.5 * test_random(&seed));
  }
}

/* ||b0~ + T~ x - y|| / ||y|| with the scene's exact appearance y, in double. */
static double prediction_error(const clt_transport *transport, const clt_scene *scene, uint64_t seed) {
  clt_transport_info info = clt_transport_describe(transport);
  clt_image drive = {0}, exact = {0};
  clt_error error = {0};
  assert_ok(clt_image_init(&drive, info.channels, info.height, info.width, &error), error);
  draw_picture(&drive, seed);
  assert_ok(clt_scene_appearance(scene, &drive, &exact, &error), error);
  double *x = calloc(info.cols, sizeof *x), *y = calloc(info.rows, sizeof *y), wrong = 0, whole = 0;
  for (int c = 0; c < info.channels; c++) {
    for (size_t j = 0; j < info.cols; j++) {
      x[j] = drive.data[(size_t)c * info.cols + j];
    }
    clt_transport_apply(transport, c, x, y);
    for (size_t i = 0; i < info.rows; i++) {
      double light = exact.data[(size_t)c * info.rows + i];
      wrong += pow(y[i] + clt_transport_black(transport, c)[i] - light, 2);
      whole += light * light;
    }
  }
  free(x);
  free(y);
  clt_image_finish(&drive);
  clt_image_finish(&exact);
  return sqrt(wrong / whole);
}

/* What was acquired must pass as a transport file, where light cannot be negative beyond noise. */
static void assert_can_be_stored(const clt_transport *transport) {
  char path[128];
  clt_error error = {0};
  clt_transport *loaded = NULL;
  snprintf(path, sizeof path, "%s/T.h5", folder);
  assert_ok(clt_transport_save(transport, path, &error), error);
  assert_ok(clt_transport_load(path, &loaded, &error), error);
  clt_transport_destroy(loaded);
  unlink(path);
}

static void noisy_frames_give_the_scenes_transport(void **state) {
  (void)state;
  static const struct {
    const char *scheme;
    int seed, most;
  } cases[] = {{"brute", 1, 500}, {"hierarchical", 1, 180}, {"hierarchical", 2, 180}, {"hierarchical", 3, 180}};
  for (int n = 0; n < 4; n++) {
    write_scene(cases[n].seed);
    clt_station station;
    clt_error error;
    assert_ok(open_text("scene = \"room.cfg\";", &station, &error), error);
    clt_acquire_options options = {.scheme = cases[n].scheme, .checks = 2};
    clt_transport *transport = NULL;
    assert_ok(clt_acquire(station.rig, &options, &transport, &error), error);
    double wrong = prediction_error(transport, station.scene, 9);
    print_message("%s: %d patterns, prediction error %.3f %%\n", cases[n].scheme,
                  clt_transport_origin(transport)->patterns, 100 * wrong);
    assert_true(wrong < 0.004);
    assert_true(clt_transport_origin(transport)->patterns < cases[n].most);
    assert_true(clt_transport_origin(transport)->error < 0.01);
    assert_can_be_stored(transport);
    clt_transport_destroy(transport);
    clt_station_close(&station);
  }
  write_scene(1);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_scene_alone_makes_a_station),
      cmocka_unit_test(the_file_overrides_the_scene),
      cmocka_unit_test(what_does_not_fit_is_refused),
      cmocka_unit_test(noisy_frames_give_the_scenes_transport),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
