/* A camera with a pose of its own. */
#include "room.h"
#include "sim/light.h"

enum { WIDTH = 12, HEIGHT = 9, CELLS = WIDTH * HEIGHT };

/* T of a description, CELLS x CELLS in float, and what was found out on the way. */
static void transport_of(const clt_scene_description *description, clt_light_facts *facts, float *entries) {
  clt_transport *transport = NULL;
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_transport(description, &transport, facts, &error), error);
  double unit[CELLS], column[CELLS];
  for (int j = 0; j < CELLS; j++) {
    memset(unit, 0, sizeof unit);
    unit[j] = 1.0;
    clt_transport_apply(transport, 0, unit, column);
    for (int i = 0; i < CELLS; i++) {
      entries[i * CELLS + j] = (float)column[i];
    }
  }
  clt_transport_destroy(transport);
}

static void place_camera(clt_scene_description *description, clt_vector position, clt_vector target, double tangent) {
  description->camera.placed = true;
  description->camera.pinhole = (clt_pinhole){.position = position, .tangent = {tangent, tangent}};
  assert_true(clt_pinhole_aim(&description->camera.pinhole, target, (clt_vector){0, 0, 1}));
}

static void describe_walls(clt_scene_description *walls) {
  describe_view(walls, WIDTH, HEIGHT, (clt_vector){0.06, -3.2, 0.03}, (clt_vector){0, 0, 0});
  add_surface(walls, (clt_vector){-1.25, -1.25, -1.3}, (clt_vector){1.25, 1.25, 0}, (clt_vector){0, 0, 2.6}, 0.7);
  add_surface(walls, (clt_vector){0, 0, -1.3}, (clt_vector){1.25, -1.25, 0}, (clt_vector){0, 0, 2.6}, 0.6);
}

static float reference[CELLS * CELLS], entries[CELLS * CELLS];

/* Of Lambertian walls that it sees wholly a camera sees the same from everywhere, and at the projector in any case. */
static void lambertian_walls_look_alike(void **state) {
  (void)state;
  const clt_vector places[] = {{0.06, -3.2, 0.03}, {0.8, -2.5, 0.4}, {-0.3, -1.5, -0.9}};
  clt_scene_description walls;
  clt_light_facts facts;
  describe_walls(&walls);
  transport_of(&walls, &facts, reference);
  for (int k = 0; k < 3; k++) {
    place_camera(&walls, places[k], (clt_vector){0, 0, 0}, 3.0);
    transport_of(&walls, &facts, entries);
    assert_memory_equal(entries, reference, sizeof reference);
    assert_int_equal(facts.occlusion.hidden + facts.occlusion.partly + facts.occlusion.shadowed, 0);
  }
  clt_scene_description_finish(&walls);
}

/* Where the segment from a place on the wall y = 0 to the camera passes the panel's plane y = -1. */
static bool panel_hides(clt_vector at, clt_vector eye) {
  double x = at.x + (eye.x - at.x) / -eye.y * 1.0, z = at.z + (eye.z - at.z) / -eye.y * 1.0;
  return x > 0.9 && x < 1.7 && z > -0.5 && z < 0.6;
}

/* A panel beside the projector's light hides from the camera the cells whose rays end behind it, by plain geometry:
 * rows of zeros; the mean over the rest of those in part; the others as before. */
static void panel_before_the_camera(void **state) {
  (void)state;
  const clt_vector eye = {2.5, -2.5, 0.2};
  clt_scene_description wall;
  clt_light_facts facts;
  describe_view(&wall, WIDTH, HEIGHT, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  add_surface(&wall, (clt_vector){-2, 0, -2}, (clt_vector){4, 0, 0}, (clt_vector){0, 0, 4}, 0.5);
  add_surface(&wall, (clt_vector){0.9, -1, -0.5}, (clt_vector){0.8, 0, 0}, (clt_vector){0, 0, 1.1}, 0.0);
  place_camera(&wall, eye, (clt_vector){0, 0, 0}, 3.0);
  transport_of(&wall, &facts, entries);
  int hidden = 0, partly = 0;
  for (int cell = 0; cell < CELLS; cell++) {
    double sum = 0.0, share = 0.0;
    int behind = 0;
    for (int ray = 0; ray < 16; ray++) {
      double omega;
      clt_vector direction = clt_scene_ray(&wall, cell, ray, &omega);
      clt_vector at = {3.0 * direction.x / direction.y, 0, 3.0 * direction.z / direction.y};
      double r = sqrt(at.x * at.x + 9.0 + at.z * at.z);
      bool seen = !panel_hides(at, eye);
      behind += !seen;
      sum += seen ? omega * 3.0 / (r * r * r) : 0.0;
      share += seen ? omega : 0.0;
    }
    hidden += behind == 16;
    partly += behind > 0 && behind < 16;
    assert_near(entries[cell * CELLS + cell], behind == 16 ? 0.0 : 0.5 / M_PI * 10.0 * sum / share, 1e-6);
  }
  assert_true(hidden > 5 && partly > 5);
  assert_int_equal(facts.occlusion.hidden, hidden);
  assert_int_equal(facts.occlusion.partly, partly);
  clt_scene_description_finish(&wall);
}

/* What lies beside or behind the camera is not seen, and a wall's back neither. */
static void beyond_the_image(void **state) {
  (void)state;
  clt_scene_description walls;
  clt_light_facts facts;
  describe_walls(&walls);
  transport_of(&walls, &facts, reference);
  place_camera(&walls, (clt_vector){0.5, -2.0, 0}, (clt_vector){0.5, -0.5, 0}, 0.2);
  transport_of(&walls, &facts, entries);
  int dark = 0, kept = 0;
  for (int i = 0; i < CELLS; i++) {
    bool zero = true, same = true;
    for (int j = 0; j < CELLS; j++) {
      zero = zero && entries[i * CELLS + j] == 0.0f;
      same = same && entries[i * CELLS + j] == reference[i * CELLS + j];
    }
    dark += zero;
    kept += same;
  }
  assert_int_equal(facts.occlusion.hidden, dark);
  assert_true(dark > CELLS / 2 && kept > 2 && dark + kept + facts.occlusion.partly == CELLS);
  clt_scene_description_finish(&walls);
}

/* Behind a screen between projector and wall lies a shadow, which a camera beside them sees: of the part of the wall
 * that the projector's picture covers, the part behind the screen. */
static void shadow_in_the_picture(void **state) {
  (void)state;
  clt_scene_description wall;
  clt_light_facts facts;
  describe_view(&wall, 60, 45, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  add_surface(&wall, (clt_vector){-2, 0, -2}, (clt_vector){4, 0, 0}, (clt_vector){0, 0, 4}, 0.5);
  add_surface(&wall, (clt_vector){-0.2, -1.5, -0.2}, (clt_vector){0, 0, 0.4}, (clt_vector){0.4, 0, 0}, 0.5);
  place_camera(&wall, (clt_vector){0, -1.4, 0}, (clt_vector){0, 0, 0}, 1.1);
  clt_transport *transport = NULL;
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_transport(&wall, &transport, &facts, &error), error);
  clt_transport_destroy(transport);
  double shadow = 0.8 * 0.8, picture = 4 * 3 * 0.44 * 3 * 0.33;
  assert_near(facts.occlusion.shadowed / (double)facts.occlusion.viewed, shadow / picture, 0.05 * shadow / picture);
  clt_scene_description_finish(&wall);
}

/* Surfaces that meet at an edge hide nothing of each other, though a ray through the edge meets both. */
static void edges_hide_nothing(void **state) {
  (void)state;
  clt_scene_description walls;
  clt_light_facts facts;
  describe_view(&walls, 8, 6, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  for (int k = 0; k < 8; k++) { /* strips whose edges pass through the middles of cells */
    add_surface(&walls, (clt_vector){-1.485 + 0.33 * k, 0, -2}, (clt_vector){0.33, 0, 0}, (clt_vector){0, 0, 4}, 0.5);
  }
  clt_transport *transport = NULL;
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_transport(&walls, &transport, &facts, &error), error);
  clt_transport_destroy(transport);
  assert_int_equal(facts.occlusion.shading, 0);
  clt_scene_description_finish(&walls);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(lambertian_walls_look_alike),
      cmocka_unit_test(panel_before_the_camera),
      cmocka_unit_test(beyond_the_image),
      cmocka_unit_test(shadow_in_the_picture),
      cmocka_unit_test(edges_hide_nothing),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
