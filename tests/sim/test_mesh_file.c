#include "sim/mesh_file.h"

#include "room.h"
#include "sim/formfactor.h"
#include "sim/light.h"

#define CUBE                                                                                                           \
  "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"                                           \
  "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"

static const double grey[CLT_SIM_CHANNELS_MAX] = {0.5, 0.5, 0.5};

static clt_status add_text(clt_scene_description *scene, const char *text, const clt_mesh_place *place,
                           clt_facing facing, clt_error *error) {
  char folder[64], path[96];
  test_folder(folder);
  snprintf(path, sizeof path, "%s/mesh.obj", folder);
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  clt_status status = clt_mesh_file_add(scene, path, place, facing, grey, error);
  unlink(path);
  rmdir(folder);
  return status;
}

static clt_scene_description *read_cube(clt_facing facing) {
  clt_scene_description *scene = calloc(1, sizeof *scene);
  clt_error error = {.status = CLT_OK};
  clt_mesh_place place = {{1, 2, 3}, 0.5, false};
  clt_status status = add_text(scene, CUBE, &place, facing, &error);
  if (status == CLT_FAILED) { /* a build without meshes */
    clt_scene_description_finish(scene);
    free(scene);
    skip();
  }
  assert_ok(status, error);
  return scene;
}

/* Six quadrilaterals are twelve triangles; area and enclosed volume (Gauss) are those of the placed cube. */
static void a_cube_of_triangles(void **state) {
  (void)state;
  for (int k = 0; k < 2; k++) {
    clt_scene_description *scene = read_cube(k == 0 ? CLT_FACING_OUT : CLT_FACING_IN);
    double area = 0.0, volume = 0.0;
    assert_int_equal(scene->surface_count, 12);
    for (int n = 0; n < 12; n++) {
      const clt_rectangle *side = &scene->surfaces[n];
      area += clt_rectangle_area(side);
      volume += clt_rectangle_area(side) * vec_dot(clt_rectangle_centre(side), side->normal) / 3.0;
      assert_true(clt_rectangle_centre(side).x >= 1.0 && clt_rectangle_centre(side).z <= 3.5);
    }
    assert_near(area, 1.5, 1e-12);
    assert_near(volume, k == 0 ? 0.125 : -0.125, 1e-12);
    clt_scene_description_finish(scene);
    free(scene);
  }
}

/* From a wall to the others, as triangles, undivided and uncorrected: 1/5 each (Howell, C-11 and C-14 of squares). */
static void triangles_exchange_as_squares_do(void **state) {
  (void)state;
  clt_scene_description *scene = read_cube(CLT_FACING_IN);
  for (int i = 0; i < 12; i++) {
    double opposed = 0.0, adjacent = 0.0;
    for (int j = 0; j < 12; j++) {
      double facing = vec_dot(scene->surfaces[i].normal, scene->surfaces[j].normal);
      double exchanged = clt_formfactor_exchange(&scene->surfaces[i], &scene->surfaces[j]);
      assert_near(exchanged, clt_formfactor_exchange(&scene->surfaces[j], &scene->surfaces[i]), 1e-6);
      opposed += facing < -0.5 ? exchanged : 0.0;
      adjacent += fabs(facing) < 0.5 ? exchanged : 0.0;
    }
    assert_near(opposed / clt_rectangle_area(&scene->surfaces[i]), 0.199825, 2e-4);
    assert_near((opposed + adjacent) / clt_rectangle_area(&scene->surfaces[i]), 1.0, 1e-4);
  }
  clt_scene_description_finish(scene);
  free(scene);
}

/* Share of a cell's rays that end in an element, or on its edge. */
static double share_within(const clt_layout *layout, const clt_ray_end *ends, int number) {
  const clt_scene_description *scene = layout->description;
  const clt_rectangle *element = &layout->mesh.elements[number];
  double share = 0.0;
  for (int ray = 0; ray < scene->rays * scene->rays; ray++) {
    const clt_ray_end *end = &ends[ray];
    if (end->surface == layout->mesh.surface[number]) {
      const clt_rectangle *surface = &scene->surfaces[end->surface];
      clt_vector from = vec_add(vec_along(surface->corner, end->s, surface->u, end->t, surface->v), element->normal);
      clt_hit hit = clt_hit_on_plane(element, from, vec_scale(-1.0, element->normal));
      share += hit.s >= -1e-9 && hit.t >= -1e-9 && hit.s + hit.t <= 1.0 + 1e-9 ? end->share : 0.0;
    }
  }
  return share;
}

/* The elements that the triangles are divided into cover them, and every ray's end lies in an element that the cell is
 * said to light, by the share of those that end in it. */
static void ends_lie_in_their_elements(const clt_scene_description *scene) {
  clt_light light = {0};
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_init(&light, scene, &error), error);
  const clt_mesh *mesh = &light.layout.mesh;
  double area = 0.0;
  for (int k = 0; k < mesh->count; k++) {
    area += clt_rectangle_area(&mesh->elements[k]);
  }
  for (int k = 0; k < scene->surface_count; k++) {
    area -= clt_rectangle_area(&scene->surfaces[k]);
  }
  assert_near(area, 0.0, 1e-9);
  for (int cell = 0; cell < mesh->cells; cell++) {
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    double there = 0.0, listed = 0.0;
    clt_cell_trace(scene, light.layout.visibility, cell, ends);
    for (int ray = 0; ray < scene->rays * scene->rays; ray++) {
      there += ends[ray].surface >= 0 ? ends[ray].share : 0.0;
    }
    for (int k = mesh->lights.start[cell]; k < mesh->lights.start[cell + 1]; k++) {
      double within = share_within(&light.layout, ends, mesh->lights.element[k]);
      listed += mesh->lights.weight[k];
      assert_true(mesh->lights.weight[k] > 0.0 && mesh->lights.weight[k] <= within + 1e-12);
    }
    assert_near(listed, there, 1e-12);
  }
  clt_light_finish(&light);
}

/* T of walls that are triangles is T of the walls as rectangles, but for how they are divided: next to the fold light
 * changes within an element. The two differ by 1.2 % there, and by 0.3 % with four times as many elements. */
static void divided_triangles_light_alike(void **state) {
  (void)state;
  static clt_scene_description walls, triangles;
  describe_view(&walls, 6, 4, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  describe_view(&triangles, 6, 4, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  add_surface(&walls, (clt_vector){-2, -2, -2}, (clt_vector){2, 2, 0}, (clt_vector){0, 0, 4}, 0.5);
  add_surface(&walls, (clt_vector){0, 0, -2}, (clt_vector){2, -2, 0}, (clt_vector){0, 0, 4}, 0.5);
  clt_mesh_place place = {{0, 0, 0}, 1.0, false};
  clt_error error = {.status = CLT_OK};
  clt_status status =
      add_text(&triangles, "v -2 -2 -2\nv 0 0 -2\nv 0 0 2\nv -2 -2 2\nv 2 -2 -2\nv 2 -2 2\nf 1 2 3 4\nf 2 5 6 3\n",
               &place, CLT_FACING_OUT, &error);
  if (status == CLT_FAILED) {
    skip();
  }
  assert_ok(status, error);
  ends_lie_in_their_elements(&triangles);
  clt_transport *t[2] = {NULL, NULL};
  clt_light_facts facts;
  assert_ok(clt_light_transport(&walls, &t[0], &facts, &error), error);
  assert_ok(clt_light_transport(&triangles, &t[1], &facts, &error), error);
  double sums[2][24];
  for (int k = 0; k < 2; k++) {
    clt_transport_row_sums(t[k], 0, sums[k]);
    clt_transport_destroy(t[k]);
  }
  for (int i = 0; i < 24; i++) {
    assert_near(sums[1][i], sums[0][i], 0.015 * sums[0][i]);
  }
  clt_scene_description_finish(&walls);
  clt_scene_description_finish(&triangles);
}

static void mistakes_are_refused(void **state) {
  (void)state;
  const char *const refusals[][2] = {
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "mesh.obj"},
      {"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "not a number"},
      {"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no area"},
      {"this is no mesh", "mesh.obj"},
  };
  clt_scene_description *scene = read_cube(CLT_FACING_OUT); /* skips where meshes are not read */
  scene->surface_count = 0;
  clt_mesh_place place = {{0, 0, 0}, 1.0, false};
  for (size_t k = 0; k < sizeof refusals / sizeof refusals[0]; k++) {
    clt_error error = {.status = CLT_OK};
    clt_status status = add_text(scene, refusals[k][0], &place, CLT_FACING_OUT, &error);
    if (status != CLT_BAD_INPUT || strstr(error.message, refusals[k][1]) == NULL || scene->surface_count != 0) {
      fail_msg("%s\ngave %s: %s", refusals[k][0], clt_status_name(status), error.message);
    }
  }
  scene->surface_count = CLT_SURFACES_MAX - 11;
  clt_error error = {.status = CLT_OK};
  assert_int_equal(add_text(scene, CUBE, &place, CLT_FACING_OUT, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "too many triangles"));
  assert_int_equal(scene->surface_count, CLT_SURFACES_MAX - 11);
  clt_scene_description_finish(scene);
  free(scene);
}

/* A scene file names the mesh relative to itself, and says where a wrong one is. */
static void scene_files_name_meshes(void **state) {
  (void)state;
  clt_scene_description *cube = read_cube(CLT_FACING_OUT); /* skips where meshes are not read */
  clt_scene_description_finish(cube);
  free(cube);
  room made;
  room_make(&made, "grid = { width = 4; height = 3; }; materials = ( { name = \"m\"; } );\n"
                   "surfaces = (\n{ type = \"mesh\"; file = \"absent.obj\"; material = \"m\"; } );");
  clt_scene_description *scene = calloc(1, sizeof *scene);
  clt_error error = {.status = CLT_OK};
  clt_status status = clt_scene_read(made.scene_path, scene, &error);
  room_remove(&made);
  assert_int_equal(status, CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "scene.cfg:3: file: "));
  assert_non_null(strstr(error.message, "absent.obj"));
  clt_scene_description_finish(scene);
  free(scene);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_cube_of_triangles),           cmocka_unit_test(triangles_exchange_as_squares_do),
      cmocka_unit_test(divided_triangles_light_alike), cmocka_unit_test(mistakes_are_refused),
      cmocka_unit_test(scene_files_name_meshes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
