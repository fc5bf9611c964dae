#include "sim/light.h"

#include <hdf5.h>
#include <lapacke.h>

#include "room.h"

/* T of a description's channel in double, cells x cells. */
static double *solve_transport(clt_light *light, const clt_scene_description *description, int channel) {
  clt_error error = {.status = CLT_OK};
  if (light->layout.description == NULL) {
    assert_ok(clt_light_init(light, description, &error), error);
  }
  assert_ok(clt_light_solve(light, channel, &error), error);
  size_t cells = (size_t)light->layout.cells.count;
  double *transport = calloc(cells * cells, sizeof *transport);
  double *scratch = calloc((size_t)light->layout.mesh.used + 1, sizeof *scratch);
  assert_true(transport != NULL && scratch != NULL);
  for (size_t i = 0; i < cells; i++) {
    clt_light_row(light, channel, (int)i, &transport[i * cells], scratch);
  }
  free(scratch);
  return transport;
}

/* Two walls at a right angle around the z axis, as the shared reference has them. */
static void describe_dihedral(clt_scene_description *description, int width, int height, double albedo) {
  describe_view(description, width, height, (clt_vector){0.06, -3.2, 0.03}, (clt_vector){0, 0, 0});
  add_surface(description, (clt_vector){-1.25, -1.25, -1.3}, (clt_vector){1.25, 1.25, 0}, (clt_vector){0, 0, 2.6},
              albedo);
  add_surface(description, (clt_vector){0, 0, -1.3}, (clt_vector){1.25, -1.25, 0}, (clt_vector){0, 0, 2.6}, albedo);
}

/* Red, green and white walls with a panel standing in front of them. */
static void describe_corner(clt_scene_description *description) {
  describe_view(description, 12, 9, (clt_vector){2.6, 2.6, 1.9}, (clt_vector){0.3, 0.3, 0.45});
  description->channels = 3;
  add_surface(description, (clt_vector){0, 0, 0}, (clt_vector){0, 2.4, 0}, (clt_vector){0, 0, 2}, 0.7);
  add_surface(description, (clt_vector){0, 0, 0}, (clt_vector){0, 0, 2}, (clt_vector){2.4, 0, 0}, 0.6);
  add_surface(description, (clt_vector){0, 0, 0}, (clt_vector){2.4, 0, 0}, (clt_vector){0, 2.4, 0}, 0.8);
  add_surface(description, (clt_vector){0.9, 0.3, 0.2}, (clt_vector){-0.5, 0.5, 0}, (clt_vector){0, 0, 0.7}, 0.9);
  description->surfaces[0].albedo[1] = 0.1;
  description->surfaces[1].albedo[0] = 0.2;
}

static double h_value(const clt_light *light, size_t i, size_t j) {
  size_t row = i < j ? i : j, column = i < j ? j : i;
  return i == j ? 0.0 : light->exchange[column * (size_t)light->layout.mesh.count + row];
}

/* The picture's axes are those that the reference states, and row 0 is at the top. */
static void projector_axes(void **state) {
  (void)state;
  clt_scene_description view;
  describe_view(&view, 32, 24, (clt_vector){0.06, -3.2, 0.03}, (clt_vector){0, 0, 0});
  const clt_pinhole *pinhole = &view.projector.pinhole;
  const double wanted[] = {0.9998242650849972,     0.018746704970343697, 0.0,
                           -0.0001757117547978287, 0.00937129358921753,  0.9999560730261323};
  const double axes[] = {pinhole->right.x, pinhole->right.y, pinhole->right.z,
                         pinhole->up.x,    pinhole->up.y,    pinhole->up.z};
  for (int k = 0; k < 6; k++) {
    assert_near(axes[k], wanted[k], 1e-14);
  }
  double total = 0.0;
  for (int cell = 0; cell < 32 * 24; cell++) {
    for (int ray = 0; ray < 16; ray++) {
      double solid_angle;
      clt_vector direction = clt_scene_ray(&view, cell, ray, &solid_angle);
      total += solid_angle;
      assert_true((cell / 32 < 12) == (vec_dot(direction, pinhole->up) > 0));
      assert_true((cell % 32 >= 16) == (vec_dot(direction, pinhole->right) > 0));
    }
  }
  double a = 0.44, b = 0.33; /* of a rectangle seen along its axis: 4 asin of the product of the half-angles' sines */
  assert_near(total, 4 * asin(a * b / sqrt((1 + a * a) * (1 + b * b))), 1e-5);
  clt_scene_description_finish(&view);
}

/* Mean direct radiance over a cell of an 8 x 6 picture that meets a wall of albedo 0.5 squarely at 3 m. With
 * s = 1 + x^2 + y^2 on the image plane: cos / r^2 = s^-3/2 / 9, d omega = s^-3/2 dx dy. */
static double square_wall_direct(int cell) {
  enum { FINE = 40 };
  double light = 0.0, weight = 0.0;
  for (int k = 0; k < FINE * FINE; k++) {
    double x = 0.44 * ((cell % 8 + (k % FINE + 0.5) / FINE) / 4 - 1);
    double y = 0.33 * (1 - (cell / 8 + (k / FINE + 0.5) / FINE) / 3);
    double s = pow(1 + x * x + y * y, -1.5);
    light += s * s / 9.0;
    weight += s;
  }
  return 0.5 / M_PI * 10.0 * light / weight;
}

static void flat_wall_is_diagonal(void **state) {
  (void)state;
  clt_scene_description wall;
  describe_view(&wall, 8, 6, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  add_surface(&wall, (clt_vector){-2, 0, -2}, (clt_vector){4, 0, 0}, (clt_vector){0, 0, 4}, 0.5);
  clt_light light = {0};
  double *transport = solve_transport(&light, &wall, 0);
  for (int i = 0; i < 48; i++) {
    double direct = square_wall_direct(i);
    for (int j = 0; j < 48; j++) {
      assert_near(transport[i * 48 + j], i == j ? direct : 0.0, 2e-4 * direct);
    }
  }
  free(transport);
  clt_light_finish(&light);
  clt_scene_description_finish(&wall);
}

/* Only surfaces that exchange light which reaches the picture are divided; where there are none, nothing is computed
 * beside direct light. */
static void only_what_exchanges_is_meshed(void **state) {
  (void)state;
  /* wall and floor; with a screen between; with a black floor; with two walls out of sight that nothing lights */
  for (int k = 0; k < 4; k++) {
    clt_scene_description scene;
    describe_view(&scene, 8, 6, (clt_vector){0, -3, 1}, (clt_vector){0, 0, 1});
    add_surface(&scene, (clt_vector){-2, 0, 0}, (clt_vector){4, 0, 0}, (clt_vector){0, 0, 2}, 0.5);
    add_surface(&scene, (clt_vector){-2, -9, -1}, (clt_vector){4, 0, 0}, (clt_vector){0, 9, 0}, k == 2 ? 0.0 : 0.5);
    if (k == 1) {
      add_surface(&scene, (clt_vector){-20, -20, -0.5}, (clt_vector){0, 40, 0}, (clt_vector){40, 0, 0}, 0.5);
    }
    if (k == 3) {
      add_surface(&scene, (clt_vector){-1, 8, 3}, (clt_vector){0, 0, 1}, (clt_vector){0, 1, 0}, 0.5);
      add_surface(&scene, (clt_vector){-2, 8, 3}, (clt_vector){0, 1, 0}, (clt_vector){0, 0, 1}, 0.5);
      scene.surfaces[1].albedo[0] = 0.0;
    }
    clt_light light = {0};
    clt_error error = {.status = CLT_OK};
    assert_ok(clt_light_init(&light, &scene, &error), error);
    assert_int_equal(light.layout.sights.exchanging, k == 0 ? 2 : 0);
    assert_true((light.layout.mesh.count > 0) == (k == 0) && (light.exchange != NULL) == (k == 0));
    clt_light_finish(&light);
    clt_scene_description_finish(&scene);
  }
}

/* Rows of G sum to at most 1, and to 1 in a closed box. */
static void row_sums_of_a_box(void **state) {
  (void)state;
  clt_scene_description box;
  describe_view(&box, 4, 3, (clt_vector){0.5, 0.1, 0.5}, (clt_vector){0.5, 1, 0.5});
  clt_vector o = {0, 0, 0}, e = {1, 1, 1}, x = {1, 0, 0}, y = {0, 1, 0}, z = {0, 0, 1};
  clt_vector minus_x = {-1, 0, 0}, minus_y = {0, -1, 0}, minus_z = {0, 0, -1};
  add_surface(&box, o, x, y, 0.5);
  add_surface(&box, o, y, z, 0.5);
  add_surface(&box, o, z, x, 0.5);
  add_surface(&box, e, minus_y, minus_x, 0.5);
  add_surface(&box, e, minus_z, minus_y, 0.5);
  add_surface(&box, e, minus_x, minus_z, 0.5);
  clt_light light = {0};
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_init(&light, &box, &error), error);
  for (size_t i = 0; i < (size_t)light.layout.mesh.count; i++) {
    double sum = 0.0;
    for (size_t j = 0; j < (size_t)light.layout.mesh.count; j++) {
      sum += h_value(&light, i, j);
    }
    sum /= clt_rectangle_area(&light.layout.mesh.elements[i]);
    assert_near(sum, 1.0, 1e-10);
  }
  clt_light_finish(&light);
  clt_scene_description_finish(&box);
}

/* omega_i T_ij = omega_j T_ji, in scenes with several walls, a blocker and colours; and no light is negative. */
static void reciprocity(void **state) {
  (void)state;
  clt_scene_description corner;
  describe_corner(&corner);
  clt_light light = {0};
  for (int c = 0; c < 3; c++) {
    double *transport = solve_transport(&light, &corner, c);
    size_t cells = (size_t)light.layout.cells.count;
    const double *omega = light.layout.cells.solid_angle;
    double defect = 0.0, largest = 0.0;
    for (size_t i = 0; i < cells; i++) {
      for (size_t j = 0; j < cells; j++) {
        double there = omega[i] * transport[i * cells + j], back = omega[j] * transport[j * cells + i];
        assert_true(there >= -1e-15);
        defect = fmax(defect, i != j ? fabs(there - back) : 0.0);
        largest = fmax(largest, i != j ? there : 0.0);
      }
    }
    assert_true(largest > 0.0 && defect <= 1e-12 * largest);
    free(transport);
  }
  clt_light_finish(&light);
  clt_scene_description_finish(&corner);
}

/* Flux-scaled T of bright walls has only positive eigenvalues. */
static void positive_definite(void **state) {
  (void)state;
  clt_scene_description dihedral;
  describe_dihedral(&dihedral, 12, 9, 0.95);
  clt_light light = {0};
  double *transport = solve_transport(&light, &dihedral, 0), values[108];
  for (size_t k = 0; k < 108 * 108; k++) {
    transport[k] *= light.layout.cells.solid_angle[k / 108];
  }
  assert_int_equal(LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'N', 'U', 108, transport, 108, values), 0);
  assert_true(values[0] > 0.1 * values[107]);
  free(transport);
  clt_light_finish(&light);
  clt_scene_description_finish(&dihedral);
}

/* The radiosity of the fully lit scene, iterated here with the mesh's H, sees what T 1 sees. */
static void white_by_iteration(void **state) {
  (void)state;
  clt_scene_description corner;
  describe_corner(&corner);
  clt_light light = {0};
  const int channel = 1;
  double *transport = solve_transport(&light, &corner, channel);
  const clt_mesh *mesh = &light.layout.mesh;
  const clt_cells *own = &light.layout.cells;
  size_t count = (size_t)mesh->count, cells = (size_t)mesh->cells;
  double *direct = calloc(3 * count, sizeof *direct), *bounced = direct + count, *next = bounced + count;
  for (size_t j = 0; j < cells; j++) {
    for (int k = mesh->lights.start[j]; k < mesh->lights.start[j + 1]; k++) {
      const clt_rectangle *element = &mesh->elements[mesh->lights.element[k]];
      direct[mesh->lights.element[k]] +=
          element->albedo[channel] * 10.0 * own->solid_angle[j] * mesh->lights.weight[k] / clt_rectangle_area(element);
    }
  }
  for (int bounce = 0; bounce < 60; bounce++) {
    for (size_t i = 0; i < count; i++) {
      double met = 0.0;
      for (size_t j = 0; j < count; j++) {
        met += h_value(&light, i, j) * (direct[j] + bounced[j]);
      }
      next[i] = mesh->elements[i].albedo[channel] / clt_rectangle_area(&mesh->elements[i]) * met;
    }
    memcpy(bounced, next, count * sizeof *next);
  }
  for (size_t i = 0; i < cells; i++) {
    double seen = clt_light_direct(&light, channel, (int)i), sum = 0.0;
    for (int k = mesh->sees.start[i]; k < mesh->sees.start[i + 1]; k++) {
      seen += mesh->sees.weight[k] * bounced[mesh->sees.element[k]] / M_PI;
    }
    for (size_t j = 0; j < cells; j++) {
      sum += transport[i * cells + j];
    }
    assert_near(sum, seen, 1e-8 * seen);
  }
  free(direct);
  free(transport);
  clt_light_finish(&light);
  clt_scene_description_finish(&corner);
}

/* A panel with its black back to the projector shadows the wall behind it, and only that. */
static void panel_casts_shadow(void **state) {
  (void)state;
  clt_scene_description open_wall, shadowed;
  describe_view(&open_wall, 8, 6, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  add_surface(&open_wall, (clt_vector){-2, 0, -2}, (clt_vector){4, 0, 0}, (clt_vector){0, 0, 4}, 0.5);
  describe_view(&shadowed, 8, 6, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  add_surface(&shadowed, (clt_vector){-2, 0, -2}, (clt_vector){4, 0, 0}, (clt_vector){0, 0, 4}, 0.5);
  /* at half the distance: columns 0..3 and rows 0..2 of the picture */
  add_surface(&shadowed, (clt_vector){-1, -1.5, 0}, (clt_vector){0, 0, 1}, (clt_vector){1, 0, 0}, 0.5);
  clt_light open_light = {0}, shadow_light = {0};
  double *seen = solve_transport(&open_light, &open_wall, 0), *dark = solve_transport(&shadow_light, &shadowed, 0);
  for (int cell = 0; cell < 48; cell++) {
    bool behind = cell % 8 < 4 && cell / 8 < 3;
    double wanted = behind ? 0.0 : clt_light_direct(&open_light, 0, cell);
    assert_near(clt_light_direct(&shadow_light, 0, cell), wanted, 1e-12);
    assert_true(behind ? dark[cell * 49] == 0.0 : dark[cell * 49] >= seen[cell * 49] - 1e-12);
  }
  free(seen);
  free(dark);
  clt_light_finish(&open_light);
  clt_light_finish(&shadow_light);
  clt_scene_description_finish(&open_wall);
  clt_scene_description_finish(&shadowed);
}

static void read_dataset(const char *path, const char *name, double *values) {
  hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT), data = H5Dopen2(file, name, H5P_DEFAULT);
  assert_true(H5Dread(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0);
  H5Dclose(data);
  H5Fclose(file);
}

/* Relative RMS of a - b against b. */
static double difference(const double *a, const double *b, size_t count) {
  double off = 0.0, size = 0.0;
  for (size_t k = 0; k < count; k++) {
    off += (a[k] - b[k]) * (a[k] - b[k]);
    size += b[k] * b[k];
  }
  return sqrt(off / size);
}

/* Direct light and the interreflection of an all-white picture against an independent path tracer, whose own noise is
 * 0.4 % of the interreflection and whose rows are means over 4 to 9 camera pixels. */
static void path_tracer_agrees(void **state) {
  (void)state;
  enum { CELLS = 768 };
  char path[1024];
  if (shared_file("data/cycles-dihedral.h5", path) == NULL) {
    skip();
  }
  double *reference = calloc(CELLS * CELLS, sizeof *reference);
  double first[CELLS], direct[CELLS], bounced[CELLS], reference_bounced[CELLS];
  read_dataset(path, "/dense", reference);
  read_dataset(path, "/reference/first_bounce", first);
  clt_scene_description dihedral;
  describe_dihedral(&dihedral, 32, 24, 0.7);
  dihedral.rays = 8;
  dihedral.projector.intensity[0] = 31.830988618379067;
  clt_light light = {0};
  double *transport = solve_transport(&light, &dihedral, 0);
  for (size_t i = 0; i < CELLS; i++) {
    direct[i] = clt_light_direct(&light, 0, (int)i);
    bounced[i] = -direct[i];
    reference_bounced[i] = -first[i];
    for (size_t j = 0; j < CELLS; j++) {
      bounced[i] += transport[i * CELLS + j];
      reference_bounced[i] += reference[i * CELLS + j];
    }
  }
  double direct_error = difference(direct, first, CELLS), bounced_error = difference(bounced, reference_bounced, CELLS);
  print_message("direct %.3f %%, interreflection %.3f %% from the path tracer\n", 100 * direct_error,
                100 * bounced_error);
  assert_true(direct_error <= 0.005);
  assert_true(bounced_error <= 0.015);
  free(reference);
  free(transport);
  clt_light_finish(&light);
  clt_scene_description_finish(&dihedral);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(projector_axes),     cmocka_unit_test(flat_wall_is_diagonal),
      cmocka_unit_test(row_sums_of_a_box),  cmocka_unit_test(only_what_exchanges_is_meshed),
      cmocka_unit_test(reciprocity),        cmocka_unit_test(positive_definite),
      cmocka_unit_test(white_by_iteration), cmocka_unit_test(panel_casts_shadow),
      cmocka_unit_test(path_tracer_agrees),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
