/* A solver used again, channels together, the discrepancy stop, deadlines and bad input: for every method there is. */
#include <lapacke.h>

#include "rooms.h"

static bool needs_entries_of_a_square(const char *method) {
  return strcmp(method, "bounded") != 0 && strcmp(method, "lsmr") != 0;
}

/* Three channels whose interreflection every method certifies. */
static test_room tame_room(uint64_t seed) {
  return room_make((recipe){
      .width = 8, .height = 6, .channels = 3, .seed = seed, .albedo = {.35, .2, .05}, .spread = .4, .openness = .1});
}

/* ||T x - b|| / ||b|| of one channel over its lit rows, recomputed. */
static double channel_residual(const test_room *room, int c, const double *x, const double *b) {
  const unsigned char *lit = clt_certificate_lit(room->certificate, c);
  double *y = room_numbers(room->cells), rest = 0, size = 0;
  size_t at = (size_t)c * room->cells;
  room_product(room->transport, c, x + at, y);
  for (size_t i = 0; i < room->cells; i++) {
    rest += lit[i] ? (y[i] - b[at + i]) * (y[i] - b[at + i]) : 0;
    size += lit[i] ? b[at + i] * b[at + i] : 0;
  }
  free(y);
  return size > 0 ? sqrt(rest / size) : 0;
}

static clt_solve_result solve_with(const test_room *room, const clt_solve_options *options, const double *b,
                                   double *x) {
  clt_error error = {0};
  clt_solve_result result;
  assert_ok(clt_solve(room->transport, room->certificate, b, options, x, &result, &error), error);
  return result;
}

/* What one solver answers to many targets is what a fresh one answers to each. */
static void a_solver_is_as_good_as_new(void **state) {
  (void)state;
  test_room room = tame_room(5);
  size_t values = 3 * room.cells;
  double *x = room_numbers(values), *fresh = room_numbers(values);
  clt_error error = {0};
  clt_solve_result result;
  room_ask(&room, 1, 0, 1);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    clt_solve_options options = {.method = clt_method_name(m), .tolerance = 1e-5, .iteration_limit = 200};
    clt_solver *solver = NULL;
    assert_ok(clt_solver_create(room.transport, room.certificate, &options, &solver, &error), error);
    for (uint64_t seed = 1; seed <= 4; seed++) {
      room_wanted(&room, seed, seed % 2 ? -.3 : .1, seed % 2 ? 1.3 : .9, room.known, room.b);
      assert_ok(clt_solver_run(solver, room.b, NULL, x, &result, &error), error);
      clt_solve_result alone = solve_with(&room, &options, room.b, fresh);
      assert_int_equal(result.iterations, alone.iterations);
      assert_int_equal(result.converged, alone.converged);
      assert_string_equal(result.method, alone.method);
      assert_true(room_distance(x, fresh, values) < 1e-12);
      assert_near(result.residual, room_residual(&room, x, room.b), 1e-9);
    }
    clt_solver_destroy(solver);
  }
  clt_solver_destroy(NULL);
  free(x);
  free(fresh);
  room_free(&room);
}

/* Case 22: a bright channel, a dim one and one without light reach the tolerance each, together as apart. */
static void channels_together_each_reach_the_tolerance(void **state) {
  (void)state;
  const char *methods[] = {"pcg", "gmres", "bounded", "auto"};
  for (uint64_t seed = 1; seed <= 4; seed++) {
    test_room room = room_make(
        (recipe){.width = 9, .height = 8, .channels = 3, .seed = seed, .albedo = {.95, .05, 0}, .spread = .2});
    size_t values = 3 * room.cells;
    double *apart = room_numbers(values);
    room_ask(&room, seed, .05, .95);
    for (size_t i = 0; i < room.cells; i++) {
      room.b[room.cells + i] *= 1e-3; /* a target of its own brightness */
      room.known[room.cells + i] *= 1e-3;
    }
    for (int m = 0; m < 4; m++) {
      clt_solve_options options = {.method = methods[m], .tolerance = 1e-6};
      clt_solve_result one = solve_with(&room, &options, room.b, apart);
      options.together = true;
      clt_solve_result all = solve_with(&room, &options, room.b, room.x);
      assert_true(one.converged && all.converged);
      assert_string_equal(one.method, all.method);
      for (int c = 0; c < 3; c++) {
        size_t at = (size_t)c * room.cells;
        double limit = strcmp(all.method, "bounded") == 0 ? 1e-4 : 1e-6 * (1 + 1e-6);
        assert_true(channel_residual(&room, c, room.x, room.b) <= limit);
        assert_true(room_distance(room.x + at, apart + at, room.cells) < 1e-3);
        assert_true(room_distance(room.x + at, room.known + at, room.cells) < 1e-3);
      }
    }
    free(apart);
    room_free(&room);
  }
}

static void together_serves_every_method(void **state) {
  (void)state;
  test_room room = tame_room(6);
  size_t values = 3 * room.cells;
  double *apart = room_numbers(values);
  room_ask(&room, 3, .1, .9);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    clt_solve_options options = {.method = clt_method_name(m), .tolerance = 1e-6};
    clt_solve_result one = solve_with(&room, &options, room.b, apart);
    options.together = true;
    clt_solve_result all = solve_with(&room, &options, room.b, room.x);
    assert_int_equal(one.converged, all.converged);
    assert_near(all.residual, room_residual(&room, room.x, room.b), 1e-9);
    if (all.converged) {
      assert_true(room_distance(room.x, apart, values) < 1e-4);
    }
  }
  free(apart);
  room_free(&room);
}

/* A normal number from uniform ones (Box & Muller 1958). */
static double normal(uint64_t *random) {
  double u = test_random(random), v = test_random(random);
  return sqrt(-2 * log(1 - u)) * cos(2 * M_PI * v);
}

/* A measured T and a wanted picture with noise. Iterations past the noise fit it: they bring what is shown hardly
 * nearer (S is well conditioned, so the fit costs little either). */
static void the_discrepancy_stop_ends_in_the_noise(void **state) {
  (void)state;
  const char *methods[] = {"pcg", "gmres", "bounded"};
  const double sigma_entry = 2e-3, sigma_wanted = 1e-2;
  for (uint64_t seed = 1; seed <= 6; seed++) {
    test_room clean = room_cube(5, .8, .3, seed), room = room_cube(5, .8, .3, seed);
    size_t n = room.cells;
    clt_error error = {0};
    uint64_t random = seed;
    float *entries = clt_transport_entries(room.transport, 0);
    for (size_t i = 0; i < n * n; i++) {
      entries[i] += (float)(sigma_entry * normal(&random));
    }
    assert_ok(clt_transport_keep_sigma(room.transport, &error), error);
    for (size_t i = 0; i < n; i++) {
      clt_transport_sigma_values(room.transport, 0)[i] = (float)sigma_entry;
    }
    room_certify(&room);
    room_ask(&clean, seed, .2, .8);
    for (size_t i = 0; i < n; i++) {
      clean.known[i] = .5 + .3 * sin(.4 * (double)(i % 30) + (double)seed) * cos(.5 * (double)(i / 30));
    }
    room_product(clean.transport, 0, clean.known, clean.b);
    double *noisy = room_numbers(n), *x = room_numbers(n);
    for (size_t i = 0; i < n; i++) {
      noisy[i] = clean.b[i] + sigma_wanted * normal(&random);
    }
    for (int m = 0; m < 3; m++) {
      clt_solve_options options = {.method = methods[m], .tolerance = 1e-8, .discrepancy = true, .noise = sigma_wanted};
      clt_solve_result stopped = solve_with(&room, &options, noisy, x);
      double squares = 0, size = 0;
      for (size_t i = 0; i < n; i++) {
        squares += x[i] * x[i];
        size += noisy[i] * noisy[i];
      }
      double floor =
          1.05 * sqrt((double)n * (sigma_wanted * sigma_wanted + sigma_entry * sigma_entry * squares)) / sqrt(size);
      assert_true(stopped.converged);
      assert_true(room_residual(&room, x, noisy) <= floor * (1 + 1e-5));
      double *y = room_numbers(n);
      double appearance = room_residual(&clean, x, clean.b);
      options.discrepancy = false;
      clt_solve_result precise = solve_with(&room, &options, noisy, y);
      assert_true(precise.iterations > stopped.iterations);
      assert_true(appearance <= 1.1 * room_residual(&clean, y, clean.b));
      if (seed == 1) {
        print_message("%s: %d iterations to the noise, %d to 1e-8; seen %.4f and %.4f off\n", methods[m],
                      stopped.iterations, precise.iterations, appearance, room_residual(&clean, y, clean.b));
      }
      free(y);
    }
    free(noisy);
    free(x);
    room_free(&clean);
    room_free(&room);
  }
}

/* Whatever the method, an answer of numbers comes back when time is up, and it is no worse than black. */
static void a_deadline_leaves_the_best_so_far(void **state) {
  (void)state;
  test_room room = tame_room(7);
  size_t values = 3 * room.cells;
  room_ask(&room, 3, .1, .9);
  const double deadlines[] = {1e-12, 1e-6, 1e-4, 0, -1};
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    for (size_t k = 0; k < sizeof deadlines / sizeof *deadlines; k++) {
      clt_solve_options options = {.method = clt_method_name(m), .tolerance = 1e-4, .deadline_s = deadlines[k]};
      for (size_t j = 0; j < values; j++) {
        room.x[j] = NAN;
      }
      clt_solve_result result = solve_with(&room, &options, room.b, room.x);
      for (size_t j = 0; j < values; j++) {
        assert_true(isfinite(room.x[j]));
      }
      assert_true(isfinite(result.residual) && result.residual <= 1 + 1e-12);
      assert_near(result.residual, room_residual(&room, room.x, room.b), 1e-9);
      assert_true(result.seconds < 5);
    }
  }
  clt_solve_options options = {.deadline_s = 1e-12};
  solve_with(&room, &options, room.b, room.x);
  for (size_t j = 0; j < values; j++) {
    assert_true(room.x[j] >= 0 && room.x[j] <= 1);
  }
  room_free(&room);
}

/* Values that are no numbers and limits that are none are refused by every method, with their place. */
static void bad_input_is_refused_by_every_method(void **state) {
  (void)state;
  test_room room = tame_room(8);
  room_ask(&room, 3, .1, .9);
  const double wrong[] = {NAN, INFINITY, -INFINITY, 1e200}, limits[] = {-1e-3, NAN, INFINITY};
  clt_error error = {0};
  clt_solve_result result;
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    clt_solver *solver = NULL;
    clt_solve_options options = {.method = clt_method_name(m)};
    assert_ok(clt_solver_create(room.transport, room.certificate, &options, &solver, &error), error);
    double kept = room.b[9];
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
      room.b[9] = wrong[k];
      assert_int_equal(clt_solver_run(solver, room.b, NULL, room.x, &result, &error), CLT_BAD_INPUT);
      assert_non_null(strstr(error.message, "value 9 of the target"));
      room.b[9] = kept;
      room.x[11] = wrong[k];
      assert_int_equal(clt_solver_run(solver, room.b, room.x, room.known, &result, &error), CLT_BAD_INPUT);
      assert_non_null(strstr(error.message, "value 11 of the start"));
      room.x[11] = 0;
    }
    clt_solver_destroy(solver);
    for (size_t k = 0; k < sizeof limits / sizeof *limits; k++) {
      options.tolerance = limits[k];
      assert_int_equal(clt_solver_create(room.transport, room.certificate, &options, &solver, &error), CLT_BAD_INPUT);
      assert_non_null(strstr(error.message, "tolerance"));
    }
    options = (clt_solve_options){.method = clt_method_name(m), .noise = NAN};
    assert_int_equal(clt_solver_create(room.transport, room.certificate, &options, &solver, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "noise"));
    options = (clt_solve_options){.method = clt_method_name(m), .deadline_s = NAN};
    assert_int_equal(clt_solver_create(room.transport, room.certificate, &options, &solver, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "deadline"));
  }
  room_free(&room);
}

/* A NaN among the lit entries is named when T is certified; one on the diagonal makes its cell dark and harms nothing:
 * the others reach the answer of the room without that cell. */
static void a_transport_with_nan_is_refused_or_masked(void **state) {
  (void)state;
  const float wrong[] = {NAN, INFINITY};
  for (int k = 0; k < 2; k++) {
    test_room room = room_closed(6, 5, .3, 4);
    size_t n = room.cells;
    float *entries = clt_transport_entries(room.transport, 0);
    entries[7 * n + 7] = wrong[k];
    room_certify(&room);
    assert_int_equal(clt_certificate_lit(room.certificate, 0)[7], 0);
    room_ask(&room, 3, .1, .9);
    for (size_t i = 0; i < n; i++) {
      room.b[i] = .1 + .01 * (double)(i % 3);
    }
    test_room without = room_closed(6, 5, .3, 4);
    for (size_t i = 0; i < n; i++) {
      clt_transport_entries(without.transport, 0)[7 * n + i] = clt_transport_entries(without.transport, 0)[i * n + 7] =
          0;
    }
    clt_transport_entries(without.transport, 0)[7 * n + 7] = 1;
    double *x = room_numbers(n);
    room_direct(&without, 0, room.b, x);
    x[7] = 0;
    for (size_t m = 0; clt_method_name(m) != NULL; m++) {
      clt_solve_options options = {.method = clt_method_name(m), .tolerance = 1e-8, .iteration_limit = 300};
      clt_solve_result result = solve_with(&room, &options, room.b, room.x);
      for (size_t j = 0; j < n; j++) {
        assert_true(isfinite(room.x[j]) && (j != 7 || room.x[j] == 0));
      }
      if (result.converged && needs_entries_of_a_square(options.method)) {
        assert_true(room_distance(room.x, x, n) < 1e-5);
      }
    }
    free(x);
    room_free(&without);
    entries[3 * n + 9] = wrong[k];
    clt_certificate *certificate = NULL;
    clt_error error = {0};
    assert_int_equal(clt_certify(room.transport, &certificate, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "row 3 of channel 0"));
    assert_null(certificate);
    room_free(&room);
  }
}

/* Where one channel only needs the bounded solve, the answer tells of it, whichever channel that is. */
static void what_one_channel_needed_is_told(void **state) {
  (void)state;
  for (int dark = 0; dark < 3; dark++) {
    test_room room = room_make((recipe){.width = 10, .height = 8, .channels = 3, .seed = 4, .albedo = {0.7, 0.7, 0.7}});
    room_ask(&room, 5, 0.3, 0.7);
    for (size_t i = 0; i < room.cells; i++) {
      room.b[(size_t)dark * room.cells + i] *= i % 2 == 0 ? 1.0 : 0.0;
    }
    clt_solve_options options = {.tolerance = 1e-6};
    clt_solve_result result = solve_with(&room, &options, room.b, room.x);
    assert_string_equal(result.method, "bounded");
    assert_non_null(strstr(result.reason, "bounded optimum"));
    room_free(&room);
  }
}

/* What a method says of its own residual is what a product with T finds, or more; the drive does not depend on it. */
static void a_trusted_method_tells_the_truth(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    test_room room = tame_room(seed);
    size_t values = 3 * room.cells;
    double *x = room_numbers(values), *measured = room_numbers(values);
    room_ask(&room, seed, 0.1, 0.9);
    for (size_t m = 0; clt_method_name(m) != NULL; m++) {
      clt_solve_options options = {.method = clt_method_name(m), .tolerance = 1e-3, .iteration_limit = 200};
      clt_solve_result looked = solve_with(&room, &options, room.b, measured);
      options.trust = true;
      clt_solve_result told = solve_with(&room, &options, room.b, x);
      double truth = room_residual(&room, x, room.b);
      assert_memory_equal(x, measured, values * sizeof *x);
      assert_near(looked.residual, truth, 1e-9);
      assert_true(told.residual >= truth * (1 - 1e-6) - 1e-12);
      assert_true(told.residual <= (told.converged ? fmax(truth, options.tolerance) : truth) * (1 + 1e-6) + 1e-12);
    }
    free(x);
    free(measured);
    room_free(&room);
  }
}

/* A picture that leaves 0..1 is clipped or sought within: then the residual is measured whatever was said of trust. */
static void what_is_clipped_is_measured(void **state) {
  (void)state;
  test_room room = tame_room(2);
  room_ask(&room, 7, -0.3, 1.3);
  clt_solve_options options = {.tolerance = 1e-4, .trust = true};
  clt_solve_result result = solve_with(&room, &options, room.b, room.x);
  assert_true(result.residual > 0.01);
  assert_near(result.residual, room_residual(&room, room.x, room.b), 1e-9);
  room_free(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_solver_is_as_good_as_new),
      cmocka_unit_test(channels_together_each_reach_the_tolerance),
      cmocka_unit_test(together_serves_every_method),
      cmocka_unit_test(the_discrepancy_stop_ends_in_the_noise),
      cmocka_unit_test(a_deadline_leaves_the_best_so_far),
      cmocka_unit_test(bad_input_is_refused_by_every_method),
      cmocka_unit_test(a_transport_with_nan_is_refused_or_masked),
      cmocka_unit_test(what_one_channel_needed_is_told),
      cmocka_unit_test(a_trusted_method_tells_the_truth),
      cmocka_unit_test(what_is_clipped_is_measured),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
