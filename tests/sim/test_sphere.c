#include <lapacke.h>

#include "room.h"
#include "sim/exchange.h"
#include "sim/formfactor.h"
#include "sim/light.h"
#include "sim/shapes.h"

static const double grey[CLT_SIM_CHANNELS_MAX] = {0.5, 0.4, 0.3};
enum { RADIUS = 2 };

/* `rings` of them, twice as many pieces all around. */
static clt_sphere whole_sphere(int rings) {
  return (clt_sphere){.centre = {1, -2, 3},
                      .radius = RADIUS,
                      .axis = {0, 1, 2},
                      .start = {0.5, 2, -1},
                      .to = M_PI,
                      .arc = 2 * M_PI,
                      .rings = rings,
                      .pieces = 2 * rings};
}

static clt_scene_description *describe(const clt_sphere *sphere, clt_facing facing) {
  clt_scene_description *scene = calloc(1, sizeof *scene);
  assert_non_null(scene);
  assert_true(clt_shape_sphere(scene, sphere, facing, grey));
  return scene;
}

/* Area, and the volume between the surfaces and the centre: a third of the integral of (x - centre) . n. */
static void measure(const clt_sphere *sphere, clt_facing facing, double *area, double *volume) {
  clt_scene_description *scene = describe(sphere, facing);
  *area = *volume = 0.0;
  for (int k = 0; k < scene->surface_count; k++) {
    const clt_rectangle *facet = &scene->surfaces[k];
    double size = clt_rectangle_area(facet);
    *area += size;
    *volume += size * vec_dot(vec_sub(clt_rectangle_centre(facet), sphere->centre), facet->normal) / 3.0;
  }
  clt_scene_description_finish(scene);
  free(scene);
}

/* Corners lie on the sphere, triangles are flat and face the way they should, and nothing but them is added. */
static void facets_lie_on_the_sphere(void **state) {
  (void)state;
  for (int way = 0; way < 2; way++) {
    clt_sphere sphere = whole_sphere(6);
    clt_scene_description *scene = describe(&sphere, way == 0 ? CLT_FACING_OUT : CLT_FACING_IN);
    assert_int_equal(scene->surface_count, (2 * 6 - 2) * 12);
    for (int k = 0; k < scene->surface_count; k++) {
      const clt_rectangle *facet = &scene->surfaces[k];
      for (int corner = 0; corner < 3; corner++) {
        clt_vector from_centre = vec_sub(clt_rectangle_vertex(facet, corner), sphere.centre);
        assert_near(vec_length(from_centre), RADIUS, 1e-12);
      }
      double outward = vec_dot(facet->normal, vec_unit(vec_sub(clt_rectangle_centre(facet), sphere.centre)));
      assert_true(way == 0 ? outward > 0.9 : outward < -0.9);
      assert_near(facet->albedo[1], grey[1], 0.0);
    }
    clt_scene_description_finish(scene);
    free(scene);
  }
}

/* A zone from polar angle f to t and a radians around has R^2 a (cos f - cos t), its cone a third of R of that. The
 * error of both falls by 4 where facets are half as large. */
static void areas_and_volumes_converge(void **state) {
  (void)state;
  const double zones[][3] = {
      {0, M_PI, 2 * M_PI}, {0, 1.2, 2 * M_PI}, {0.4, 1.9, 2.5}, {1.0, M_PI, 0.7}, {0, M_PI / 2, M_PI}};
  for (size_t k = 0; k < sizeof zones / sizeof zones[0]; k++) {
    double last[2] = {0.0, 0.0};
    for (int rings = 4; rings <= 16; rings *= 2) {
      clt_sphere sphere = whole_sphere(rings);
      sphere.from = zones[k][0];
      sphere.to = zones[k][1];
      sphere.arc = zones[k][2];
      double area, volume, exact = RADIUS * RADIUS * sphere.arc * (cos(sphere.from) - cos(sphere.to));
      measure(&sphere, CLT_FACING_OUT, &area, &volume);
      double missing[2] = {1.0 - area / exact, 1.0 - volume / (exact * RADIUS / 3.0)};
      for (int n = 0; n < 2; n++) {
        assert_true(missing[n] > 0.0 && missing[n] < 0.3);
        if (rings > 4) {
          assert_near(last[n] / missing[n], 4.0, 0.4);
        }
        last[n] = missing[n];
      }
      double inner_area, inner_volume;
      measure(&sphere, CLT_FACING_IN, &inner_area, &inner_volume);
      assert_near(inner_area, area, 1e-12);
      assert_near(inner_volume, -volume, 1e-12);
    }
  }
}

/* The arc begins at start and goes counter-clockwise as one looks against the axis; from and to count from the pole. */
static void sections_are_where_they_should_be(void **state) {
  (void)state;
  clt_sphere dome = {.radius = 1, .axis = {0, 0, 5}, .start = {3, 0, 0}, .to = M_PI / 2, .arc = M_PI / 2};
  dome.rings = dome.pieces = 5;
  clt_scene_description *scene = describe(&dome, CLT_FACING_IN);
  assert_int_equal(scene->surface_count, (2 * 5 - 1) * 5);
  for (int k = 0; k < scene->surface_count; k++) {
    for (int corner = 0; corner < 3; corner++) {
      clt_vector at = clt_rectangle_vertex(&scene->surfaces[k], corner);
      assert_true(at.x >= -1e-12 && at.y >= -1e-12 && at.z >= -1e-12);
    }
  }
  clt_sphere many = whole_sphere(40);
  scene->surface_count = 7;
  assert_false(clt_shape_sphere(scene, &many, CLT_FACING_OUT, grey));
  assert_int_equal(scene->surface_count, 7);
  clt_scene_description_finish(scene);
  free(scene);
}

/* Between any two parts of a sphere, seen from within, the form factor is the area of the other over 4 pi R^2. Facets
 * that do not touch have it to second order: trapezia, each two triangles in a row, away from the poles, where they
 * come to look like squares. */
static double worst_of_facets(int rings) {
  clt_sphere sphere = whole_sphere(rings);
  clt_scene_description *scene = describe(&sphere, CLT_FACING_IN);
  int first = sphere.pieces * (rings / 2 - 1), end = scene->surface_count - first;
  double worst = 0.0;
  for (int i = first; i < end; i += 2) {
    for (int j = first; j < i; j += 2) {
      const clt_rectangle *a = &scene->surfaces[i], *b = &scene->surfaces[j];
      double area_a = clt_rectangle_area(&a[0]) + clt_rectangle_area(&a[1]);
      double area_b = clt_rectangle_area(&b[0]) + clt_rectangle_area(&b[1]);
      double sum = clt_formfactor_exchange(&a[0], &b[0]) + clt_formfactor_exchange(&a[0], &b[1]) +
                   clt_formfactor_exchange(&a[1], &b[0]) + clt_formfactor_exchange(&a[1], &b[1]);
      if (vec_length(vec_sub(clt_rectangle_centre(a), clt_rectangle_centre(b))) > RADIUS) {
        worst = fmax(worst, fabs(sum / (area_a * area_b / (4 * M_PI * RADIUS * RADIUS)) - 1.0));
      }
    }
  }
  clt_scene_description_finish(scene);
  free(scene);
  return worst;
}

static void form_factors_of_facets(void **state) {
  (void)state;
  double coarse = worst_of_facets(6), fine = worst_of_facets(12);
  print_message("form factors between facets: off by at most %.3g, %.3g\n", coarse, fine);
  assert_true(fine < 0.05);
  assert_near(coarse / fine, 4.0, 0.8);
}

/* The form factor between two halves of a sphere, whose facets may touch or be the same. */
static double exchanged(const clt_scene_description *scene, const double *exchange, clt_vector from, clt_vector to) {
  double area = 0.0, sum = 0.0;
  for (int i = 0; i < scene->surface_count; i++) {
    clt_vector at = vec_sub(clt_rectangle_centre(&scene->surfaces[i]), whole_sphere(2).centre);
    if (vec_dot(at, from) < 0.0) {
      continue;
    }
    area += clt_rectangle_area(&scene->surfaces[i]);
    for (int j = 0; j < scene->surface_count; j++) {
      clt_vector there = vec_sub(clt_rectangle_centre(&scene->surfaces[j]), whole_sphere(2).centre);
      sum += vec_dot(there, to) >= 0.0 ? clt_exchange_between(exchange, scene->surface_count, i, j) : 0.0;
    }
  }
  return sum / area;
}

/* H of a whole sphere's facets. */
static double *solve_exchange(const clt_scene_description *scene) {
  size_t count = (size_t)scene->surface_count;
  int *surface = calloc(count, sizeof *surface);
  double *exchange = calloc(count * count, sizeof *exchange);
  assert_true(surface != NULL && exchange != NULL);
  for (int k = 0; k < scene->surface_count; k++) {
    surface[k] = k;
  }
  clt_error error = {.status = CLT_OK};
  clt_visibility *visibility = NULL;
  assert_ok(clt_visibility_create(scene->surfaces, scene->surface_count, &visibility, &error), error);
  clt_parts parts = {scene->surfaces, scene->surfaces, surface, scene->surface_count, scene->surface_count, visibility};
  assert_ok(clt_exchange_compute(&parts, exchange, &error), error);
  clt_visibility_destroy(visibility);
  free(surface);
  return exchange;
}

/* To second order. */
static void form_factors_of_halves(void **state) {
  (void)state;
  const clt_vector axis = {0, 1, 2}, across = {1, 0, 0}, oblique = {0.3, -2, 1};
  double off[2] = {0.0, 0.0};
  for (int n = 0; n < 2; n++) {
    clt_sphere sphere = whole_sphere(n == 0 ? 6 : 12);
    clt_scene_description *scene = describe(&sphere, CLT_FACING_IN);
    double *exchange = solve_exchange(scene);
    const clt_vector halves[] = {axis, across, oblique, vec_scale(-1.0, axis)};
    for (int k = 0; k < 16; k++) {
      off[n] = fmax(off[n], fabs(exchanged(scene, exchange, halves[k / 4], halves[k % 4]) - 0.5));
    }
    free(exchange);
    clt_scene_description_finish(scene);
    free(scene);
  }
  print_message("form factors between halves: off by at most %.3g, %.3g\n", off[0], off[1]);
  assert_true(off[1] < 0.005);
  assert_true(off[0] / off[1] > 3.0);
}

/* The closed sphere keeps all of its light: facet by facet as the quadrature has it, and exactly once scaled; then the
 * radiance of B = 1 + m G B is 1 / (1 - m). */
static void furnace(void **state) {
  (void)state;
  clt_sphere sphere = whole_sphere(6);
  clt_scene_description *scene = describe(&sphere, CLT_FACING_IN);
  int count = scene->surface_count, pivots[(2 * 6 - 2) * 12];
  double *exchange = solve_exchange(scene), *radiance = calloc((size_t)count, sizeof *radiance), albedo = 0.95;
  double *system = calloc((size_t)count * (size_t)count, sizeof *system);
  for (int i = 0; i < count; i++) {
    double raw = 0.0, sum = 0.0, area = clt_rectangle_area(&scene->surfaces[i]);
    for (int j = 0; j < count; j++) {
      double sent = clt_exchange_between(exchange, count, i, j) / area;
      raw += i != j ? clt_formfactor_exchange(&scene->surfaces[i], &scene->surfaces[j]) / area : 0.0;
      sum += sent;
      system[i * count + j] = (i == j) - albedo * sent;
    }
    assert_near(raw, 1.0, 2e-5);
    assert_near(sum, 1.0, 1e-10);
    radiance[i] = 1.0;
  }
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, count, 1, system, count, pivots, radiance, 1), 0);
  for (int i = 0; i < count; i++) {
    assert_near(radiance[i] * (1.0 - albedo), 1.0, 1e-6);
  }
  free(system);
  free(radiance);
  free(exchange);
  clt_scene_description_finish(scene);
  free(scene);
}

/* An integrating sphere: light that has bounced is the same everywhere. A pixel of flux P sends out a P, which gives
 * every point the irradiance a P / (4 pi R^2) (1 + a + a^2 + ...), so that off the diagonal
 *   T_ij / (intensity omega_j) = a^2 / (4 pi^2 R^2 (1 - a)).
 * Returns how far the mean of cells 3 or more apart is from that; near ones share facets, which have no light for
 * themselves. */
static double integrate(int rings, double albedo, double *worst) {
  clt_scene_description *scene = calloc(1, sizeof *scene);
  assert_non_null(scene);
  describe_view(scene, 8, 4, (clt_vector){0.3, -0.6, 0.2}, (clt_vector){0, 1, 0});
  clt_sphere sphere = whole_sphere(rings);
  sphere.centre = (clt_vector){0, 0, 0};
  const double white[CLT_SIM_CHANNELS_MAX] = {albedo, albedo, albedo};
  assert_true(clt_shape_sphere(scene, &sphere, CLT_FACING_IN, white));
  clt_light light = {0};
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_init(&light, scene, &error), error);
  assert_ok(clt_light_solve(&light, 0, &error), error);
  double *scratch = calloc((size_t)light.layout.mesh.used, sizeof *scratch), row[32], sum = 0.0, pairs = 0.0;
  double wanted = albedo * albedo / (4 * M_PI * M_PI * RADIUS * RADIUS * (1 - albedo));
  *worst = 0.0;
  for (int i = 0; i < 32; i++) {
    clt_light_row(&light, 0, i, row, scratch);
    for (int j = 0; j < 32; j++) {
      if (abs(i % 8 - j % 8) >= 3) {
        double off = row[j] / (10.0 * light.layout.cells.solid_angle[j]) / wanted - 1.0;
        *worst = fmax(*worst, fabs(off));
        sum += off;
        pairs += 1.0;
      }
    }
  }
  free(scratch);
  clt_light_finish(&light);
  clt_scene_description_finish(scene);
  free(scene);
  return sum / pairs;
}

static void integrating_sphere(void **state) {
  (void)state;
  double worst[2], mean[2];
  for (int n = 0; n < 2; n++) {
    mean[n] = integrate(6 << n, 0.8, &worst[n]);
    print_message("integrating sphere of %d rings: %.3g off on average, %.3g at most\n", 6 << n, mean[n], worst[n]);
  }
  assert_true(fabs(mean[1]) < 0.012 && worst[1] < 0.12);
  assert_true(worst[0] / worst[1] > 3.0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(facets_lie_on_the_sphere),
      cmocka_unit_test(areas_and_volumes_converge),
      cmocka_unit_test(sections_are_where_they_should_be),
      cmocka_unit_test(form_factors_of_facets),
      cmocka_unit_test(form_factors_of_halves),
      cmocka_unit_test(furnace),
      cmocka_unit_test(integrating_sphere),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
