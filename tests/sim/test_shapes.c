#include "sim/shapes.h"

#include "room.h"

static const double grey[CLT_SIM_CHANNELS_MAX] = {0.5, 0.4, 0.3};

/* Area of the surfaces from number first on, their directed area, and the volume that they enclose, negative where they
 * face in (Gauss: a third of the integral of x . n). */
typedef struct measures {
  double area, volume;
  clt_vector directed;
} measures;

static measures measure(const clt_scene_description *scene, int first) {
  measures found = {.area = 0.0};
  for (int k = first; k < scene->surface_count; k++) {
    const clt_rectangle *side = &scene->surfaces[k];
    double area = clt_rectangle_area(side);
    found.area += area;
    found.volume += area * vec_dot(clt_rectangle_centre(side), side->normal) / 3.0;
    found.directed = vec_add(found.directed, vec_scale(area, side->normal));
    assert_near(side->albedo[2], grey[2], 0.0);
  }
  return found;
}

static clt_scene_description *empty_scene(void) {
  clt_scene_description *scene = calloc(1, sizeof *scene);
  assert_non_null(scene);
  return scene;
}

/* A box given by left-handed edges is no different from one given by right-handed ones. */
static void boxes_are_closed(void **state) {
  (void)state;
  const clt_vector corner = {0.3, -1.0, 2.0};
  const clt_vector edges[2][3] = {{{2, 0, 0}, {0, 1.8, 2.4}, {0, -0.4, 0.3}},
                                  {{0, 1.8, 2.4}, {2, 0, 0}, {0, -0.4, 0.3}}};
  for (int k = 0; k < 4; k++) {
    clt_scene_description *scene = empty_scene();
    clt_facing facing = k / 2 == 0 ? CLT_FACING_OUT : CLT_FACING_IN;
    assert_true(clt_shape_box(scene, corner, edges[k % 2], facing, grey));
    assert_int_equal(scene->surface_count, 6);
    measures found = measure(scene, 0);
    assert_near(found.area, 2 * (2.0 * 3.0 + 2.0 * 0.5 + 3.0 * 0.5), 1e-12);
    assert_near(found.volume, facing == CLT_FACING_OUT ? 3.0 : -3.0, 1e-12);
    assert_near(vec_length(found.directed), 0.0, 1e-12);
    clt_scene_description_finish(scene);
    free(scene);
  }
}

/* A prism of n sides: each side a chord; the directed area of an arc is its height times its chord, across the axis. */
static void cylinders_are_prisms(void **state) {
  (void)state;
  clt_cylinder all = {{1, 2, 3}, {0, 0, 1.5}, {0.4, 0, 0}, 2 * M_PI, 12}, half = all;
  half.arc = M_PI;
  clt_scene_description *scene = empty_scene();
  assert_true(clt_shape_cylinder(scene, &all, CLT_FACING_OUT, grey));
  measures found = measure(scene, 0);
  assert_near(found.area, 12 * 2 * 0.4 * sin(M_PI / 12) * 1.5, 1e-12);
  assert_near(vec_length(found.directed), 0.0, 1e-12);
  for (int k = 0; k < 12; k++) {
    clt_vector from_axis = vec_sub(clt_rectangle_centre(&scene->surfaces[k]), (clt_vector){1, 2, 3.75});
    assert_near(vec_dot(from_axis, scene->surfaces[k].normal), 0.4 * cos(M_PI / 12), 1e-12);
  }
  assert_true(clt_shape_cylinder(scene, &half, CLT_FACING_IN, grey));
  found = measure(scene, 12);
  assert_near(found.directed.x, 0.0, 1e-12);
  assert_near(found.directed.y, -0.8 * 1.5, 1e-12); /* from +x over +y to -x, seen from within */
  clt_scene_description_finish(scene);
  free(scene);
}

static void what_does_not_fit_is_left_out(void **state) {
  (void)state;
  clt_scene_description *scene = empty_scene();
  clt_cylinder many = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, 2 * M_PI, CLT_SURFACES_MAX - 5};
  const clt_vector edges[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  assert_true(clt_shape_cylinder(scene, &many, CLT_FACING_OUT, grey));
  assert_false(clt_shape_box(scene, edges[0], edges, CLT_FACING_OUT, grey));
  assert_int_equal(scene->surface_count, CLT_SURFACES_MAX - 5);
  clt_scene_description_finish(scene);
  free(scene);
}

#define START                                                                                                          \
  "grid = { width = 4; height = 3; }; projector = { position = [0, -3, 0]; target = [0, 0, 0]; };\n"                   \
  "materials = ( { name = \"m\"; } );\n"
#define BOX "corner = [-1, -1, -1]; u = [2, 0, 0]; v = [0, 2, 0]; w = [0, 0, 2]; material = \"m\";"
#define PIPE "type = \"cylinder\"; centre = [0, 0, 0]; start = [1, 0, 0]; material = \"m\"; "

#define BALL "type = \"sphere\"; centre = [0, 0, 0]; material = \"m\"; "

/* A mistake is refused with its line and what to change. */
static void mistakes_are_refused(void **state) {
  (void)state;
  const struct {
    const char *text, *where, *why;
  } refusals[] = {
      {START "surfaces = ( { type = \"cone\"; material = \"m\"; } );", "scene.cfg:3: type", "\"rectangle\", \"box\""},
      {START "surfaces = (\n{ type = \"box\"; corner = [0, 0, 0]; u = [1, 0, 0]; v = [0, 1, 0]; material = \"m\"; } );",
       "scene.cfg:4:", "a box needs w"},
      {START "surfaces = ( { type = \"box\"; " BOX
             " },\n{ type = \"box\"; corner = [0, 0, 0]; u = [1, 0, 0]; v = [0, 1, 0]; "
             "w = [0, 1, 1]; material = \"m\"; } );",
       "scene.cfg:4: u", "perpendicular"},
      {START "surfaces = ( { type = \"box\"; corner = [0, 0, 0]; u = [1, 0, 0]; v = [0, 1, 0]; w = [0, 0, 0]; "
             "material = \"m\"; } );",
       "scene.cfg:3: u", "longer than 1e-6"},
      {START "surfaces = ( { type = \"box\"; facing = \"up\"; " BOX " } );", "scene.cfg:3: facing", "\"out\", \"in\""},
      {START "surfaces = ( { type = \"box\"; pieces = 7; " BOX " } );", "scene.cfg:3: pieces", "not a known key"},
      {START "surfaces = ( { " PIPE "axis = [1, 0, 1]; } );", "scene.cfg:3: axis", "perpendicular"},
      {START "surfaces = ( { " PIPE "axis = [0, 0, 1]; arc = 400.0; } );", "scene.cfg:3: arc", "1 to 360"},
      {START "surfaces = ( { " PIPE "axis = [0, 0, 1]; pieces = 2; } );", "scene.cfg:3: pieces", "3 to 360"},
      {START "surfaces = ( { type = \"cylinder\"; centre = [0.0, 0.0, 0.0]; start = [0.001, 0.0, 0.0]; "
             "material = \"m\"; axis = [0, 0, 1]; arc = 1.0; pieces = 360; } );",
       "scene.cfg:3: start", "less than 1e-6 wide"},
      {START "surfaces = ( { " BALL "} );", "scene.cfg:3:", "a sphere needs radius"},
      {START "surfaces = ( { type = \"sphere\"; radius = 1; material = \"m\"; } );",
       "scene.cfg:3:", "a sphere needs centre"},
      {START "surfaces = ( { " BALL "radius = 0; } );", "scene.cfg:3: radius", "0.001 to 1000"},
      {START "surfaces = ( { " BALL "radius = 1; from = 200.0; } );", "scene.cfg:3: from", "0 to 180"},
      {START "surfaces = ( { " BALL "radius = 1; from = 90.0; to = 80.0; } );", "scene.cfg:3: to",
       "at least 1 degree above from"},
      {START "surfaces = ( { " BALL "radius = 1; axis = [1, 0, 1]; } );", "scene.cfg:3: axis", "perpendicular"},
      {START "surfaces = ( { " BALL "radius = 1; rings = 1; } );", "scene.cfg:3: rings", "2 to 360"},
      {START "surfaces = ( { " BALL "radius = 1; pieces = 2; } );", "scene.cfg:3: pieces", "3 to 360"},
      {START "surfaces = ( { " BALL "radius = 1; facing = \"up\"; } );", "scene.cfg:3: facing", "\"out\", \"in\""},
      {START "surfaces = ( { " BALL "radius = 1; rings = 40; pieces = 60; } );", "scene.cfg:3:", "does not fit"},
      {START "surfaces = ( { " BALL "radius = 0.001; from = 1.0; arc = 1.0; rings = 1; pieces = 360; } );",
       "scene.cfg:3: pieces", "without area"},
      {"grid = { width = 4; height = 3; };\nprojector = { position = [0.2, 0.1, 0.3]; target = [0.0, 1.0, 0.0]; };\n"
       "materials = ( { name = \"m\"; } ); surfaces = ( { " BALL "radius = 1; } );",
       "scene.cfg:2: projector", "inside an object"},
      {"grid = { width = 4; height = 3; };\nprojector = { position = [0.2, 0.1, 0.3]; target = [0.0, 1.0, 0.0]; };\n"
       "materials = ( { name = \"m\"; } ); surfaces = ( { type = \"box\"; " BOX " } );",
       "scene.cfg:2: projector", "inside an object"},
  };
  for (size_t k = 0; k < sizeof refusals / sizeof refusals[0]; k++) {
    room made;
    room_make(&made, refusals[k].text);
    clt_scene_description *scene = empty_scene();
    clt_error error = {.status = CLT_OK};
    clt_status status = clt_scene_read(made.scene_path, scene, &error);
    room_remove(&made);
    if (status != CLT_BAD_INPUT || strstr(error.message, refusals[k].where) == NULL ||
        strstr(error.message, refusals[k].why) == NULL) {
      fail_msg("%s\ngave %s: %s", refusals[k].text, clt_status_name(status), error.message);
    }
    clt_scene_description_finish(scene);
    free(scene);
  }
}

/* Every shipped scene is legal, and most of the projector's rays meet the fronts of surfaces. */
static void shipped_scenes_are_lit(void **state) {
  (void)state;
  const char *const names[] = {"box2",     "box3", "box4", "box5",    "box6",   "cornell", "corner",
                               "dihedral", "dome", "flat", "gallery", "shadow", "small",   "stage"};
  for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
    char path[1024];
    snprintf(path, sizeof path, CLT_SOURCE_ROOT "/config/scenes/%s.cfg", names[k]);
    clt_scene_description *scene = empty_scene();
    clt_error error = {.status = CLT_OK};
    assert_ok(clt_scene_read(path, scene, &error), error);
    int cells = scene->width * scene->height, lit = 0;
    scene->rays = 1;
    for (int cell = 0; cell < cells; cell++) {
      double solid_angle;
      clt_vector direction = clt_scene_ray(scene, cell, 0, &solid_angle);
      lit +=
          clt_first_hit(scene->surfaces, scene->surface_count, scene->projector.pinhole.position, direction, -1).front;
    }
    if (lit < 0.85 * cells) {
      fail_msg("%s: only %d of %d cells are lit", names[k], lit, cells);
    }
    clt_scene_description_finish(scene);
    free(scene);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(boxes_are_closed),       cmocka_unit_test(cylinders_are_prisms),
      cmocka_unit_test(mistakes_are_refused),   cmocka_unit_test(what_does_not_fit_is_left_out),
      cmocka_unit_test(shipped_scenes_are_lit),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
