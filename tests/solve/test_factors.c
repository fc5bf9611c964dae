/* The methods that keep a factor or an inverse: against LAPACK's LU, against the series term by term, and at their
 * limits. Residuals are recomputed in double from the entries. */
#include <cblas.h>

#include "rooms.h"
#include "solve/matrix_iteration.h"

static clt_solve_result solve(const test_room *room, const char *method, double tolerance) {
  clt_error error = {0};
  clt_solve_result result;
  clt_solve_options options = {.method = method, .tolerance = tolerance};
  assert_ok(clt_solve(room->transport, room->certificate, room->b, &options, room->x, &result, &error), error);
  assert_near(result.residual, room_residual(room, room->x, room->b), 1e-12);
  return result;
}

static void assert_refused(const test_room *room, const char *method, const char *phrase) {
  clt_error error = {0};
  clt_solver *solver = NULL;
  clt_solve_options options = {.method = method};
  assert_int_equal(clt_solver_create(room->transport, room->certificate, &options, &solver, &error), CLT_BAD_INPUT);
  if (strstr(error.message, phrase) == NULL) {
    fail_msg("\"%s\" does not say \"%s\"", error.message, phrase);
  }
}

/* A positive T that no flux makes symmetric, its diagonal 1 and its columns' sums beside it `size` on average. */
static test_room one_way_room(size_t n, uint64_t seed, double size) {
  float *entries = calloc(n * n, sizeof *entries);
  for (size_t i = 0; i < n * n; i++) {
    double u = test_random(&seed);
    entries[i] = (float)(i % (n + 1) == 0 ? 1 : 4 * size * u * u * u / (double)n);
  }
  test_room room = room_of(n, n, entries);
  free(entries);
  return room;
}

static const char *const KEPT[] = {"direct", "stored-inverse", "matrix", "clusters"};

static void reach_the_lu_solution_to_any_tolerance(void **state) {
  (void)state;
  const double tolerances[] = {1e-2, 1e-4, 1e-6, 1e-10};
  for (uint64_t seed = 1; seed <= 4; seed++) {
    test_room room = seed % 2 ? room_closed(12, 8, .2 + .06 * (double)seed, seed) : room_cube(4, .45, .3, seed);
    double *direct = room_numbers(room.cells);
    room_ask(&room, seed, -.5, 1.5);
    room_direct(&room, 0, room.b, direct);
    for (size_t m = 0; m < 4; m++) {
      for (int t = 0; t < 4; t++) {
        clt_solve_result result = solve(&room, KEPT[m], tolerances[t]);
        assert_string_equal(result.method, KEPT[m]);
        assert_true(result.converged && result.residual <= tolerances[t]);
        assert_true(room_distance(room.x, direct, room.cells) < 40 * tolerances[t]);
      }
    }
    free(direct);
    room_free(&room);
  }
}

/* White rooms, where rho(R) >= 1: the matrix iteration is refused, the others serve. */
static void serve_white_rooms(void **state) {
  (void)state;
  const double albedos[] = {.62, .9, .99};
  for (int k = 0; k < 3; k++) {
    test_room room = room_cube(8, albedos[k], 0, (uint64_t)k);
    room_ask(&room, 5, 0, 1);
    assert_true(solve(&room, "direct", 1e-12).converged);
    assert_true(solve(&room, "stored-inverse", 1e-6).converged);
    clt_solve_result clusters = solve(&room, "clusters", 1e-6);
    assert_true(clusters.converged);
    print_message("albedo %.2f: clusters %d iterations\n", albedos[k], clusters.iterations);
    assert_refused(&room, "matrix", "must be below 1; use direct or auto");
    room_free(&room);
  }
}

static void serve_what_is_not_reciprocal(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    test_room room = one_way_room(90, seed, .6);
    assert_true(clt_certificate_channel(room.certificate, 0)->reciprocity > .05);
    room_ask(&room, seed, .1, .9);
    for (size_t m = 0; m < 4; m++) {
      clt_solve_result result = solve(&room, KEPT[m], 1e-9);
      assert_string_equal(result.method, KEPT[m]);
      assert_true(result.converged && result.residual <= 1e-9);
      assert_true(room_distance(room.x, room.known, room.cells) < 1e-7);
    }
    room_free(&room);
  }
}

/* Entries with a defect of some 1e-5: the symmetrised factor alone misses by that, products with T give it back. */
static void refinement_makes_good_what_symmetry_lacks(void **state) {
  (void)state;
  test_room room = room_closed(12, 10, .5, 3);
  float *entries = clt_transport_entries(room.transport, 0);
  uint64_t random = 8;
  for (size_t i = 0; i < room.cells * room.cells; i++) {
    entries[i] *= (float)(1 + 1e-4 * (test_random(&random) - .5));
  }
  room_certify(&room);
  double defect = clt_certificate_channel(room.certificate, 0)->reciprocity;
  assert_true(defect > 1e-6 && defect < 1e-4);
  room_ask(&room, 4, .1, .9);
  clt_solve_result result = solve(&room, "direct", 1e-12);
  assert_true(result.converged && result.iterations >= 2 && result.iterations <= 4);
  assert_true(result.curve[1] > 1e-8);
  room_free(&room);
}

static void a_singular_matrix_gives_way(void **state) {
  (void)state;
  enum { N = 16 };
  float entries[N * N] = {0};
  for (int i = 0; i < N; i++) {
    entries[i * N + i] = 1;
    entries[i * N + (i ^ 1)] = 1; /* pairs of equal columns */
  }
  test_room room = room_of(N, N, entries);
  room_ask(&room, 4, .1, .9);
  clt_solve_result result = solve(&room, "direct", 1e-8);
  assert_string_not_equal(result.method, "direct");
  assert_non_null(strstr(result.reason, "singular"));
  assert_true(room_residual(&room, room.x, room.b) < 1e-7);
  assert_refused(&room, "stored-inverse", "has no inverse");
  room_free(&room);
}

/* The step's X_k is the series sum_(j <= k) (-R)^j, and ||I - S X_k|| = ||R^(k+1)||, both built here by dgemm. */
static void the_matrix_iteration_is_the_series(void **state) {
  (void)state;
  test_room room = room_cube(4, .4, .5, 2);
  size_t n = room.cells, nn = n * n;
  blasint m = (blasint)n;
  double *r = room_numbers(nn), *x = room_numbers(nn), *next = room_numbers(nn), *power = room_numbers(nn);
  double *other = room_numbers(nn), *sum = room_numbers(nn);
  const float *entries = clt_transport_entries(room.transport, 0);
  for (size_t i = 0; i < nn; i++) {
    r[i] = (double)entries[i] / (double)entries[i % n * (n + 1)] - (i % (n + 1) == 0);
    x[i] = sum[i] = power[i] = i % (n + 1) == 0;
  }
  for (int k = 1; k <= 12; k++) {
    double left = clt_matrix_step(r, x, n, next);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, m, m, m, -1, power, m, r, m, 0, other, m);
    memcpy(power, other, nn * sizeof *power);
    cblas_daxpy((blasint)nn, 1, power, 1, sum, 1);
    memcpy(x, next, nn * sizeof *x);
    assert_true(room_distance(x, sum, nn) < 1e-10);
    assert_near(left / cblas_dnrm2((blasint)nn, power, 1), 1, 1e-8);
  }
  free(r);
  free(x);
  free(next);
  free(power);
  free(other);
  free(sum);
  room_free(&room);
}

/* One solve of a kept inverse reads A once and T not at all, down to what single precision holds; below, each step of
 * refinement is a product with T. result.curve[1] is then a bound of the residual, not less than it. */
static void a_stored_inverse_costs_one_product(void **state) {
  (void)state;
  test_room room = room_cube(8, .8, .2, 2);
  room_ask(&room, 9, 0, 1);
  clt_solve_result coarse = solve(&room, "stored-inverse", 1e-4);
  assert_int_equal(coarse.iterations, 1);
  assert_int_equal(coarse.products, 0);
  assert_true(coarse.residual <= coarse.curve[1] && coarse.curve[1] <= 1e-4);
  clt_solve_result fine = solve(&room, "stored-inverse", 1e-6);
  assert_true(fine.converged && fine.residual <= 1e-6);
  clt_solve_result finest = solve(&room, "stored-inverse", 1e-12);
  assert_true(finest.converged && finest.iterations <= 4 && finest.products >= 1);
  print_message("stored-inverse: residual %.2g (bound %.2g) in one product, 1e-12 in %d\n", coarse.residual,
                coarse.curve[1], finest.iterations);
  room_free(&room);
}

/* Rooms beside each other that exchange nothing: a cluster each, and the answer in one step. */
static void clusters_that_cover_all_light_are_exact(void **state) {
  (void)state;
  enum { ROOMS = 6, CELLS = 35, N = ROOMS * CELLS };
  test_room part = room_closed(7, 5, .9, 6);
  const float *from = clt_transport_entries(part.transport, 0);
  float *entries = calloc((size_t)N * N, sizeof *entries);
  for (size_t i = 0; i < N; i++) {
    for (size_t j = 0; j < N; j++) { /* the rooms' cells are interleaved */
      entries[i * N + j] = i % ROOMS == j % ROOMS ? from[i / ROOMS * CELLS + j / ROOMS] : 0;
    }
  }
  test_room room = room_of(N, N, entries);
  room_ask(&room, 4, -1, 1);
  clt_solve_result result = solve(&room, "clusters", 1e-12);
  assert_true(result.converged);
  assert_int_equal(result.iterations, 1);
  assert_true(room_distance(room.x, room.known, N) < 1e-10);
  free(entries);
  room_free(&part);
  room_free(&room);
}

/* Cells of which some are dark: nothing is kept of them, and their drive stays 0. */
static void dark_cells_take_no_part(void **state) {
  (void)state;
  test_room room = room_closed(10, 8, .4, 2);
  float *entries = clt_transport_entries(room.transport, 0);
  for (size_t i = 0; i < room.cells; i++) {
    for (size_t j = 0; j < room.cells; j += 7) {
      entries[i * room.cells + j] = 1e-7f;
    }
  }
  room_certify(&room);
  room_ask(&room, 4, .1, .9);
  for (size_t m = 0; m < 4; m++) {
    clt_solve_result result = solve(&room, KEPT[m], 1e-9);
    assert_true(result.converged);
    for (size_t j = 0; j < room.cells; j++) {
      assert_near(room.x[j], j % 7 == 0 ? 0 : room.known[j], 1e-5);
    }
  }
  room_free(&room);
}

static void limits_and_warm_starts(void **state) {
  (void)state;
  test_room room = room_cube(7, .4, .2, 5);
  room_ask(&room, 4, .1, .9);
  clt_error error = {0};
  clt_solve_result result;
  for (size_t m = 0; m < 4; m++) {
    clt_solve_options late = {.method = KEPT[m], .deadline_s = 1e-9};
    assert_ok(clt_solve(room.transport, room.certificate, room.b, &late, room.x, &result, &error), error);
    assert_false(result.converged);
    assert_near(result.residual, 1, 1e-12);
    clt_solve_options few = {.method = KEPT[m], .tolerance = 1e-18, .iteration_limit = 1};
    assert_ok(clt_solve(room.transport, room.certificate, room.b, &few, room.x, &result, &error), error);
    assert_false(result.converged);
    assert_true(result.iterations == 1 && result.residual < .5);
    clt_solve_options warm = {.method = KEPT[m], .tolerance = 1e-6, .start = room.known};
    assert_ok(clt_solve(room.transport, room.certificate, room.b, &warm, room.x, &result, &error), error);
    assert_true(result.converged && result.iterations == 0 && result.residual < 1e-12);
  }
  room_free(&room);
}

/* More cells than the methods are built for: refused before anything large is made. */
static void too_many_cells_are_refused(void **state) {
  (void)state;
  enum { WIDTH = 128, HEIGHT = 100, N = WIDTH * HEIGHT };
  clt_error error = {0};
  int64_t *start = calloc(N + 1, sizeof *start);
  int32_t *node = calloc(N, sizeof *node);
  float *value = calloc(N, sizeof *value);
  for (int i = 0; i < N; i++) {
    start[i + 1] = i + 1;
    node[i] = i;
    value[i] = 1;
  }
  test_room room = {.made = {.width = WIDTH, .height = HEIGHT, .channels = 1}, .cells = N};
  assert_ok(clt_transport_create_tree(WIDTH, HEIGHT, 1, N, start, node, value, &room.transport, &error), error);
  room_certify(&room);
  for (size_t m = 0; m < 4; m++) {
    assert_refused(&room, KEPT[m], "use pcg, gmres or auto");
  }
  free(start);
  free(node);
  free(value);
  room_free(&room);
}

/* Only methods that keep something for the next solve count as investing. */
static void what_is_kept_is_told(void **state) {
  (void)state;
  for (size_t i = 0; clt_method_name(i) != NULL; i++) {
    for (size_t m = 0; m < 4; m++) {
      assert_true(strcmp(clt_method_name(i), KEPT[m]) != 0 || clt_method_invests(i));
    }
    assert_false(strcmp(clt_method_name(i), "jacobi") == 0 && clt_method_invests(i));
    assert_false(strcmp(clt_method_name(i), "pcg") == 0 && clt_method_invests(i));
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(reach_the_lu_solution_to_any_tolerance),
      cmocka_unit_test(serve_white_rooms),
      cmocka_unit_test(serve_what_is_not_reciprocal),
      cmocka_unit_test(refinement_makes_good_what_symmetry_lacks),
      cmocka_unit_test(a_singular_matrix_gives_way),
      cmocka_unit_test(the_matrix_iteration_is_the_series),
      cmocka_unit_test(a_stored_inverse_costs_one_product),
      cmocka_unit_test(clusters_that_cover_all_light_are_exact),
      cmocka_unit_test(dark_cells_take_no_part),
      cmocka_unit_test(limits_and_warm_starts),
      cmocka_unit_test(too_many_cells_are_refused),
      cmocka_unit_test(what_is_kept_is_told),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
