/* The unbounded methods against a direct solve, their limits, and how the dispatch tells of them. */
#include "rooms.h"

static clt_solve_result solve(const test_room *room, const char *method, double tolerance, const double *b, double *x) {
  clt_error error = {0};
  clt_solve_result result;
  clt_solve_options options = {.method = method, .tolerance = tolerance};
  assert_ok(clt_solve(room->transport, room->certificate, b, &options, x, &result, &error), error);
  assert_near(result.residual, room_residual(room, x, b), 1e-12);
  return result;
}

static void assert_refused(const test_room *room, const clt_solve_options *options, const double *b,
                           const char *phrase) {
  clt_error error = {0};
  clt_solve_result result;
  double *x = room_numbers(4 * room->cells);
  assert_int_equal(clt_solve(room->transport, room->certificate, b, options, x, &result, &error), CLT_BAD_INPUT);
  if (strstr(error.message, phrase) == NULL) {
    fail_msg("\"%s\" does not say \"%s\"", error.message, phrase);
  }
  free(x);
}

/* Every method reaches the LU solution, to its tolerance times the condition of S (below 40 here). */
static void agree_with_a_direct_solve(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    test_room room = room_make((recipe){
        .width = 9, .height = 7, .channels = 3, .seed = seed, .albedo = {.45, .3, .1}, .spread = .5, .openness = .1});
    size_t values = 3 * room.cells;
    double *direct = room_numbers(values);
    room_ask(&room, seed, -0.5, 1.5);
    for (int c = 0; c < 3; c++) {
      room_direct(&room, c, room.b + (size_t)c * room.cells, direct + (size_t)c * room.cells);
    }
    assert_true(room_distance(direct, room.known, values) < 1e-12);
    const char *methods[] = {"jacobi", "pcg", "gmres"};
    for (int m = 0; m < 3; m++) {
      clt_solve_result result = solve(&room, methods[m], 1e-9, room.b, room.x);
      assert_string_equal(result.method, methods[m]);
      assert_true(result.converged && result.residual <= 1e-9);
      assert_true(room_distance(room.x, direct, values) < 4e-8);
      assert_int_equal(result.curve_count, result.iterations + 1);
      assert_near(result.curve[result.curve_count - 1], result.residual, 1e-10);
      assert_near(result.curve[0], 1, 1e-12);
    }
    free(direct);
    room_free(&room);
  }
}

/* NUMERICS section 1: conjugate gradients need a handful of products at any albedo; Jacobi none that help. */
static void converge_at_every_albedo(void **state) {
  (void)state;
  const double albedos[] = {.1, .45, .62, .9, .99};
  for (size_t k = 0; k < sizeof albedos / sizeof albedos[0]; k++) {
    test_room room = room_cube(8, albedos[k], 0, 7 + k);
    room_ask(&room, k, 0, 1);
    clt_solve_result pcg = solve(&room, "pcg", 1e-3, room.b, room.x);
    clt_solve_result gmres = solve(&room, "gmres", 1e-3, room.b, room.x);
    const clt_channel_certificate *channel = clt_certificate_channel(room.certificate, 0);
    print_message("albedo %.2f: rho(R) in [%.4g, %.4g], defect %.2g, pcg %d, gmres %d iterations\n", albedos[k],
                  channel->radius_low, channel->radius_high, channel->reciprocity, pcg.iterations, gmres.iterations);
    assert_true(pcg.converged && pcg.iterations <= 6);
    assert_true(gmres.converged && gmres.iterations <= 6);
    if (albedos[k] > .5) {
      clt_solve_options options = {.method = "jacobi"};
      assert_refused(&room, &options, room.b, "pcg");
      assert_refused(&room, &options, room.b, "rho(R)");
    } else {
      assert_true(solve(&room, "jacobi", 1e-3, room.b, room.x).converged);
    }
    room_free(&room);
  }
}

/* A random positive T that no flux makes symmetric. */
static test_room asymmetric_room(size_t n, uint64_t seed, double size) {
  float *entries = calloc(n * n, sizeof *entries);
  for (size_t i = 0; i < n * n; i++) {
    double u = test_random(&seed);
    entries[i] = (float)(i % (n + 1) == 0 ? 1 : size * u * u * u / (double)n);
  }
  test_room room = room_of(n, n, entries);
  free(entries);
  return room;
}

static void an_asymmetric_transport_goes_to_what_needs_no_symmetry(void **state) {
  (void)state;
  test_room room = asymmetric_room(80, 11, 6);
  room_ask(&room, 3, 0.1, 0.9);
  assert_true(clt_certificate_channel(room.certificate, 0)->reciprocity > 0.2);
  clt_solve_result result = solve(&room, "auto", 1e-8, room.b, room.x);
  assert_null(strstr(result.method, "pcg"));
  assert_true(result.converged);
  assert_true(room_distance(room.x, room.known, room.cells) < 1e-6);
  room_free(&room);
}

/* A long corridor of cells that light their neighbours: rho(R) = 1.04 cos(pi / 21) > 1, but from x = 1 eight steps do
 * not show it, so Jacobi is let in, diverges, and is replaced. */
static void a_jacobi_that_diverges_is_replaced(void **state) {
  (void)state;
  enum { N = 20 };
  float entries[N * N] = {0};
  for (int i = 0; i < N; i++) {
    entries[i * N + i] = 1;
    if (i + 1 < N) {
      entries[i * N + i + 1] = entries[(i + 1) * N + i] = 0.52f;
    }
  }
  test_room room = room_of(N, N, entries);
  const clt_channel_certificate *channel = clt_certificate_channel(room.certificate, 0);
  assert_true(channel->radius_low < 1 && channel->radius_high >= 1);
  double known[N], b[N], x[N];
  room_wanted(&room, 3, 0, 1, known, b);
  clt_solve_result result = solve(&room, "jacobi", 1e-8, b, x);
  assert_string_not_equal(result.method, "jacobi");
  assert_non_null(strstr(result.reason, "jacobi stopped as its residual grew"));
  assert_true(result.converged && result.residual <= 1e-8);
  room_free(&room);
}

/* NUMERICS section 3: a fifth of the cells in shadow, seen by the camera through interreflection and noise. */
static void shadows_take_no_part(void **state) {
  (void)state;
  test_room room = room_closed(15, 10, .7, 21);
  size_t n = room.cells;
  float *entries = clt_transport_entries(room.transport, 0);
  uint64_t random = 4;
  for (size_t j = 0; j < n; j += 5) {
    for (size_t i = 0; i < n; i++) {
      entries[i * n + j] = (float)(1e-7 * test_random(&random));
    }
  }
  room_certify(&room);
  assert_int_equal(clt_certificate_channel(room.certificate, 0)->dark, n / 5);
  room_ask(&room, 3, 0.1, 0.9);
  for (size_t i = 0; i < n; i += 5) {
    room.b[i] = 0.7; /* an even target asks of the shadow what it cannot show */
  }
  const char *methods[] = {"pcg", "gmres", "auto"};
  for (int m = 0; m < 3; m++) {
    clt_solve_result result = solve(&room, methods[m], 1e-9, room.b, room.x);
    assert_true(result.converged && room_residual(&room, room.x, room.b) < 1e-8);
    for (size_t j = 0; j < n; j++) {
      assert_near(room.x[j], j % 5 == 0 ? 0 : room.known[j], 1e-5);
    }
  }
  room_free(&room);
}

static void a_warm_start_saves_iterations(void **state) {
  (void)state;
  test_room room = room_closed(12, 10, .9, 2);
  room_ask(&room, 3, 0.1, 0.9);
  clt_solve_result cold = solve(&room, "pcg", 1e-6, room.b, room.x), warm;
  clt_error error = {0};
  clt_solve_options options = {.method = "pcg", .tolerance = 1e-6, .start = room.known};
  assert_ok(clt_solve(room.transport, room.certificate, room.b, &options, room.x, &warm, &error), error);
  assert_true(cold.iterations > 3);
  assert_int_equal(warm.iterations, 0);
  assert_true(warm.residual < 1e-12);
  room_free(&room);
}

static void limits_return_the_best_so_far(void **state) {
  (void)state;
  test_room room = room_closed(12, 10, .9, 2);
  room_ask(&room, 3, -0.5, 1.5);
  clt_error error = {0};
  clt_solve_result result;
  const char *methods[] = {"pcg", "gmres", "bounded", "auto"};
  for (int m = 0; m < 4; m++) {
    clt_solve_options late = {.method = methods[m], .deadline_s = 1e-9};
    assert_ok(clt_solve(room.transport, room.certificate, room.b, &late, room.x, &result, &error), error);
    assert_false(result.converged);
    clt_solve_options few = {.method = methods[m], .tolerance = 1e-12, .iteration_limit = 2};
    assert_ok(clt_solve(room.transport, room.certificate, room.b, &few, room.x, &result, &error), error);
    assert_false(result.converged);
    assert_int_equal(result.iterations, 2);
    assert_true(result.residual < 1 && isfinite(room_residual(&room, room.x, room.b)));
  }
  room_free(&room);
}

/* Asking for more than double holds ends at what it does hold. */
static void an_unreachable_tolerance_ends(void **state) {
  (void)state;
  test_room room = room_closed(8, 8, .3, 2);
  room_ask(&room, 3, 0.1, 0.9);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    clt_solve_result result = solve(&room, clt_method_name(m), 1e-30, room.b, room.x);
    assert_true(result.residual < 1e-13);
    assert_true(m == 0 ? !result.converged : result.iterations < 200); /* Jacobi runs into the limit */
  }
  room_free(&room);
}

static void bad_input_is_refused(void **state) {
  (void)state;
  test_room room = room_closed(5, 4, .4, 1), other = room_closed(4, 4, .4, 1);
  double b[20], bad[20];
  for (int i = 0; i < 20; i++) {
    b[i] = bad[i] = 0.5;
  }
  bad[7] = NAN;
  assert_refused(&room, &(clt_solve_options){.method = "newton"}, b, "use one of: auto, series, jacobi, ");
  assert_refused(&room, &(clt_solve_options){.tolerance = -1e-3}, b, "tolerance");
  assert_refused(&room, &(clt_solve_options){.tolerance = NAN}, b, "tolerance");
  assert_refused(&room, &(clt_solve_options){.iteration_limit = -1}, b, "iteration limit");
  assert_refused(&room, NULL, bad, "value 7 of the target");
  assert_refused(&room, &(clt_solve_options){.start = bad}, b, "value 7 of the start");
  bad[7] = INFINITY;
  assert_refused(&room, NULL, bad, "value 7 of the target");
  clt_certificate *certificate = room.certificate;
  room.certificate = other.certificate;
  assert_refused(&room, NULL, b, "another transport");
  room.certificate = certificate;
  room_free(&room);
  room_free(&other);
}

static void methods_are_listed(void **state) {
  (void)state;
  const char *names[] = {"jacobi", "pcg", "gmres", "bounded", "direct", "stored-inverse", "matrix", "clusters"};
  size_t count = 0;
  for (; clt_method_name(count) != NULL; count++) {
    assert_true(strlen(clt_method_summary(count)) > 20);
    for (size_t i = 0; i < count; i++) {
      assert_string_not_equal(clt_method_name(i), clt_method_name(count));
    }
  }
  for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
    size_t i = 0;
    while (i < count && strcmp(clt_method_name(i), names[k]) != 0) {
      i++;
    }
    assert_true(i < count);
  }
  assert_null(clt_method_summary(count));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(agree_with_a_direct_solve),
      cmocka_unit_test(converge_at_every_albedo),
      cmocka_unit_test(an_asymmetric_transport_goes_to_what_needs_no_symmetry),
      cmocka_unit_test(a_jacobi_that_diverges_is_replaced),
      cmocka_unit_test(shadows_take_no_part),
      cmocka_unit_test(a_warm_start_saves_iterations),
      cmocka_unit_test(limits_return_the_best_so_far),
      cmocka_unit_test(an_unreachable_tolerance_ends),
      cmocka_unit_test(bad_input_is_refused),
      cmocka_unit_test(methods_are_listed),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
