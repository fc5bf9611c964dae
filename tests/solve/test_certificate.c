/* The certificate against eigenvalues, singular values and weights computed by LAPACK or known by construction. */
#include "rooms.h"

/* R = T F^-1 - I over lit cells in double, entries below 0 clipped where asked; n is the number of lit cells. */
static double *lit_matrix(const test_room *room, bool clipped, size_t *n) {
  const float *entries = clt_transport_entries(room->transport, 0);
  const unsigned char *lit = clt_certificate_lit(room->certificate, 0);
  double *r = room_numbers(room->cells * room->cells);
  size_t count = 0, at = 0;
  for (size_t i = 0; i < room->cells; i++) {
    count += lit[i];
  }
  for (size_t i = 0; i < room->cells; i++) {
    for (size_t j = 0; lit[i] && j < room->cells; j++) {
      if (lit[j]) {
        double entry = (double)entries[i * room->cells + j] / (double)entries[j * room->cells + j] - (i == j);
        r[at++] = clipped ? fmax(entry, 0) : entry;
      }
    }
  }
  *n = count;
  return r;
}

static double spectral_radius(const test_room *room, bool clipped) {
  size_t n;
  double *r = lit_matrix(room, clipped, &n), *real = room_numbers(n), *imaginary = room_numbers(n), radius = 0;
  assert_int_equal(
      LAPACKE_dgeev(LAPACK_ROW_MAJOR, 'N', 'N', (lapack_int)n, r, (lapack_int)n, real, imaginary, NULL, 1, NULL, 1), 0);
  for (size_t i = 0; i < n; i++) {
    radius = fmax(radius, hypot(real[i], imaginary[i]));
  }
  free(r);
  free(real);
  free(imaginary);
  return radius;
}

static double spectral_norm(const test_room *room) {
  size_t n;
  double *r = lit_matrix(room, false, &n), *values = room_numbers(n), *superb = room_numbers(n);
  assert_int_equal(LAPACKE_dgesvd(LAPACK_ROW_MAJOR, 'N', 'N', (lapack_int)n, (lapack_int)n, r, (lapack_int)n, values,
                                  NULL, 1, NULL, 1, superb),
                   0);
  double norm = values[0];
  free(r);
  free(values);
  free(superb);
  return norm;
}

/* `slack` is how far apart the bounds may lie, relative to rho(R). */
static void assert_bounds_hold(const test_room *room, double slack) {
  const clt_channel_certificate *channel = clt_certificate_channel(room->certificate, 0);
  double radius = spectral_radius(room, true), norm = spectral_norm(room);
  assert_true(channel->radius_low <= radius * (1 + 1e-9) + 1e-12);
  assert_true(channel->radius_high >= radius * (1 - 1e-9) - 1e-12);
  assert_true(channel->radius_high - channel->radius_low <= slack * radius + 1e-12);
  assert_true(channel->norm_high >= norm * (1 - 1e-9));
}

/* Case 4: light alternates between two plates, and A has the eigenvalues +-m. */
static test_room room_plates(double albedo, uint64_t seed) {
  return room_make((recipe){.width = 8,
                            .height = 6,
                            .channels = 1,
                            .seed = seed,
                            .albedo = {albedo},
                            .spread = .4,
                            .openness = .1,
                            .shape = SHAPE_PLATES});
}

static void bounds_hold_the_true_radius_and_norm(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    double albedo = 0.2 * (double)seed;
    test_room random = room_make((recipe){
        .width = 8, .height = 6, .channels = 1, .seed = seed, .albedo = {albedo}, .spread = .8, .openness = .3});
    test_room cube = room_cube(4, albedo, .5, seed);
    assert_bounds_hold(&random, .01);
    assert_bounds_hold(&cube, .01);
    test_room plates = room_plates(albedo, seed);
    assert_bounds_hold(&plates, .02);
    room_free(&plates);
    room_free(&random);
    room_free(&cube);
  }
}

/* A corner of two dark lone cells, a negative noise entry, a one-way ring: the bounds need no symmetry. */
static void bounds_hold_for_matrices_of_any_shape(void **state) {
  (void)state;
  enum { N = 24 };
  for (uint64_t seed = 1; seed <= 20; seed++) {
    uint64_t random = seed;
    float entries[N * N];
    for (int i = 0; i < N * N; i++) {
      double u = test_random(&random);
      bool sparse = test_random(&random) < .7;
      entries[i] = (float)(i % (N + 1) == 0 ? 1 + u : sparse ? 0 : u - .1);
    }
    for (int j = 1; j < N; j++) {
      entries[j] = 0; /* cell 0 receives no light */
    }
    test_room room = room_of(N, N, entries);
    assert_bounds_hold(&room, 1);
    assert_true(clt_certificate_channel(room.certificate, 0)->radius_low > 0);
    room_free(&room);
  }
}

/* Case 14: noise of both signs on every entry leaves rho(R) near what it was, and the bounds around it. */
static void noise_does_not_push_the_bounds_away(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    test_room room = room_cube(6, .4, .2, seed);
    float *entries = clt_transport_entries(room.transport, 0);
    double clean = spectral_radius(&room, true);
    uint64_t random = seed;
    for (size_t i = 0; i < room.cells * room.cells; i++) {
      entries[i] += (float)(.01 * (test_random(&random) - .5));
    }
    room_certify(&room);
    const clt_channel_certificate *channel = clt_certificate_channel(room.certificate, 0);
    double radius = spectral_radius(&room, false);
    assert_near(radius, clean, .1 * clean);
    assert_true(channel->radius_low <= radius && radius <= channel->radius_high);
    assert_true(channel->radius_low > .8 * radius);
    room_free(&room);
  }
}

/* Two rooms that see nothing of each other: the greater decides. */
static void disconnected_rooms_are_bounded_by_the_brighter(void **state) {
  (void)state;
  float entries[16] = {1, .2f, 0, 0, .2f, 1, 0, 0, 0, 0, 1, .8f, 0, 0, .8f, 1};
  test_room room = room_of(4, 4, entries);
  assert_bounds_hold(&room, 1);
  assert_near(clt_certificate_channel(room.certificate, 0)->radius_high, .8, 1e-6);
  assert_true(clt_certificate_channel(room.certificate, 0)->reciprocity < 1e-6);
  room_free(&room);
}

/* The thresholds of NUMERICS section 1: a closed room of one albedo has rho(A) = albedo, and S = (I - A)^-1 before its
 * diagonal is scaled to 1, so that rho(R) is just below albedo / (1 - albedo). */
static void jacobi_is_certified_below_one_half(void **state) {
  (void)state;
  test_room dim = room_cube(6, .45, 0, 1), bright = room_cube(6, .55, 0, 1);
  assert_true(clt_certificate_channel(dim.certificate, 0)->radius_high < 1);
  assert_true(clt_certificate_channel(bright.certificate, 0)->radius_low > 1);
  room_free(&dim);
  room_free(&bright);
}

static void flux_weights_are_recovered(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    test_room rooms[3] = {
        room_make((recipe){
            .width = 8, .height = 6, .channels = 1, .seed = seed, .albedo = {.9}, .spread = .7, .openness = .1}),
        room_cube(5, .3 + .15 * (double)seed, .6, seed), room_plates(.2 * (double)seed, seed)};
    for (int k = 0; k < 3; k++) {
      const double *w = clt_certificate_flux(rooms[k].certificate, 0);
      double mean = 0, known = 0;
      for (size_t i = 0; i < rooms[k].cells; i++) {
        mean += w[i] / (double)rooms[k].cells;
        known += rooms[k].flux[i] / (double)rooms[k].cells;
      }
      assert_near(mean, 1, 1e-12);
      for (size_t i = 0; i < rooms[k].cells; i++) {
        assert_near(w[i] / (rooms[k].flux[i] / known), 1, 1e-3);
      }
      assert_true(clt_certificate_channel(rooms[k].certificate, 0)->reciprocity < 1e-5);
      room_free(&rooms[k]);
    }
  }
}

/* The probes' estimate lies between the mean and the norm of the skew part, found in full. */
static void the_reciprocity_defect_is_measured(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 4; seed++) {
    test_room room = room_cube(4, .8, .5, seed);
    float *entries = clt_transport_entries(room.transport, 0);
    uint64_t random = seed;
    for (size_t i = 0; i < room.cells * room.cells; i++) {
      entries[i] *= (float)(i % (room.cells + 1) == 0 ? 1 : 1 + .6 * (test_random(&random) - .5));
    }
    room_certify(&room);
    size_t n;
    double *r = lit_matrix(&room, false, &n), difference = 0, size = 0;
    const double *w = clt_certificate_flux(room.certificate, 0);
    for (size_t i = 0; i < n; i++) {
      for (size_t j = 0; j < n; j++) {
        double entry = r[i * n + j] * w[j] + (i == j ? w[i] : 0), mirrored = r[j * n + i] * w[i] + (i == j ? w[i] : 0);
        difference += (entry - mirrored) * (entry - mirrored);
        size += w[i] * w[i] / (double)n;
      }
    }
    double mean = sqrt(difference / size); /* of ||K z|| / ||W z|| over signs z, to which S W z adds little */
    double told = clt_certificate_channel(room.certificate, 0)->reciprocity;
    assert_true(mean > .005);
    assert_true(told > mean / 3 && told < mean * 3);
    free(r);
    room_free(&room);
  }
}

static void a_flat_scene_is_certified(void **state) {
  (void)state;
  float entries[25] = {0};
  for (int i = 0; i < 5; i++) {
    entries[i * 6] = (float)(i + 1) / 7;
  }
  test_room room = room_of(5, 5, entries);
  const clt_channel_certificate *channel = clt_certificate_channel(room.certificate, 0);
  assert_near(channel->radius_high, 0, 1e-12);
  assert_near(channel->norm_high, 0, 1e-12);
  assert_near(channel->reciprocity, 0, 1e-12);
  assert_near(channel->white, 3.0 / 7, 1e-7);
  clt_error error;
  double white = 0;
  assert_ok(clt_certify_white(room.transport, &white, &error), error);
  assert_near(white, 3.0 / 7, 1e-7);
  for (int i = 0; i < 5; i++) {
    assert_near(clt_certificate_flux(room.certificate, 0)[i], 1, 1e-12);
    assert_near(clt_certificate_first_bounce(room.certificate, 0)[i], (i + 1) / 7.0, 1e-7);
  }
  room_free(&room);
}

/* Dark: F below 1e-3 of the bright cells' F, below 5 sigma of its row, or not above 0. */
static void dark_cells_are_found(void **state) {
  (void)state;
  enum { N = 10 };
  clt_error error = {0};
  float entries[N * N] = {0};
  for (int i = 0; i < N; i++) {
    entries[i * (N + 1)] = 1;
  }
  entries[0] = 0.9e-3f;
  entries[1 * (N + 1)] = 1.1e-3f;
  entries[2 * (N + 1)] = 0;
  entries[3 * (N + 1)] = -0.5f;
  entries[4 * (N + 1)] = 0.4f;
  test_room room = room_of(N, N, entries);
  const unsigned char by_share[N] = {0, 1, 0, 0, 1, 1, 1, 1, 1, 1};
  const unsigned char *lit = clt_certificate_lit(room.certificate, 0);
  for (int i = 0; i < N; i++) {
    assert_int_equal(lit[i], by_share[i]);
  }
  assert_int_equal(clt_certificate_channel(room.certificate, 0)->lit, 7);
  assert_int_equal(clt_certificate_channel(room.certificate, 0)->dark, 3);
  assert_ok(clt_transport_keep_sigma(room.transport, &error), error);
  for (int i = 0; i < N; i++) {
    clt_transport_sigma_values(room.transport, 0)[i] = i == 4 ? .081f : i == 5 ? .19f : 1e-6f;
  }
  room_certify(&room);
  lit = clt_certificate_lit(room.certificate, 0);
  assert_int_equal(lit[1], 1);
  assert_int_equal(lit[4], 0);
  assert_int_equal(lit[5], 1);
  room_free(&room);
}

/* A dense T and the same entries as a tree of single cells give the same certificate and the same solution. */
static void storage_does_not_matter(void **state) {
  (void)state;
  clt_error error = {0};
  test_room dense = room_cube(4, .7, .4, 9);
  size_t n = dense.cells;
  int64_t *start = calloc(n + 1, sizeof *start);
  int32_t *node = calloc(n * n, sizeof *node);
  for (size_t i = 0; i < n * n; i++) {
    node[i] = (int32_t)(i % n);
    start[i / n + 1] = (int64_t)i + 1;
  }
  test_room tree = {.made = dense.made, .cells = n};
  assert_ok(clt_transport_create_tree(dense.made.width, dense.made.height, 1, n, start, node,
                                      clt_transport_entries(dense.transport, 0), &tree.transport, &error),
            error);
  room_certify(&tree);
  const clt_channel_certificate *a = clt_certificate_channel(dense.certificate, 0);
  const clt_channel_certificate *b = clt_certificate_channel(tree.certificate, 0);
  assert_near(b->radius_low / a->radius_low, 1, 1e-6);
  assert_near(b->radius_high / a->radius_high, 1, 1e-6);
  assert_near(b->norm_high / a->norm_high, 1, 1e-6);
  assert_near(b->white, a->white, 1e-6);
  double white = 0;
  assert_ok(clt_certify_white(tree.transport, &white, &error), error);
  assert_near(white, b->white, 0);
  double *known = room_numbers(n), *wanted = room_numbers(n), *x = room_numbers(n), *y = room_numbers(n);
  room_wanted(&dense, 3, -.2, 1.2, known, wanted);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    clt_solve_options options = {.method = m == 0 ? "auto" : clt_method_name(m), .tolerance = 1e-7};
    clt_solve_result result;
    clt_status status = clt_solve(dense.transport, dense.certificate, wanted, &options, x, &result, &error);
    assert_int_equal(clt_solve(tree.transport, tree.certificate, wanted, &options, y, &result, &error), status);
    assert_true(status == CLT_OK ? room_distance(y, x, n) < 1e-4 : strstr(error.message, "rho(R)") != NULL);
  }
  free(start);
  free(node);
  free(known);
  free(wanted);
  free(x);
  free(y);
  room_free(&dense);
  room_free(&tree);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bounds_hold_the_true_radius_and_norm),
      cmocka_unit_test(bounds_hold_for_matrices_of_any_shape),
      cmocka_unit_test(noise_does_not_push_the_bounds_away),
      cmocka_unit_test(disconnected_rooms_are_bounded_by_the_brighter),
      cmocka_unit_test(jacobi_is_certified_below_one_half),
      cmocka_unit_test(flux_weights_are_recovered),
      cmocka_unit_test(the_reciprocity_defect_is_measured),
      cmocka_unit_test(a_flat_scene_is_certified),
      cmocka_unit_test(dark_cells_are_found),
      cmocka_unit_test(storage_does_not_matter),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
