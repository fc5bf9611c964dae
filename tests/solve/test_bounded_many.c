/* The bounded solve on a thousand random problems, and how many products it takes. */
#include "boxes.h"

/* A room of 4 to 200 cells; small ones more often. */
static test_room random_room(uint64_t seed, uint64_t *random) {
  double albedo = .1 + .89 * test_random(random), u = test_random(random), openness = .3 * test_random(random);
  if (seed % 5 == 0) {
    return room_cube(seed % 50 == 0 ? 5 : 2 + (int)(seed % 2), albedo, .5, seed);
  }
  int height = 2 + (int)(seed % 4);
  return room_make((recipe){.width = 2 + (int)(38 * u * u * u * u),
                            .height = height,
                            .channels = 1,
                            .seed = seed,
                            .albedo = {albedo},
                            .spread = seed % 3 == 0 ? 0 : .6,
                            .openness = seed % 2 == 0 ? 0 : openness});
}

/* What is asked: what some drive in and out of reach shows, squares, noise that nothing shows, a lit half of a black
 * picture. */
static void random_target(const test_room *room, uint64_t seed, uint64_t *random) {
  size_t width = (size_t)room->made.width;
  const double *first = clt_certificate_first_bounce(room->certificate, 0);
  double bright = .3 + 2 * test_random(random);
  for (size_t i = 0; seed % 4 != 0 && i < room->cells; i++) {
    double noise = test_random(random);
    bool square = (i / width + i % width) % 2 == 0, half = i % width < width / 2;
    room->b[i] = bright * first[i] * (seed % 4 == 1 ? square : seed % 4 == 2 ? noise : half);
  }
}

/* The same transport in double precision, with its certificate. */
static void hold_in_double(test_room *room, clt_transport **transport, clt_certificate **certificate) {
  clt_error error = {0};
  assert_ok(clt_transport_convert(room->transport, "dense64", transport, &error), error);
  assert_ok(clt_certify(*transport, certificate, &error), error);
}

/* Solves in single or double precision; everything about the answer is recomputed from the float entries, which both
 * hold exactly. Returns the products. */
static long solve_random_problem(uint64_t seed, double *worst, int *compared) {
  uint64_t random = seed * 77;
  test_room room = random_room(seed, &random);
  clt_transport *transport = NULL;
  clt_certificate *certificate = NULL;
  clt_error error = {0};
  clt_solve_result result;
  room_ask(&room, seed, -test_random(&random), 1 + test_random(&random));
  random_target(&room, seed, &random);
  problem p = problem_of(&room, room.b);
  if (seed % 2 == 0) {
    hold_in_double(&room, &transport, &certificate);
  }
  clt_solve_options options = {.method = "bounded", .tolerance = 1e-6};
  assert_ok(clt_solve(transport != NULL ? transport : room.transport,
                      certificate != NULL ? certificate : room.certificate, room.b, &options, room.x, &result, &error),
            error);
  assert_true(result.converged);
  assert_in_box(room.x, room.cells);
  memset(room.known, 0, room.cells * sizeof(double));
  double nothing = 1e-10 * objective(&p, room.known); /* what a tolerance of 1e-6 leaves of a reachable target */
  double reached = objective(&p, room.x), kkt = optimality(&p, room.x);
  if (!(kkt <= 1e-6 * (1 + 1e-6))) {
    fail_msg("seed %d: optimality %.3g after %d iterations", (int)seed, kkt, result.iterations);
  }
  *worst = fmax(*worst, kkt);
  assert_true(reached <= clamped_objective(&p, room.b, room.x) * (1 + 1e-9) + nothing);
  if (seed % 25 == 0) {
    assert_near(reached / reference_optimum(&p, room.x), 1, 1e-6);
    (*compared)++;
  }
  clt_certificate_destroy(certificate);
  clt_transport_destroy(transport);
  problem_free(&p);
  room_free(&room);
  return result.products;
}

static void a_thousand_problems_reach_the_optimum(void **state) {
  (void)state;
  double worst = 0, products = 0;
  long most = 0;
  int compared = 0;
  for (uint64_t seed = 1; seed <= 1000; seed++) {
    long took = solve_random_problem(seed, &worst, &compared);
    products += (double)took / 1000;
    most = took > most ? took : most;
  }
  print_message("1000 problems: KKT residual at most %.2g; %.1f products on average, at most %ld; %d compared with "
                "coordinate descent\n",
                worst, products, most, compared);
}

/* Products of T for a picture at albedo .9, to the default tolerance and to 1e-6: noise in and out of reach, then
 * squares, a lit half, waves. */
static void count_products(const test_room *room, double tolerance, long most[5]) {
  clt_error error = {0};
  clt_solve_result result;
  const double *first = clt_certificate_first_bounce(room->certificate, 0);
  size_t width = (size_t)room->made.width;
  double *b = room_numbers(room->cells), *x = room_numbers(room->cells);
  for (int kind = 0; kind < 5; kind++) {
    if (kind < 2) {
      room_wanted(room, 5 + (uint64_t)kind, kind == 0 ? -.1 : -.5, kind == 0 ? 1.1 : 1.5, x, b);
    }
    for (size_t i = 0; kind >= 2 && i < room->cells; i++) {
      bool square = (i / width + i % width) % 2 == 0, half = i % width < width / 2;
      b[i] = first[i] * (kind == 2 ? square : kind == 3 ? half : .5 + .5 * sin(.4 * (double)(i % width)));
    }
    clt_solve_options options = {.method = "bounded", .tolerance = tolerance};
    assert_ok(clt_solve(room->transport, room->certificate, b, &options, x, &result, &error), error);
    assert_true(result.converged);
    most[kind] = result.products > most[kind] ? result.products : most[kind];
  }
  free(b);
  free(x);
}

/* Fewer than 20 from cold, to 1e-6, and fewer than 15 to the default tolerance. */
static void few_products_suffice_at_albedo_nine_tenths(void **state) {
  (void)state;
  const double tolerances[] = {1e-4, 1e-6};
  for (int t = 0; t < 2; t++) {
    long even[5] = {0}, spread[5] = {0};
    for (uint64_t seed = 1; seed <= 10; seed++) {
      test_room cube = room_cube(6, .9, 0, seed), uneven = room_cube(6, .9, .5, seed);
      count_products(&cube, tolerances[t], even);
      count_products(&uneven, tolerances[t], spread);
      room_free(&cube);
      room_free(&uneven);
    }
    for (int kind = 0; kind < 5; kind++) {
      print_message("to %.0e, kind %d: at most %ld products at an even albedo, %ld where it varies\n", tolerances[t],
                    kind, even[kind], spread[kind]);
      assert_true(spread[kind] < (t == 0 ? 15 : 20));
      assert_true(even[kind] < (t == 0 ? 15 : 20));
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_thousand_problems_reach_the_optimum),
      cmocka_unit_test(few_products_suffice_at_albedo_nine_tenths),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
