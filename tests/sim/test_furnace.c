/* The furnace of whole scenes, through the public interface: B = 1 / (1 - albedo) in any closed room. */
#include "room.h"

static const char head[] =
    "grid = { width = 8; height = 6; channels = 1; };"
    "projector = { position = [0.11, 0.07, 0.05]; target = [0.2, 1.0, 0.1]; tangent = [0.6, 0.5]; };"
    "materials = ( { name = \"grey\"; albedo = 0.3; }, { name = \"white\"; albedo = 0.8; } );"
    "surfaces = (";

/* Opens such a scene, which takes a second or two. */
static clt_furnace furnace_of(const char *surfaces, double albedo) {
  char text[2048];
  room made;
  clt_furnace found;
  clt_error error;
  snprintf(text, sizeof text, "%s%s);", head, surfaces);
  room_make(&made, text);
  clt_scene *scene = room_open(&made);
  assert_ok(clt_scene_furnace(scene, albedo, &found, &error), error);
  assert_true(found.elements > 100);
  clt_scene_close(scene);
  room_remove(&made);
  return found;
}

/* A long box askew, a box with a box in it, a box of six rectangles in two colours, and a ball from inside. */
static void closed_rooms_glow_evenly(void **state) {
  static const char *const rooms[] = {
      "{ type = \"box\"; facing = \"in\"; corner = [-1.0, -0.8, -0.4]; u = [4.0, 0.4, 0.0]; v = [-0.2, 2.0, 0.0];"
      "  w = [0.0, 0.0, 0.9]; material = \"white\"; }",
      "{ type = \"box\"; facing = \"in\"; corner = [-1, -1, -1]; u = [3, 0, 0]; v = [0, 3, 0]; w = [0, 0, 2];"
      "  material = \"white\"; }, { type = \"box\"; corner = [0.5, 0.9, -0.6]; u = [0.5, 0.1, 0.0];"
      "  v = [-0.1, 0.5, 0.0]; w = [0.0, 0.0, 0.7]; material = \"grey\"; }",
      "{ corner = [-1, -1, -1]; u = [2, 0, 0]; v = [0, 3, 0]; material = \"grey\"; },"
      "{ corner = [-1, -1, 1]; u = [0, 3, 0]; v = [2, 0, 0]; material = \"white\"; },"
      "{ corner = [-1, 2, -1]; u = [2, 0, 0]; v = [0, 0, 2]; material = \"grey\"; },"
      "{ corner = [-1, -1, -1]; u = [0, 0, 2]; v = [2, 0, 0]; material = \"white\"; },"
      "{ corner = [-1, -1, -1]; u = [0, 3, 0]; v = [0, 0, 2]; material = \"grey\"; },"
      "{ corner = [1, -1, -1]; u = [0, 0, 2]; v = [0, 3, 0]; material = \"white\"; }",
      "{ type = \"sphere\"; facing = \"in\"; centre = [0, 0, 0]; radius = 1.5; rings = 4; pieces = 6;"
      "  material = \"white\"; }"};
  const double albedos[] = {0.62, 0.99, 0.9, 0.3};
  (void)state;
  for (size_t k = 0; k < sizeof rooms / sizeof rooms[0]; k++) {
    clt_furnace found = furnace_of(rooms[k], albedos[k]);
    double wanted = 1.0 / (1.0 - albedos[k]);
    assert_near(found.least / wanted, 1.0, 1e-6);
    assert_near(found.greatest / wanted, 1.0, 1e-6);
  }
}

/* Two unit squares opposite each other, 1 m apart: each sees .19982 of the other (Howell, C-11), so that the mean lies
 * at 1 / (1 - .19982 m); every element is between what a lone wall and a closed room show. */
static void open_rooms_glow_less(void **state) {
  static const char plates[] = "{ corner = [0, 1, 0]; u = [1, 0, 0]; v = [0, 0, 1]; material = \"white\"; },"
                               "{ corner = [0, 0, 0]; u = [0, 0, 1]; v = [1, 0, 0]; material = \"white\"; }";
  (void)state;
  for (int m = 1; m < 10; m += 8) {
    clt_furnace found = furnace_of(plates, 0.1 * m);
    double mean = 1.0 / (1.0 - 0.0199825 * m);
    assert_true(found.least > 1.0 && found.least < mean);
    assert_true(found.greatest > mean && found.greatest < 1.0 / (1.0 - 0.1 * m));
  }
}

static void what_cannot_glow_is_refused(void **state) {
  room made;
  clt_furnace found;
  clt_error error;
  char text[1024];
  (void)state;
  snprintf(text, sizeof text, "%s{ corner = [-1, 1, -1]; u = [2, 0, 0]; v = [0, 0, 2]; material = \"white\"; });",
           head);
  room_make(&made, text);
  clt_scene *scene = room_open(&made);
  assert_int_equal(clt_scene_furnace(scene, 0.5, &found, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "no surfaces exchange light"));
  assert_int_equal(clt_scene_furnace(scene, 1.0, &found, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_scene_furnace(scene, NAN, &found, &error), CLT_BAD_INPUT);
  clt_scene_close(scene);
  room_remove(&made);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(closed_rooms_glow_evenly), cmocka_unit_test(open_rooms_glow_less),
                                     cmocka_unit_test(what_cannot_glow_is_refused)};
  return cmocka_run_group_tests_name("furnace", tests, NULL, NULL);
}
