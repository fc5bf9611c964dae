/* The iterative methods against the known spectrum of the closed cube, against each other and against LAPACK. */
#include <cblas.h>

#include "rooms.h"
#include "solve/method.h"

static clt_status solve(const test_room *room, const char *method, double tolerance, int limit,
                        clt_solve_result *result) {
  clt_error error = {0};
  clt_solve_options options = {.method = method, .tolerance = tolerance, .iteration_limit = limit};
  return clt_solve(room->transport, room->certificate, room->b, &options, room->x, result, &error);
}

/* ||F (x - known)|| / ||F known||: the error of the direct light. */
static double light_error(const test_room *room) {
  const double *first = clt_certificate_first_bounce(room->certificate, 0);
  double off = 0, size = 0;
  for (size_t j = 0; j < room->cells; j++) {
    double rest = first[j] * (room->x[j] - room->known[j]), light = first[j] * room->known[j];
    off += rest * rest;
    size += light * light;
  }
  return sqrt(off / size);
}

/* Iterations until the direct light is known to 1e-3; `most` + 1 where they do not suffice, -1 where the method is
 * refused or gives way to another. */
static int needed(const test_room *room, const char *method, int most) {
  for (int n = 1; n <= most; n++) {
    clt_solve_result result;
    if (solve(room, method, 1e-13, n, &result) != CLT_OK || strcmp(result.method, method) != 0) {
      return -1;
    }
    if (light_error(room) <= 1e-3) {
      return n;
    }
  }
  return most + 1;
}

/* The closed cube of 384 patches: what a prototype in double took with F = I (33 iterations of Jacobi's at albedo 0.45,
 * 6 8 16 of Chebyshev's, 4 4 6 6 of conjugate gradients), and what theory allows: damped gains the factor m at least in
 * every iteration, Gauss-Seidel is as fast as there or faster. */
static void iterations_in_a_closed_cube(void **state) {
  (void)state;
  const struct {
    double albedo;
    int jacobi, gauss_seidel, chebyshev, gradients;
  } rows[] = {{0.45, 33, 4, 6, 4}, {0.62, -1, 7, 8, 4}, {0.9, -1, 54, 16, 6}};
  for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
    for (uint64_t seed = 1; seed <= 3; seed++) {
      test_room room = room_cube(8, rows[k].albedo, 0, seed);
      room_ask(&room, seed, 0, 1);
      int jacobi = needed(&room, "jacobi", 60), relaxed = needed(&room, "gauss-seidel", 80);
      int damped = needed(&room, "damped", 80), chebyshev = needed(&room, "chebyshev", 40);
      int gradients = needed(&room, "pcg", 20), deflated = needed(&room, "deflated-pcg", 20);
      print_message("albedo %g: jacobi %d, gauss-seidel %d, damped %d, chebyshev %d, pcg %d, deflated %d\n",
                    rows[k].albedo, jacobi, relaxed, damped, chebyshev, gradients, deflated);
      assert_true(rows[k].jacobi < 0 ? jacobi < 0 : abs(jacobi - rows[k].jacobi) <= 3);
      assert_true(abs(chebyshev - rows[k].chebyshev) <= 1);
      assert_true(abs(gradients - rows[k].gradients) <= 1 && deflated <= gradients);
      assert_true(relaxed > 0 && relaxed <= 1.1 * rows[k].gauss_seidel + 1);
      assert_true(damped <= ceil(log(1e-3) / log(rows[k].albedo)));
      room_free(&room);
    }
  }
}

/* Albedo 0.99: six or seven iterations of conjugate gradients, about fifty of Chebyshev's, the rest in hundreds. */
static void a_room_that_loses_one_percent(void **state) {
  (void)state;
  test_room room = room_cube(8, 0.99, 0, 2);
  room_ask(&room, 5, 0, 1);
  int gradients = needed(&room, "pcg", 20), chebyshev = needed(&room, "chebyshev", 70);
  clt_solve_result result;
  assert_true(gradients >= 5 && gradients <= 7);
  assert_true(chebyshev >= 40 && chebyshev <= 53);
  assert_int_equal(solve(&room, "sor", 1e-6, 5000, &result), CLT_OK);
  assert_true(result.converged && result.iterations < 400);
  assert_true(room_residual(&room, room.x, room.b) <= 1.01e-6);
  room_free(&room);
}

/* Eq. 16 term by term, eq. 43 and eq. 45 are the same after equally many steps. */
static void series_iteration_and_matrix_agree(void **state) {
  (void)state;
  enum { STEPS = 12 };
  for (uint64_t seed = 1; seed <= 3; seed++) {
    test_room room = room_cube(5, 0.4, 0.3, seed);
    size_t n = room.cells;
    room_ask(&room, seed, 0, 1);
    double *x = room_numbers(n), *r = room_numbers(3 * n * n), *inverse = r + n * n, *next = inverse + n * n;
    const double *first = clt_certificate_first_bounce(room.certificate, 0);
    const float *entries = clt_transport_entries(room.transport, 0);
    for (size_t i = 0; i < n; i++) {
      for (size_t j = 0; j < n; j++) {
        r[i * n + j] = (double)entries[i * n + j] / first[j] - (i == j);
        inverse[i * n + j] = i == j;
      }
    }
    for (int step = 1; step <= STEPS; step++) {
      clt_solve_result result;
      assert_int_equal(solve(&room, "jacobi", 1e-15, step + 1, &result), CLT_OK);
      memcpy(x, room.x, n * sizeof *x);
      assert_int_equal(solve(&room, "series", 1e-15, step + 1, &result), CLT_OK);
      assert_true(room_distance(room.x, x, n) <= 1e-10);
      for (size_t k = 0; k < n * n; k++) {
        next[k] = k / n == k % n;
      }
      cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (blasint)n, (blasint)n, (blasint)n, -1, r, (blasint)n,
                  inverse, (blasint)n, 1, next, (blasint)n);
      memcpy(inverse, next, n * n * sizeof *inverse);
      for (size_t i = 0; i < n; i++) {
        x[i] = cblas_ddot((blasint)n, inverse + i * n, 1, room.b, 1) / first[i];
      }
      assert_true(room_distance(room.x, x, n) <= 1e-10);
    }
    free(x);
    free(r);
    room_free(&room);
  }
}

/* Every iterative method reaches the answer of LAPACK's LU, on rooms of several kinds. */
static void all_reach_the_direct_solution(void **state) {
  (void)state;
  const char *methods[] = {"damped", "chebyshev", "pcg", "deflated-pcg", "gauss-seidel", "sor", "southwell", "lsmr"};
  const recipe kinds[] = {{.width = 12, .height = 10, .albedo = {0.5}},
                          {.width = 12, .height = 10, .albedo = {0.8}, .spread = 0.9},
                          {.width = 30, .height = 5, .albedo = {0.9}, .shape = SHAPE_CUBE},
                          {.width = 12, .height = 10, .albedo = {0.95}, .openness = 0.2},
                          {.width = 12, .height = 10, .albedo = {0.9}, .shape = SHAPE_PLATES}};
  for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
    recipe made = kinds[k];
    made.channels = 1;
    made.seed = k + 1;
    test_room room = room_make(made);
    room_ask(&room, k + 7, 0, 1);
    double *wanted = room_numbers(room.cells);
    room_direct(&room, 0, room.b, wanted);
    for (size_t m = 0; m < sizeof methods / sizeof methods[0]; m++) {
      clt_solve_result result;
      assert_int_equal(solve(&room, methods[m], 1e-9, 5000, &result), CLT_OK);
      assert_string_equal(result.method, methods[m]);
      assert_true(room_residual(&room, room.x, room.b) <= 1.01e-9);
      assert_true(room_distance(room.x, wanted, room.cells) <= 1e-6);
    }
    free(wanted);
    room_free(&room);
  }
}

/* Hard cases 10 and 11: duplicate columns give the drive of least norm, rows != columns the least squares, as LAPACK's
 * singular values do. */
static void lsmr_is_least_squares_of_least_norm(void **state) {
  (void)state;
  const size_t shapes[][2] = {{40, 40}, {70, 40}, {40, 60}};
  for (size_t k = 0; k < 3; k++) {
    for (uint64_t seed = 1; seed <= 3; seed++) {
      size_t rows = shapes[k][0], cols = shapes[k][1], longer = rows > cols ? rows : cols;
      uint64_t random = seed + 10 * k;
      float *entries = calloc(rows * cols, sizeof *entries);
      double *matrix = room_numbers(rows * cols), *wanted = room_numbers(longer), *singular = room_numbers(longer);
      for (size_t i = 0; i < rows * cols; i++) {
        size_t row = i / cols, column = i % cols;
        entries[i] = (float)(test_random(&random) + (row == column ? 4 : 0));
      }
      for (size_t i = 0; i < rows; i++) {
        entries[i * cols + cols - 1] = entries[i * cols + cols - 2]; /* two columns are the same */
      }
      test_room room = room_of(rows, cols, entries);
      room.b = room_numbers(rows);
      room.x = room_numbers(cols);
      for (size_t i = 0; i < rows; i++) {
        wanted[i] = room.b[i] = test_random(&random);
      }
      for (size_t i = 0; i < rows * cols; i++) {
        matrix[i] = (double)entries[i];
      }
      lapack_int rank = 0;
      assert_int_equal(LAPACKE_dgelsd(LAPACK_ROW_MAJOR, (lapack_int)rows, (lapack_int)cols, 1, matrix, (lapack_int)cols,
                                      wanted, 1, singular, 1e-9, &rank),
                       0);
      clt_solve_result result;
      assert_int_equal(solve(&room, "lsmr", 1e-10, 2000, &result), CLT_OK);
      assert_true(room_distance(room.x, wanted, cols) <= 1e-5);
      assert_near(room.x[cols - 1], room.x[cols - 2], 1e-6);
      free(entries);
      free(matrix);
      free(wanted);
      free(singular);
      room_free(&room);
    }
  }
}

/* What the certificate shows to diverge is refused with the reason. */
static void divergence_is_refused(void **state) {
  (void)state;
  test_room room = room_cube(5, 0.62, 0, 1);
  clt_error error = {0};
  clt_solve_result result;
  room_ask(&room, 1, 0, 1);
  for (int k = 0; k < 2; k++) {
    const char *method = k == 0 ? "series" : "jacobi";
    clt_solve_options options = {.method = method};
    assert_int_equal(clt_solve(room.transport, room.certificate, room.b, &options, room.x, &result, &error),
                     CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "rho(R)"));
    assert_non_null(strstr(error.message, method));
  }
  room_free(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(iterations_in_a_closed_cube),         cmocka_unit_test(a_room_that_loses_one_percent),
      cmocka_unit_test(series_iteration_and_matrix_agree),   cmocka_unit_test(all_reach_the_direct_solution),
      cmocka_unit_test(lsmr_is_least_squares_of_least_norm), cmocka_unit_test(divergence_is_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
