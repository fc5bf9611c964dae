#include "room.h"

/* libconfig 1.5 leaks the text before a syntax error; the leak sanitizer, where it is there, asks for what to ignore.
 */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) {
  return "leak:libconfig";
}

#define GRID "grid = { width = 4; height = 3; channels = 3; }; "
#define WHITE "materials = ( { name = \"white\"; albedo = 0.7; } ); "
#define WALL "surfaces = ( { corner = [-2, 0, -2]; u = [4, 0, 0]; v = [0, 0, 4]; material = \"white\"; } ); "
#define WALL_OF(corner, u, v, material)                                                                                \
  "surfaces = ( { corner = " corner "; u = " u "; v = " v "; material = \"" material "\"; } ); "

#define TWO(one, other) "surfaces = ( { " one "; material = \"white\"; },\n { " other "; material = \"white\"; } ); "

/* A scene that is refused, and the parts that its message must have. */
typedef struct refusal {
  const char *text, *key, *why;
} refusal;

static const refusal refusals[] = {
    {"grid = { width = 4;", "scene.cfg:", "syntax error"},
    {GRID WHITE, "neither surfaces nor transport_file", "needs one of them"},
    {GRID WHITE WALL "transport_file = \"t.h5\";", "transport_file", "beside surfaces"},
    {"grid = { width = 0; }; " WHITE WALL, "scene.cfg:1: width", "legal is 1 to 1024"},
    {"grid = { width = 1024; height = 577; }; " WHITE WALL, "grid", "at most 589824"},
    {"grid = { channels = 2; }; " WHITE WALL, "channels", "legal is 1 or 3"},
    {GRID "gird = 1; " WHITE WALL, "gird", "not a known key"},
    {GRID "projector = { positon = [0, 0, 0]; }; " WHITE WALL, "positon", "not a known key"},
    {GRID "projector = { position = [0, 0]; }; " WHITE WALL, "position", "legal is 3 to 3"},
    {GRID "projector = { position = [0.0, 1.0, 2.0]; target = [0.0, 1.0, 2.0]; }; " WHITE WALL, "target",
     "is the projector's position"},
    {GRID "projector = { up = [0, 1, 0]; }; " WHITE WALL, "up", "parallel to the view"},
    {GRID "projector = { tangent = [0.0, 1.0]; }; " WHITE WALL, "tangent", "legal is 0.001 to 10"},
    {GRID "projector = { intensity = [1.0, 2.0]; }; " WHITE WALL, "intensity", "one for each of the 3 channels"},
    {GRID "projector = { response = \"rec709\"; }; " WHITE WALL, "response", "rec709"},
    {GRID "projector = { black = 0.9; }; " WHITE WALL, "black", "legal is 0 to 0.5"},
    {GRID "projector = { bits = 8.5; }; " WHITE WALL, "bits", "whole number from 1 to 16"},
    {GRID "camera = { bits = 7; }; " WHITE WALL, "bits", "legal is 8 to 16"},
    {GRID "camera = { black_level = 3000; }; " WHITE WALL, "black_level", "legal is 0 to 2048"},
    {GRID "camera = { exposure_delay_frames = 9; }; " WHITE WALL, "exposure_delay_frames", "legal is 0 to 8"},
    {GRID "projector = { crosstalk = [1, 0, 0]; }; " WHITE WALL, "crosstalk", "legal is 9 to 9"},
    {GRID "projector = { crosstalk = [1, 0, 0, 0, 1, 0, 0, 0, 3]; }; " WHITE WALL, "crosstalk", "legal is 0 to 2"},
    {"grid = { width = 4; height = 3; channels = 1; }; projector = { crosstalk = [1, 0, 0, 0, 1, 0, 0, 0, 1]; }; " WHITE
         WALL,
     "crosstalk", "needs 3 channels"},
    {GRID "projector = { defocus = 9; }; " WHITE WALL, "defocus", "legal is 0 to 8"},
    {GRID "camera = { lens_blur = -1; }; " WHITE WALL, "lens_blur", "legal is 0 to 8"},
    {GRID "camera = { line_us = 2000.0; }; " WHITE WALL, "line_us", "legal is 0 to 1000"},
    {GRID "camera = { faults = { dropped = 1.0; }; }; " WHITE WALL, "dropped", "legal is 0 to 0.9"},
    {GRID "camera = { faults = { lost = 0.1; }; }; " WHITE WALL, "lost", "not a known key"},
    {GRID "projector = { drift = { per_hour = 2.0; }; }; " WHITE WALL, "per_hour", "legal is -1 to 1"},
    {GRID "flicker = { depth = 1.5; }; " WHITE WALL, "depth", "legal is 0 to 1"},
    {GRID "subsurface = { share = 0.5; radius = 20.0; }; " WHITE WALL, "radius", "legal is 0.1 to 8"},
    {GRID "vibration = { amplitude = [1.0, 3.0]; }; " WHITE WALL, "amplitude", "legal is -2 to 2"},
    {GRID "change = { at_s = 1.0; factor = 0.5; }; " WHITE WALL, "cells", "needs cells"},
    {GRID "change = { cells = [2, 0, 3, 1]; factor = 0.5; }; " WHITE WALL, "cells", "beyond the grid of 4 x 3"},
    {GRID "change = { cells = [2, 0, 1, 1]; for_s = 2.0; every_s = 1.5; }; " WHITE WALL, "every_s", "gone in between"},
    {GRID "camera = { vignetting = 0.96; }; " WHITE WALL, "vignetting", "legal is 0 to 0.95"},
    {GRID "camera = { photon_noise = 1; }; " WHITE WALL, "photon_noise", "must be true or false"},
    {GRID "ambient = -1.0; " WHITE WALL, "ambient", "legal is 0 to 1e+06"},
    {GRID "seed = \"x\"; " WHITE WALL, "seed", "must be a number"},
    {GRID "materials = ( { name = \"white\"; albedo = 1.0; } ); " WALL, "albedo", "0 to below 1"},
    {GRID "materials = ( { name = \"white\"; albedo = -0.1; } ); " WALL, "albedo", "legal is 0 to 1"},
    {GRID "materials = ( { albedo = 0.1; } ); " WALL, "material", "needs name"},
    {GRID "materials = ( { name = \"white\"; }, { name = \"white\"; } ); " WALL, "name", "two materials"},
    {GRID WHITE "surfaces = ();", "surfaces", "legal is 1 to 64"},
    {GRID WHITE "surfaces = ( { corner = [0, 0, 0]; u = [1, 0, 0]; material = \"white\"; } );", "scene.cfg:1",
     "needs v = [x, y, z]"},
    {GRID WHITE "\n\n" WALL_OF("[0, 0, 0]", "[1, 0, 0]", "[2, 0, 0]", "white"), "scene.cfg:3: u", "perpendicular"},
    {GRID WHITE WALL_OF("[0, 0, 0]", "[1, 0, 0]", "[0, 0, 0]", "white"), "u", "longer than 1e-6"},
    {GRID WHITE WALL_OF("[0, 0, 0]", "[1, 0, 0]", "[0.0, 0.0, 1e9]", "white"), "v", "legal is -1000 to 1000"},
    {GRID WHITE WALL_OF("[0, 0, 0]", "[1, 0, 0]", "[0, 0, 1]", "withe"), "material", "\"withe\" is not among"},
    {GRID WHITE TWO("corner = [-2, 0, -2]; u = [4, 0, 0]; v = [0, 0, 4]",
                    "corner = [1, 0, 1]; u = [1, 0, 1]; v = [-1, 0, 1]"),
     "scene.cfg:2: lies flush on a surface before it", "move it off"},
    {GRID WHITE TWO("type = \"box\"; corner = [-1.0, 0.0, -1.5]; u = [1, 0, 0]; v = [0, 1, 0]; w = [0, 0, 1]",
                    "type = \"box\"; corner = [-0.5, -0.5, -1.2]; u = [2, 0, 0]; v = [0, 2, 0]; w = [0.0, 0.0, 0.7]"),
     "scene.cfg:2: lies flush", "cut out what it covers"},
    {GRID WHITE WALL_OF("[5, 0, 5]", "[1, 0, 0]", "[0, 0, 1]", "white"), "projector", "meets no surface"},
    {GRID WHITE WALL_OF("[-2, 0, -2]", "[0, 0, 4]", "[4, 0, 0]", "white"), "projector", "swap their u and v"},
    {"transport_file = \"absent.h5\";", "transport_file", "absent.h5"},
    {"transport_file = 7;", "transport_file", "must be a text"},
    {"grid = { width = 5; }; transport_file = \"t.h5\";", "grid",
     "is 5 x 2 with 1 channels, but t.h5 has 3 x 2 with 1"},
    {"grid = { rays = 4; }; transport_file = \"t.h5\";", "rays", "not a known key"},
    {"projector = { position = [0, 0, 1]; }; transport_file = \"t.h5\";", "position", "nothing beside transport_file"},
};

static float unit(int channel, size_t row, size_t column) {
  return (float)(channel + (row == column));
}

static void mistakes_are_refused(void **state) {
  (void)state;
  for (size_t k = 0; k < sizeof refusals / sizeof refusals[0]; k++) {
    room made;
    room_make(&made, refusals[k].text);
    room_add_transport(&made, 3, 2, 1, unit, 0.0f);
    clt_scene *scene = NULL;
    clt_error error = {.status = CLT_OK};
    clt_status status = clt_scene_open(made.scene_path, &scene, &error);
    room_remove(&made);
    if (status != CLT_BAD_INPUT || error.status != status || strstr(error.message, refusals[k].key) == NULL ||
        strstr(error.message, refusals[k].why) == NULL || strstr(error.message, made.scene_path) == NULL) {
      fail_msg("%s\ngave %s: %s", refusals[k].text, clt_status_name(status), error.message);
    }
    assert_null(scene);
  }
}

/* Surfaces that touch, share an edge or lie back to back are no mistake, however they are turned. */
static void neighbours_are_read(void **state) {
  static const char *const texts[] = {
      TWO("corner = [-2, 0, -2]; u = [2, 0, 0]; v = [0, 0, 4]", "corner = [0, 0, -2]; u = [2, 0, 0]; v = [0, 0, 4]"),
      TWO("corner = [-2, 0, -2]; u = [4, 0, 0]; v = [0, 0, 4]", "corner = [-2, 0, -2]; u = [0, 0, 4]; v = [4, 0, 0]"),
      TWO("corner = [-2, 0, -2]; u = [4, 0, 0]; v = [0, 0, 4]",
          "corner = [-1.0, -0.001, -1.0]; u = [2, 0, 0]; v = [0, 0, 2]"),
      TWO("corner = [-1.0, 0.1, -1.0]; u = [0.7, 0.21, 0.0]; v = [0, 0, 1]",
          "corner = [-0.3, 0.31, -1.0]; u = [0.07, 0.021, 0.0]; v = [0, 0, 1]"),
      TWO("type = \"box\"; corner = [-1, 0, -1]; u = [1, 0, 0]; v = [0, 1, 0]; w = [0, 0, 1]",
          "type = \"box\"; corner = [0, 0, -1]; u = [1, 0, 0]; v = [0, 1, 0]; w = [0, 0, 1]"),
      TWO("corner = [-2, -2, -1]; u = [4, 0, 0]; v = [0, 4, 0]",
          "type = \"box\"; corner = [0, 0, -1]; u = [1, 0, 0]; v = [0, 1, 0]; w = [0, 0, 1]; material = \"white\"; },"
          "{ type = \"box\"; corner = [0.5, 0.5, -1.0]; u = [1, 0, 0]; v = [0, 1, 0]; w = [0.0, 0.0, 0.7]"),
      TWO("type = \"cylinder\"; centre = [0, 0, -1]; axis = [0.0, 0.1, 2.0]; start = [1, 0, 0]; pieces = 7",
          "type = \"sphere\"; centre = [0.0, -1.5, 0.0]; radius = 0.3")};
  (void)state;
  for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
    char text[1024];
    room made;
    snprintf(text, sizeof text, "%s%s", GRID WHITE, texts[k]);
    room_make(&made, text);
    clt_scene_close(room_open(&made));
    room_remove(&made);
  }
}

/* Bytes changed, dropped and doubled at random: read or refused with a message, never worse. */
static void damaged_files(void **state) {
  (void)state;
  const char *const sound =
      GRID "projector = { tangent = [0.5, 0.4]; }; camera = { bits = 12; }; ambient = [0.1, 0.2, 0.3]; " WHITE WALL;
  const char signs[] = ";:=,.(){}[]#-+019eExaw \"\\@/*";
  uint64_t random = 11;
  for (int n = 0; n < 300; n++) {
    char text[1000];
    snprintf(text, sizeof text, "%s", sound);
    for (int k = 0; k < 3; k++) {
      size_t length = strlen(text), at = (size_t)(test_random(&random) * (double)(length - 1));
      double what = test_random(&random);
      if (what < 0.4) {
        text[at] = signs[(size_t)(test_random(&random) * (double)(sizeof signs - 1))];
      } else {
        memmove(&text[at + (what > 0.7)], &text[at + (what <= 0.7)], length - at);
      }
    }
    room made;
    room_make(&made, text);
    clt_scene_description *scene = calloc(1, sizeof *scene);
    clt_error error = {.status = CLT_OK};
    clt_status status = clt_scene_read(made.scene_path, scene, &error);
    room_remove(&made);
    assert_true(status == CLT_OK || (status == CLT_BAD_INPUT && strstr(error.message, "scene.cfg:") != NULL));
    clt_scene_description_finish(scene);
    free(scene);
  }
}

static void absent_file(void **state) {
  (void)state;
  clt_scene *scene = NULL;
  clt_error error = {.status = CLT_OK};
  assert_int_equal(clt_scene_open("/nowhere/scene.cfg", &scene, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "/nowhere/scene.cfg"));
}

/* The scenes of the repository are legal, and the projector lights all of their cells. */
static void shipped_scenes(void **state) {
  (void)state;
  const char *const names[] = {"dihedral", "corner", "flat"};
  for (int k = 0; k < 3; k++) {
    char path[1024];
    snprintf(path, sizeof path, "%s/config/scenes/%s.cfg", CLT_SOURCE_ROOT, names[k]);
    clt_scene_description *scene = calloc(1, sizeof *scene);
    clt_error error = {.status = CLT_OK};
    assert_ok(clt_scene_read(path, scene, &error), error);
    assert_int_equal(scene->channels, 3);
    for (int cell = 0; cell < scene->width * scene->height; cell++) {
      double solid_angle;
      clt_vector direction = clt_scene_ray(scene, cell, 0, &solid_angle);
      assert_true(
          clt_first_hit(scene->surfaces, scene->surface_count, scene->projector.pinhole.position, direction, -1).front);
    }
    clt_scene_description_finish(scene);
    free(scene);
  }
}

/* What is left out has the documented default. */
static void defaults(void **state) {
  (void)state;
  room made;
  room_make(&made, WHITE WALL);
  clt_scene_description *scene = calloc(1, sizeof *scene);
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_scene_read(made.scene_path, scene, &error), error);
  room_remove(&made);
  assert_int_equal(scene->width * 10000 + scene->height * 100 + scene->channels * 10 + scene->rays, 644838);
  assert_near(scene->projector.intensity[2], 30.0, 0.0);
  assert_near(scene->projector.black, 0.001, 0.0);
  assert_near(scene->projector.latency_s, 0.03, 1e-15);
  assert_near(scene->projector.refresh_s, 1.0 / 60.0, 1e-15);
  assert_int_equal(scene->projector.response.kind, CLT_CURVE_SRGB);
  assert_int_equal(scene->camera.response.kind, CLT_CURVE_LINEAR);
  assert_int_equal(scene->camera.black_level, 64);
  assert_int_equal(scene->camera.exposure_delay, 1);
  assert_near(scene->ambient[1], 0.002, 0.0);
  assert_near(scene->surfaces[0].albedo[2], 0.7, 0.0);
  clt_scene_description_finish(scene);
  free(scene);
}

/* A scene of nothing but a transport: T is the file's, the black gains ambient light and the panel's leak. */
static float pattern(int channel, size_t row, size_t column) {
  return 0.1f * (float)(channel + 1) * (row == column ? 5.0f : 1.0f / (1.0f + (float)(row + 2 * column)));
}

static void transport_alone(void **state) {
  (void)state;
  room made;
  room_make(&made, "transport_file = \"t.h5\";");
  room_add_transport(&made, 3, 2, 3, pattern, 0.25f);
  clt_scene *scene = room_open(&made);
  room_remove(&made);
  clt_error error = {.status = CLT_OK};
  clt_image drive, seen;
  assert_ok(clt_image_init(&drive, 3, 2, 3, &error), error);
  for (int k = 0; k < 18; k++) {
    drive.data[k] = 0.05f * (float)k;
  }
  assert_ok(clt_scene_appearance(scene, &drive, &seen, &error), error);
  for (int k = 0; k < 18; k++) {
    double sum = 0.0, leak = 0.0;
    for (int j = 0; j < 6; j++) {
      double entry = (double)pattern(k / 6, (size_t)(k % 6), (size_t)j);
      sum += entry * (double)drive.data[k / 6 * 6 + j];
      leak += entry * 0.001 / 0.999;
    }
    assert_near(clt_transport_black(clt_scene_transport(scene), k / 6)[k % 6], 0.252 + leak, 1e-7);
    assert_near(seen.data[k], 0.252 + leak + sum, 2e-7);
  }
  clt_image wrong = {.channels = 1, .height = 2, .width = 3, .data = drive.data}, none = {0};
  assert_int_equal(clt_scene_appearance(scene, &wrong, &none, &error), CLT_BAD_INPUT);
  clt_image_finish(&drive);
  clt_image_finish(&seen);
  clt_scene_close(scene);
}

/* Channels of equal and of different albedo are those of one-channel scenes; the panel's black takes its part of T. */
static void channels_are_independent(void **state) {
  (void)state;
  const char *const walls = "projector = { position = [0, -3, 0]; black = 0.25; }; "
                            "surfaces = ( { corner = [-2, -2, -2]; u = [2, 2, 0]; v = [0, 0, 4]; material = \"m\"; }, "
                            "{ corner = [0, 0, -2]; u = [2, -2, 0]; v = [0, 0, 4]; material = \"m\"; } );";
  const char *const albedos[] = {"[0.8, 0.3, 0.8]", "0.8", "0.3"};
  clt_scene *scenes[3];
  for (int k = 0; k < 3; k++) {
    char text[600];
    snprintf(text, sizeof text,
             "grid = { width = 6; height = 4; channels = %d; }; materials = ( { name = \"m\"; albedo = %s; } ); %s",
             k == 0 ? 3 : 1, albedos[k], walls);
    room made;
    room_make(&made, text);
    scenes[k] = room_open(&made);
    room_remove(&made);
  }
  for (int c = 0; c < 3; c++) {
    const clt_transport *all = clt_scene_transport(scenes[0]), *one = clt_scene_transport(scenes[c == 1 ? 2 : 1]);
    double sums[24];
    clt_transport_row_sums(one, 0, sums);
    for (int k = 0; k < 24 * 24; k++) {
      assert_near(clt_transport_entries(all, c)[k], clt_transport_entries(one, 0)[k], 1e-7);
    }
    for (int i = 0; i < 24; i++) {
      assert_near(clt_transport_black(all, c)[i], 0.002 + sums[i] / 3.0, 1e-6);
    }
  }
  for (int k = 0; k < 3; k++) {
    clt_scene_close(scenes[k]);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(mistakes_are_refused), cmocka_unit_test(neighbours_are_read),
      cmocka_unit_test(damaged_files),        cmocka_unit_test(absent_file),
      cmocka_unit_test(shipped_scenes),       cmocka_unit_test(defaults),
      cmocka_unit_test(transport_alone),      cmocka_unit_test(channels_are_independent),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
