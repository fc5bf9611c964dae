/* Repainted walls: the ratio from one photograph, and the repainted room's own light. */
#include "rooms.h"

/* Walls that the picture covers whole. Before: albedo 0.7, 0.7; after: 0.35, 0.77 (darker, lighter). */
static const double before[2] = {0.7, 0.7}, after[2] = {0.35, 0.77};

static void multiply_transport(const clt_transport *transport, const double *x, double *y) {
  const float *entries = clt_transport_entries(transport, 0);
  size_t n = clt_transport_describe(transport).cols;
  for (size_t i = 0; i < n; i++) {
    y[i] = 0;
    for (size_t j = 0; j < n; j++) {
      y[i] += (double)entries[i * n + j] * x[j];
    }
  }
}

/* rms of found / wanted - 1 over cells where wanted is not 0. */
static double ratio_error(size_t n, const double *found, const double *wanted) {
  double sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < n; i++) {
    sum += wanted[i] != 0 ? pow(found[i] / wanted[i] - 1, 2) : 0;
    count += wanted[i] != 0;
  }
  return sqrt(sum / (double)count);
}

/* In a cube whose cells are its patches A_ii = 0, and the ratio is exact; every cell has another one. */
static void ratio_is_exact_for_flat_patches(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    cube made = cube_make(4, 0.8, seed);
    size_t n = made.cells, unknown = 9;
    double *x = numbers(n), *ratio = numbers(n), *found = numbers(n), *matrix = numbers(n * n), *light = numbers(n);
    lapack_int *pivots = calloc(n, sizeof *pivots);
    clt_error error = {0};
    uint64_t random = seed + 20;
    for (size_t i = 0; i < n; i++) { /* l = (I - D A)^-1 D F x */
      ratio[i] = 0.1 + 1.1 * test_random(&random);
      x[i] = test_random(&random) < 0.5 ? 0 : test_random(&random);
      light[i] = ratio[i] * made.first[i] * x[i];
      for (size_t j = 0; j < n; j++) {
        matrix[i * n + j] = (i == j) - ratio[i] * made.exchange[i * n + j];
      }
    }
    assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, (int)n, 1, matrix, (int)n, pivots, light, 1), 0);
    clt_interreflection *op = analyse(made.transport, made.certificate, true, 0);
    assert_ok(clt_repaint_ratio(op, x, light, found, &unknown, &error), error);
    assert_int_equal(unknown, 0);
    assert_near(ratio_error(n, found, ratio), 0, 1e-5);
    clt_repainted *repainted = NULL;
    assert_ok(clt_repainted_create(op, ratio, &repainted, &error), error);
    assert_ok(clt_repainted_apply(repainted, x, found, &error), error);
    assert_near(distance(n, found, light), 0, 2e-6);
    clt_repainted_destroy(repainted);
    clt_interreflection_destroy(op);
    op = analyse(made.transport, made.certificate, false, 0);
    assert_ok(clt_repaint_ratio(op, x, light, found, NULL, &error), error);
    double biased = ratio_error(n, found, ratio);
    print_message("cube, albedo .8, N = 96: with F = diag(T) the ratio is %.1f %% off\n", 100 * biased);
    assert_true(biased > 1e-3);
    clt_interreflection_destroy(op);
    cube_free(&made);
    free(x);
    free(ratio);
    free(found);
    free(matrix);
    free(light);
    free(pivots);
  }
}

/* The simulated walls, repainted in the scene file: cells are not the patches there, and A_ii is not quite 0. */
static void walls_repainted_in_the_scene(void **state) {
  (void)state;
  char text[2048];
  room old = room_write(dihedral_text(text, 32, 24, "[0.65, 0.85]", before, ""));
  room new = room_write(dihedral_text(text, 32, 24, "[0.65, 0.85]", after, ""));
  room_open(&old);
  room_open(&new);
  size_t n = old.cells;
  const unsigned char *lit = clt_certificate_lit(old.certificate, 0);
  double *x = numbers(n), *light = numbers(n), *ratio = numbers(n), *found = numbers(n), *exact = numbers(n);
  clt_error error = {0};
  uint64_t random = 4;
  for (size_t i = 0; i < n; i++) {
    x[i] = lit[i] ? 0.3 + 0.7 * test_random(&random) : 0;
    ratio[i] = lit[i] ? (i % 32 < 16 ? after[0] / before[0] : after[1] / before[1]) : 0;
  }
  multiply_transport(new.transport, x, light);
  for (int with_exact = 0; with_exact < 2; with_exact++) {
    clt_interreflection *op = analyse(old.transport, old.certificate, with_exact, 0);
    clt_repainted *repainted = NULL;
    assert_ok(clt_repaint_ratio(op, x, light, found, NULL, &error), error);
    double off = ratio_error(n, found, ratio);
    assert_ok(clt_repainted_create(op, found, &repainted, &error), error);
    assert_ok(clt_repainted_apply(repainted, x, exact, &error), error);
    double same = distance(n, exact, light);
    for (size_t i = 0; i < n; i++) { /* another drive than that of the photograph */
      found[i] = lit[i] && i % 32 >= 16;
    }
    double *seen = numbers(n);
    multiply_transport(new.transport, found, seen);
    assert_ok(clt_repainted_apply(repainted, found, exact, &error), error);
    double other = distance(n, exact, seen);
    print_message("walls, F %s: ratio %.3f %% off (rms); its light %.4f %% off under the same drive, %.4f %% under "
                  "another\n",
                  with_exact ? "exact" : "= diag(T)", 100 * off, 100 * same, 100 * other);
    assert_true(off < (with_exact ? 1e-3 : 5e-3));
    assert_true(same < 1e-3 && other < 2e-3);
    free(seen);
    clt_repainted_destroy(repainted);
    clt_interreflection_destroy(op);
  }
  free(x);
  free(light);
  free(ratio);
  free(found);
  free(exact);
  room_close(&old);
  room_close(&new);
}

static void what_cannot_be_told_is_counted_and_refused(void **state) {
  (void)state;
  cube made = cube_make(2, 0.5, 1);
  double x[24] = {0}, light[24] = {0}, ratio[24];
  size_t unknown = 0;
  clt_error error = {0};
  clt_interreflection *op = analyse(made.transport, made.certificate, true, 0);
  assert_ok(clt_repaint_ratio(op, x, light, ratio, &unknown, &error), error); /* no light at all */
  assert_int_equal(unknown, 24);
  assert_near(ratio[5], 1, 0);
  clt_repainted *repainted = NULL;
  ratio[5] = -1;
  assert_int_equal(clt_repainted_create(op, ratio, &repainted, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "ratio 5"));
  for (int i = 0; i < 24; i++) { /* albedo 0.5 * 2.5: every bounce is brighter than the last */
    ratio[i] = 2.5;
    x[i] = 1;
  }
  assert_ok(clt_repainted_create(op, ratio, &repainted, &error), error);
  assert_int_equal(clt_repainted_apply(repainted, x, light, &error), CLT_FAILED);
  assert_non_null(strstr(error.message, "reflect"));
  x[0] = INFINITY;
  assert_int_equal(clt_repainted_apply(repainted, x, light, &error), CLT_BAD_INPUT);
  clt_repainted_destroy(repainted);
  clt_repainted_destroy(NULL);
  clt_interreflection_destroy(op);
  cube_free(&made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(ratio_is_exact_for_flat_patches),
      cmocka_unit_test(walls_repainted_in_the_scene),
      cmocka_unit_test(what_cannot_be_told_is_counted_and_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
