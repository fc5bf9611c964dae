/* What the certificate foretells against what then happens: iterations and time, method by method. */
#include "rooms.h"

/* Within this factor, or one iteration: methods whose iterate is a polynomial of S, and the others; and times, in the
 * median. */
static const double POLYNOMIAL = 1.6, OTHERS = 6, TIMES = 4;
static const double TOLERANCES[] = {1e-1, 1e-2, 1e-4, 1e-6};
enum { TOLERANCE_COUNT = sizeof TOLERANCES / sizeof TOLERANCES[0], METHODS_MOST = 32, TIMES_MOST = 4096, REPEATS = 2 };

typedef struct tally {
  double low[METHODS_MOST], high[METHODS_MOST]; /* of foretold over real iterations */
  double time[TIMES_MOST];                      /* of foretold over real seconds */
  int times, compared[METHODS_MOST], refused;
} tally;

static bool is_polynomial(const char *method) {
  static const char *const names[] = {"series", "jacobi", "damped", "chebyshev", "pcg", "deflated-pcg", "gmres"};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
    if (strcmp(names[i], method) == 0) {
      return true;
    }
  }
  return false;
}

/* An iteration more or less is none. */
static double ratio(double foretold, double real) {
  return fabs(foretold - real) <= 1 ? 1 : foretold / real;
}

static void compare(const test_room *room, size_t m, double tolerance, tally *all) {
  clt_error error = {0};
  clt_solve_options options = {.method = clt_method_name(m), .tolerance = tolerance};
  clt_forecast foretold;
  clt_solver *solver = NULL;
  clt_solve_result real;
  assert_ok(clt_forecast_solve(room->transport, room->certificate, &options, &foretold, &error), error);
  clt_status status = clt_solver_create(room->transport, room->certificate, &options, &solver, &error);
  if (status != CLT_OK) {
    all->refused++;
    return;
  }
  assert_true(foretold.possible);
  double least = INFINITY; /* other programs only add to a time */
  for (int k = 0; k < REPEATS; k++) {
    assert_ok(clt_solver_run(solver, room->b, NULL, room->x, &real, &error), error);
    least = fmin(least, real.seconds);
  }
  clt_solver_destroy(solver);
  if (strcmp(real.method, options.method) != 0 || !real.converged || real.iterations == 0) {
    return;
  }
  double many = ratio(foretold.iterations, real.iterations);
  all->low[m] = fmin(all->low[m], many);
  all->high[m] = fmax(all->high[m], many);
  all->compared[m]++;
  if (is_polynomial(options.method)) {
    assert_true(all->times < TIMES_MOST);
    all->time[all->times++] = foretold.seconds / least;
  }
}

static void ask_picture(test_room *room, uint64_t seed) {
  for (size_t i = 0; i < room->cells; i++) {
    room->b[i] = test_random(&seed);
  }
}

static void compare_all(test_room *room, uint64_t seed, tally *all) {
  /* a picture in values, not the light of a random drive: what is asked for in earnest */
  room->x = room->x != NULL ? room->x : room_numbers(room->cells);
  room->b = room->b != NULL ? room->b : room_numbers(room->cells);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    ask_picture(room, seed);
    if (strcmp(clt_method_name(m), "bounded") == 0) { /* foretold for a target that can be reached */
      room_wanted(room, seed, .05, .95, room->x, room->b);
    }
    for (size_t t = 0; t < TOLERANCE_COUNT; t++) {
      compare(room, m, TOLERANCES[t], all);
    }
  }
}

static tally *tally_open(void) {
  tally *all = calloc(1, sizeof *all);
  assert_non_null(all);
  for (size_t m = 0; m < METHODS_MOST; m++) {
    all->low[m] = INFINITY;
  }
  return all;
}

static int compare_numbers(const void *left, const void *right) {
  double a = *(const double *)left, b = *(const double *)right;
  return (a > b) - (a < b);
}

static void judge(tally *all) {
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    double most = is_polynomial(clt_method_name(m)) ? POLYNOMIAL : OTHERS;
    if (all->compared[m] > 0) {
      print_message("%-14s foretold %.2f to %.2f of the real iterations (%d solves)\n", clt_method_name(m), all->low[m],
                    all->high[m], all->compared[m]);
      assert_true(all->high[m] <= most && all->low[m] >= 1 / most);
    }
  }
  qsort(all->time, (size_t)all->times, sizeof *all->time, compare_numbers);
  double middle = all->time[all->times / 2];
  print_message("half of %d solves: foretold over real time %.2f to %.2f, median %.2f\n", all->times,
                all->time[all->times / 4], all->time[3 * all->times / 4], middle);
  assert_true(middle > 1 / TIMES && middle < TIMES);
}

static void iterations_on_cubes(void **state) {
  (void)state;
  static const double albedos[] = {.2, .45, .7, .9, .99};
  tally *all = tally_open();
  for (size_t a = 0; a < sizeof albedos / sizeof albedos[0]; a++) {
    test_room room = room_cube(7, albedos[a], 0, 1 + a);
    compare_all(&room, 100 + a, all);
    room_free(&room);
  }
  judge(all);
  free(all);
}

static void iterations_on_the_rendered_dihedral(void **state) {
  (void)state;
  char path[1024];
  const char *folder = getenv("CLT_SHARED");
  snprintf(path, sizeof path, "%s/data/cycles-dihedral.h5", folder != NULL ? folder : CLT_SOURCE_ROOT "/../shared");
  if (access(path, R_OK) != 0) {
    skip();
  }
  clt_error error = {0};
  test_room room = {0};
  tally *all = tally_open();
  assert_ok(clt_transport_load(path, &room.transport, &error), error);
  clt_transport_info info = clt_transport_describe(room.transport);
  room.cells = info.cols;
  room.made = (recipe){.width = info.width, .height = info.height, .channels = info.channels};
  room_certify(&room);
  compare_all(&room, 7, all);
  judge(all);
  room_free(&room);
  free(all);
}

/* By the deadline as much as it allows, and what that leaves. */
static void a_deadline_cuts_what_is_foretold(void **state) {
  (void)state;
  test_room room = room_cube(6, .9, 0, 3);
  clt_error error = {0};
  clt_solve_options options = {.method = "damped", .tolerance = 1e-6};
  clt_forecast whole, part;
  assert_ok(clt_forecast_solve(room.transport, room.certificate, &options, &whole, &error), error);
  assert_true(whole.possible && whole.residual <= 1e-6);
  for (double share = .9; share > .1; share -= .2) {
    options.deadline_s = share * whole.seconds;
    assert_ok(clt_forecast_solve(room.transport, room.certificate, &options, &part, &error), error);
    assert_true(part.iterations < whole.iterations && part.seconds <= options.deadline_s * 1.001);
    assert_true(part.residual > 1e-6 && part.residual < 1);
    options.iteration_limit = part.iterations;
    options.deadline_s = 0;
    clt_forecast limited;
    assert_ok(clt_forecast_solve(room.transport, room.certificate, &options, &limited, &error), error);
    assert_near(limited.residual, part.residual, 1e-12);
    options.iteration_limit = 0;
  }
  room_free(&room);
}

/* More cannot take fewer iterations. */
static void a_finer_tolerance_takes_no_less(void **state) {
  (void)state;
  test_room room = room_cube(6, .6, .5, 4);
  clt_error error = {0};
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    int before = 0;
    for (double tolerance = .5; tolerance > 1e-7; tolerance /= 3) {
      clt_forecast found;
      clt_solve_options options = {.method = clt_method_name(m), .tolerance = tolerance};
      assert_ok(clt_forecast_solve(room.transport, room.certificate, &options, &found, &error), error);
      assert_true(!found.possible || (found.iterations >= before && found.seconds > 0 && isfinite(found.seconds)));
      before = found.possible ? found.iterations : 0;
    }
  }
  room_free(&room);
}

/* Refusals are told and no failures; nothing lit, one cell and other shapes have an answer. */
static void what_cannot_be_foretold_is_said(void **state) {
  (void)state;
  clt_error error = {0};
  clt_forecast found;
  test_room bright = room_cube(4, .8, 0, 5);
  clt_solve_options options = {.method = "jacobi"};
  assert_ok(clt_forecast_solve(bright.transport, bright.certificate, &options, &found, &error), error);
  assert_false(found.possible);
  assert_non_null(strstr(found.why_not, "diverges"));
  options = (clt_solve_options){.tolerance = -1};
  assert_int_equal(clt_forecast_solve(bright.transport, bright.certificate, &options, &found, &error), CLT_BAD_INPUT);
  options = (clt_solve_options){.method = "magic"};
  assert_int_equal(clt_forecast_solve(bright.transport, bright.certificate, &options, &found, &error), CLT_BAD_INPUT);
  room_free(&bright);
  static const float one[] = {2}, dark[4] = {0}, tall[] = {1, 2, 3, 4, 5, 7};
  test_room rooms[] = {room_of(1, 1, one), room_of(2, 2, dark), room_of(3, 2, tall)};
  for (size_t k = 0; k < 3; k++) {
    for (size_t m = 0; clt_method_name(m) != NULL; m++) {
      options = (clt_solve_options){.method = clt_method_name(m)};
      assert_ok(clt_forecast_solve(rooms[k].transport, rooms[k].certificate, &options, &found, &error), error);
      assert_true(isfinite(found.seconds) && isfinite(found.residual) && isfinite(found.prepare_seconds));
      assert_true(k < 2 ? !found.possible || found.iterations >= 0 : found.iterations == -1);
    }
    room_free(&rooms[k]);
  }
}

/* auto takes what is expected to be fastest, and says so in figures. */
static void auto_tells_what_it_expects(void **state) {
  (void)state;
  test_room room = room_cube(6, .3, 0, 6);
  clt_error error = {0};
  clt_solve_result result;
  room_ask(&room, 9, .2, .8);
  for (double tolerance = .3; tolerance > 1e-6; tolerance /= 10) {
    clt_forecast taken, other;
    char figures[64];
    clt_solve_options options = {.tolerance = tolerance};
    assert_ok(clt_solve(room.transport, room.certificate, room.b, &options, room.x, &result, &error), error);
    assert_ok(clt_forecast_solve(room.transport, room.certificate, &options, &taken, &error), error);
    snprintf(figures, sizeof figures, "%d iterations and ", taken.iterations);
    assert_non_null(strstr(result.reason, figures));
    for (size_t m = 0; clt_method_name(m) != NULL; m++) {
      options.method = clt_method_name(m);
      assert_ok(clt_forecast_solve(room.transport, room.certificate, &options, &other, &error), error);
      if (is_polynomial(options.method) && other.prepare_seconds == 0 && other.possible) {
        assert_true(taken.residual <= tolerance && taken.seconds <= 1.2 * other.seconds);
      }
    }
  }
  room_free(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(iterations_on_the_rendered_dihedral), cmocka_unit_test(a_deadline_cuts_what_is_foretold),
      cmocka_unit_test(a_finer_tolerance_takes_no_less),     cmocka_unit_test(what_cannot_be_foretold_is_said),
      cmocka_unit_test(auto_tells_what_it_expects),          cmocka_unit_test(iterations_on_cubes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
