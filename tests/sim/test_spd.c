/* T of a Lambertian scene, its columns divided by the flux of their cells, is symmetric positive definite. */
#include <lapacke.h>

#include "base/memory.h"
#include "room.h"
#include "sim/light.h"

/* Rows of T in double with the flux of each column divided out, lit x lit cells: rows and columns of cells beside the
 * walls are 0. */
static double *scaled_transport(const clt_scene_description *description, size_t *cells) {
  clt_light light = {0};
  clt_error error = {.status = CLT_OK};
  light.solved = -1;
  assert_ok(clt_light_init(&light, description, &error), error);
  assert_ok(clt_light_solve(&light, 0, &error), error);
  size_t count = (size_t)light.layout.cells.count;
  double *scaled = clt_alloc(count * count, sizeof *scaled);
  double *kept = clt_alloc(count * count, sizeof *kept);
  double *scratch = clt_alloc((size_t)light.layout.mesh.used + count + 1, sizeof *scratch);
  for (size_t i = 0; i < count; i++) {
    clt_light_row(&light, 0, (int)i, &scaled[i * count], scratch);
    for (size_t j = 0; j < count; j++) {
      scaled[i * count + j] /= light.layout.cells.solid_angle[j] * description->projector.intensity[0];
    }
  }
  size_t lit = 0;
  for (size_t i = 0; i < count; i++) {
    if (scaled[i * count + i] > 0.0) {
      size_t column = 0;
      for (size_t j = 0; j < count; j++) {
        scratch[column] = scaled[i * count + j];
        column += scaled[j * count + j] > 0.0;
      }
      memcpy(&kept[lit++ * count], scratch, column * sizeof *kept);
    }
  }
  for (size_t i = 1; i < lit; i++) {
    memmove(&kept[i * lit], &kept[i * count], lit * sizeof *kept);
  }
  *cells = lit;
  free(scratch);
  free(scaled);
  clt_light_finish(&light);
  return kept;
}

/* ||M - M'|| / ||M|| in Frobenius' norm, and the least and greatest eigenvalue of its symmetric part. */
static void examine(double *m, size_t cells, double *defect, double *least, double *greatest) {
  double off = 0.0, size = 0.0, *values = clt_alloc(cells, sizeof *values);
  for (size_t i = 0; i < cells; i++) {
    for (size_t j = 0; j < cells; j++) {
      double difference = m[i * cells + j] - m[j * cells + i];
      off += difference * difference;
      size += m[i * cells + j] * m[i * cells + j];
    }
  }
  *defect = sqrt(off / size);
  assert_int_equal(LAPACKE_dsyev(LAPACK_ROW_MAJOR, 'N', 'U', (lapack_int)cells, m, (lapack_int)cells, values), 0);
  *least = values[0];
  *greatest = values[cells - 1];
  free(values);
}

static const clt_vector origin = {0, 0, 0}, far = {1, 1, 1};

/* Sides of the unit cube, fronts inwards: floor, left, back, right, ceiling, front. */
static void add_cube(clt_scene_description *description, int sides, double albedo) {
  const struct {
    clt_vector corner, u, v;
  } walls[6] = {{origin, {1, 0, 0}, {0, 1, 0}}, {origin, {0, 1, 0}, {0, 0, 1}}, {far, {-1, 0, 0}, {0, 0, -1}},
                {far, {0, 0, -1}, {0, -1, 0}},  {far, {0, -1, 0}, {-1, 0, 0}},  {origin, {0, 0, 1}, {1, 0, 0}}};
  for (int k = 0; k < sides; k++) {
    add_surface(description, walls[k].corner, walls[k].u, walls[k].v, albedo);
  }
}

static void check(const char *name, const clt_scene_description *description) {
  size_t cells;
  double defect, least, greatest, *scaled = scaled_transport(description, &cells);
  examine(scaled, cells, &defect, &least, &greatest);
  print_message("%s, albedo %g: defect %.1e, eigenvalues %.3g to %.3g\n", name, description->surfaces[0].albedo[0],
                defect, least, greatest);
  assert_true(defect <= 1e-10);
  assert_true(least > 0.0 && greatest < INFINITY);
  free(scaled);
}

static void lambertian_light_is_symmetric_and_positive(void **state) {
  (void)state;
  const double albedos[] = {0.3, 0.7, 0.95};
  const clt_vector eyes[] = {{0.5, -1.4, 0.5}, {0.8, -1.1, 0.3}};
  for (int k = 0; k < 3; k++) {
    clt_scene_description walls, box, open;
    for (int e = 0; e < 2; e++) {
      describe_view(&walls, 16, 12, (clt_vector){2.0, 2.0 + 0.5 * e, 0.8}, (clt_vector){0.3, 0.3, 0.5});
      add_surface(&walls, origin, (clt_vector){0, 1.5, 0}, (clt_vector){0, 0, 1.2}, albedos[k]);
      add_surface(&walls, origin, (clt_vector){0, 0, 1.2}, (clt_vector){1.5, 0, 0}, albedos[k]);
      check("dihedral", &walls);
      clt_scene_description_finish(&walls);
      describe_view(&open, 16, 12, eyes[e], (clt_vector){0.5, 1, 0.5});
      add_cube(&open, 5, albedos[k]);
      add_surface(&open, (clt_vector){0.3, 0.5, 0.4}, (clt_vector){0.3, 0, 0}, (clt_vector){0, 0, 0.3}, albedos[k]);
      check("open box with a board", &open);
      clt_scene_description_finish(&open);
    }
    describe_view(&box, 16, 12, (clt_vector){0.5, 0.1, 0.5}, (clt_vector){0.45, 1, 0.4});
    add_cube(&box, 6, albedos[k]);
    check("closed box", &box);
    clt_scene_description_finish(&box);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(lambertian_light_is_symmetric_and_positive)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
