/* The bounded solve against optimality conditions and an independent minimiser. */
#include "boxes.h"

/* Black and white squares in a bright room. The blacks receive more than they may show. */
static void clamping_is_far_worse_on_a_checkerboard(void **state) {
  (void)state;
  double worst = 1;
  for (int squares = 1; squares <= 3; squares++) {
    test_room room = room_cube(6, .95, 0, 3);
    double *b = room_numbers(room.cells), *x = room_numbers(room.cells);
    const double *f = clt_certificate_first_bounce(room.certificate, 0);
    for (size_t i = 0; i < room.cells; i++) {
      size_t row = i / 36, column = i % 36;
      b[i] = (row / (size_t)squares + column / (size_t)squares) % 2 ? f[i] * 2 : 0;
    }
    problem p = problem_of(&room, b);
    double clamped = clamped_objective(&p, b, x);
    clt_solve_result result = solve(&room, "auto", 1e-6, b, x);
    assert_string_equal(result.method, "bounded");
    assert_non_null(strstr(result.reason, "left 0..1"));
    assert_true(result.converged);
    assert_in_box(x, room.cells);
    assert_true(optimality(&p, x) <= 1e-6 * (1 + 1e-6));
    double reached = objective(&p, x), ratio = sqrt(clamped / reached);
    worst = fmax(worst, ratio);
    print_message("checkerboard of %d at albedo .95: clamping costs %.2f times the best rms, %d iterations\n", squares,
                  ratio, result.iterations);
    assert_near(reached / reference_optimum(&p, x), 1, 1e-6);
    problem_free(&p);
    free(b);
    free(x);
    room_free(&room);
  }
  assert_true(worst > 1.5);
}

static void a_reachable_target_has_the_unbounded_solution(void **state) {
  (void)state;
  test_room room = room_cube(5, .8, .5, 4);
  double *y = room_numbers(room.cells);
  room_ask(&room, 3, .02, .98);
  clt_solve_result automatic = solve(&room, "auto", 1e-8, room.b, room.x);
  assert_string_not_equal(automatic.method, "bounded");
  clt_solve_result bounded = solve(&room, "bounded", 1e-8, room.b, y);
  assert_true(automatic.converged && bounded.converged);
  assert_true(room_distance(room.x, room.known, room.cells) < 1e-6);
  assert_true(room_distance(y, room.known, room.cells) < 1e-6);
  assert_near(bounded.residual, room_residual(&room, y, room.b), 1e-14);
  free(y);
  room_free(&room);
}

/* Light that is already there and must go (b < 0 everywhere) leaves only the black drive. */
static void a_negative_target_gives_exactly_black(void **state) {
  (void)state;
  test_room room = room_closed(6, 5, .6, 4);
  double b[30], x[30];
  for (int i = 0; i < 30; i++) {
    b[i] = -.01 * (i + 1);
  }
  const char *methods[] = {"auto", "bounded"};
  for (int m = 0; m < 2; m++) {
    clt_solve_result result = solve(&room, methods[m], 1e-6, b, x);
    assert_true(result.converged);
    assert_near(result.residual, 1, 1e-12);
    for (int j = 0; j < 30; j++) {
      assert_true(x[j] == 0);
    }
  }
  room_free(&room);
}

static void a_warm_start_reaches_the_same_optimum(void **state) {
  (void)state;
  test_room room = room_cube(6, .9, .3, 4);
  double *y = room_numbers(room.cells);
  room_ask(&room, 3, -.4, 1.4);
  clt_solve_result cold = solve(&room, "bounded", 1e-7, room.b, room.x), warm;
  memcpy(y, room.x, room.cells * sizeof *y);
  for (size_t i = 0; i < room.cells; i++) {
    room.b[i] *= 1 + .03 * sin((double)i);
  }
  clt_error error = {0};
  clt_solve_options options = {.method = "bounded", .tolerance = 1e-7, .start = y};
  assert_ok(clt_solve(room.transport, room.certificate, room.b, &options, y, &warm, &error), error);
  cold = solve(&room, "bounded", 1e-7, room.b, room.x);
  assert_true(warm.converged && cold.converged);
  assert_true(room_distance(y, room.x, room.cells) < 1e-4);
  assert_near(warm.residual, cold.residual, 1e-9);
  free(y);
  room_free(&room);
}

/* More rows than columns, fewer, and columns that are the same. */
static void least_squares_serve_any_shape(void **state) {
  (void)state;
  const size_t shapes[][2] = {{30, 12}, {12, 30}, {40, 8}};
  for (size_t k = 0; k < 3; k++) {
    size_t rows = shapes[k][0], cols = shapes[k][1];
    float *entries = calloc(rows * cols, sizeof *entries);
    uint64_t random = k + 1;
    for (size_t i = 0; i < rows * cols; i++) {
      entries[i] = (float)test_random(&random);
    }
    for (size_t i = 0; k == 2 && i < rows; i++) {
      entries[i * cols + 3] = entries[i * cols + 5];
    }
    test_room room = room_of(rows, cols, entries);
    double *b = room_numbers(rows), *x = room_numbers(cols);
    for (size_t i = 0; i < rows; i++) {
      b[i] = (double)cols * (.1 + .5 * test_random(&random));
    }
    const char *methods[] = {"bounded", "auto"};
    problem p = problem_of(&room, b);
    for (int m = 0; m < 2; m++) {
      clt_solve_result result = solve(&room, methods[m], 1e-7, b, x);
      assert_string_equal(result.method, "bounded");
      assert_true(result.converged);
      assert_near(result.residual, room_residual(&room, x, b), 1e-12);
      assert_in_box(x, cols);
      assert_true(optimality(&p, x) <= 1e-7 * (1 + 1e-6));
      double reached = objective(&p, x), size = 0;
      for (size_t i = 0; i < rows; i++) {
        size += b[i] * b[i];
      }
      assert_near(reached / size, reference_optimum(&p, x) / size, 1e-9);
    }
    clt_error error = {0};
    clt_solve_result result;
    clt_solve_options options = {.method = "pcg"};
    assert_int_equal(clt_solve(room.transport, room.certificate, b, &options, x, &result, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "use bounded"));
    problem_free(&p);
    free(entries);
    free(b);
    free(x);
    room_free(&room);
  }
}

/* Shadowed rows are dropped from the least squares too. */
static void shadows_take_no_part_in_the_bounded_solve(void **state) {
  (void)state;
  test_room room = room_cube(5, .8, .2, 8);
  size_t n = room.cells;
  float *entries = clt_transport_entries(room.transport, 0);
  for (size_t i = 0; i < n * n; i++) {
    entries[i] = i % n % 6 == 0 ? 0 : entries[i];
  }
  room_certify(&room);
  room_ask(&room, 3, -.2, 1.2);
  for (size_t i = 0; i < n; i += 6) {
    room.b[i] = 5;
  }
  problem p = problem_of(&room, room.b);
  clt_solve_result result = solve(&room, "bounded", 1e-6, room.b, room.x);
  assert_true(result.converged && optimality(&p, room.x) <= 1e-6 * (1 + 1e-6));
  for (size_t j = 0; j < n; j += 6) {
    assert_true(room.x[j] == 0);
  }
  problem_free(&p);
  room_free(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(clamping_is_far_worse_on_a_checkerboard),
      cmocka_unit_test(a_reachable_target_has_the_unbounded_solution),
      cmocka_unit_test(a_negative_target_gives_exactly_black),
      cmocka_unit_test(a_warm_start_reaches_the_same_optimum),
      cmocka_unit_test(least_squares_serve_any_shape),
      cmocka_unit_test(shadows_take_no_part_in_the_bounded_solve),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
