/* Bounces of a closed cube whose form factors are known: against A by LAPACK, their sum, eq. 51, cancellation. */
#include "cube.h"

static void draw_drive(size_t n, uint64_t seed, double *x) {
  for (size_t i = 0; i < n; i++) {
    x[i] = test_random(&seed);
  }
}

/* The worst ||b_k - A^k F x|| / ||A^k F x||. */
static double worst_bounce(const clt_bounces *bounces, const double *a, const double *first, const double *x) {
  size_t n = bounces->cells;
  double *b = numbers(n), *next = numbers(n), worst = 0;
  for (size_t i = 0; i < n; i++) {
    b[i] = first[i] * x[i];
  }
  for (int k = 0; k <= bounces->count; k++) {
    worst = fmax(worst, distance(n, bounces->light + (size_t)k * n, b));
    multiply(n, a, b, next);
    memcpy(b, next, n * sizeof *b);
  }
  free(b);
  free(next);
  return worst;
}

/* ||sum of the terms - T x|| / ||T x||, T x from the entries. */
static double sum_error(const clt_bounces *bounces, const clt_transport *transport, const double *x) {
  size_t n = bounces->cells;
  const float *entries = clt_transport_entries(transport, 0);
  double *seen = numbers(n), *sum = numbers(n);
  for (size_t i = 0; i < n; i++) {
    sum[i] = bounces->rest[i];
    for (size_t j = 0; j < n; j++) {
      seen[i] += (double)entries[i * n + j] * x[j];
    }
    for (int k = 0; k <= bounces->count; k++) {
      sum[i] += bounces->light[(size_t)k * n + i];
    }
  }
  double error = distance(n, sum, seen);
  free(seen);
  free(sum);
  return error;
}

static void form_factors_close(void **state) {
  (void)state;
  for (int side = 1; side <= 4; side++) {
    cube made = cube_make(side, 0.5, 1);
    for (size_t i = 0; i < made.cells; i++) {
      double sum = 0;
      for (size_t j = 0; j < made.cells; j++) {
        assert_true(made.exchange[i * made.cells + j] >= 0);
        assert_near(made.exchange[i * made.cells + j], made.exchange[j * made.cells + i], 1e-14);
        sum += made.exchange[i * made.cells + j];
      }
      assert_near(sum, 0.5, 1e-12);
    }
    /* opposite and adjacent faces of a cube: .19982, .20004 (Howell) */
    if (side == 1) {
      assert_near(2 * made.exchange[1], 0.1998249, 1e-6);
      assert_near(2 * made.exchange[2], 0.2000438, 1e-6);
    }
    cube_free(&made);
  }
}

static void each_bounce_is_that_of_an_independent_inverse(void **state) {
  (void)state;
  static const double albedos[] = {0.5, 0.8, 0.95};
  for (int n = 0; n < 6; n++) {
    cube made = cube_make(4, albedos[n % 3], (uint64_t)n + 1);
    bool exact = n >= 3;
    clt_interreflection *op = analyse(made.transport, made.certificate, exact, 0);
    clt_bounces bounces;
    clt_error error = {0};
    double *x = numbers(made.cells), *first = numbers(made.cells);
    draw_drive(made.cells, (uint64_t)n + 10, x);
    double *a = exchange_of(made.transport, 0, exact, first);
    assert_ok(clt_bounces_of_drive(op, x, 8, &bounces, &error), error);
    assert_near(worst_bounce(&bounces, a, first, x), 0, 1e-7);
    if (exact) { /* and of the cube itself, whose T was rounded to float */
      assert_near(distance(made.cells, first, made.first), 0, 1e-6);
      assert_near(worst_bounce(&bounces, made.exchange, made.first, x), 0, 2e-5);
    }
    assert_near(sum_error(&bounces, made.transport, x), 0, 1e-6);
    assert_near(bounces.sum_error, sum_error(&bounces, made.transport, x), 1e-7);
    clt_bounces_finish(&bounces);
    clt_interreflection_destroy(op);
    cube_free(&made);
    free(a);
    free(x);
    free(first);
  }
}

/* T_ii = F_i (1 + (A^2)_ii + ...): what F = diag(T) does to the first bounce, and 1 / (T^-1)_ii does not. */
static void diagonal_of_t_biases_the_first_bounce(void **state) {
  (void)state;
  static const struct {
    int side;
    double least, most;
  } cases[] = {{4, 0.20, 0.28}, {8, 0.08, 0.16}};
  for (int n = 0; n < 2; n++) {
    cube made = cube_make(cases[n].side, 0.8, 3);
    double *x = numbers(made.cells), *b = numbers(made.cells), *wanted = numbers(made.cells);
    for (size_t i = 0; i < made.cells; i++) {
      b[i] = (int)i % (6 * made.side) < made.side; /* one face */
      x[i] = b[i] / made.first[i];
    }
    multiply(made.cells, made.exchange, b, wanted);
    for (int exact = 0; exact < 2; exact++) {
      clt_interreflection *op = analyse(made.transport, made.certificate, exact, 0);
      clt_bounces bounces;
      clt_error error = {0};
      assert_ok(clt_bounces_of_drive(op, x, 1, &bounces, &error), error);
      double bias = distance(made.cells, bounces.light + made.cells, wanted);
      print_message("N = %zu, %s: bounce 1 is %.4f %% off\n", made.cells, exact ? "exact F" : "F = diag(T)",
                    100 * bias);
      assert_true(exact ? bias < 1e-6 : bias > cases[n].least && bias < cases[n].most);
      clt_bounces_finish(&bounces);
      clt_interreflection_destroy(op);
    }
    cube_free(&made);
    free(x);
    free(b);
    free(wanted);
  }
}

/* With solves to 1e-3 only: what eq. 51 takes from partial sums drowns, what A takes from the last bounce does not. */
static void eq51_cancels_where_ours_does_not(void **state) {
  (void)state;
  for (int side = 4; side <= 8; side += 2) {
    cube made = cube_make(side, 0.5, (uint64_t)side);
    clt_interreflection *op = analyse(made.transport, made.certificate, true, 1e-3);
    clt_bounces bounces;
    clt_error error = {0};
    double *x = numbers(made.cells), *first = numbers(made.cells), cancelled[9];
    x[made.cells / 2 + 1] = 1;
    double *a = exchange_of(made.transport, 0, true, first);
    assert_ok(clt_bounces_of_drive(op, x, 8, &bounces, &error), error);
    assert_ok(clt_bounces_compare_sums(op, &bounces, cancelled, &error), error);
    double ours = worst_bounce(&bounces, a, first, x);
    print_message("N = %zu: eq. 51 is %.0f %% off at bounce 8, ours %.2f %% at most\n", made.cells, 100 * cancelled[8],
                  100 * ours);
    assert_true(cancelled[8] > 0.5);
    assert_true(ours < 4e-3);
    clt_bounces_finish(&bounces);
    clt_interreflection_destroy(op);
    cube_free(&made);
    free(a);
    free(x);
    free(first);
  }
}

static void a_picture_comes_apart_like_its_drive(void **state) {
  (void)state;
  cube made = cube_make(4, 0.8, 5);
  size_t n = made.cells;
  clt_interreflection *op = analyse(made.transport, made.certificate, true, 0);
  clt_bounces driven, seen;
  clt_error error = {0};
  double *x = numbers(n), *out = numbers(n), *wanted = numbers(n);
  draw_drive(n, 7, x);
  assert_ok(clt_bounces_of_drive(op, x, 5, &driven, &error), error);
  assert_ok(clt_bounces_of_picture(op, driven.picture, 5, &seen, &error), error);
  assert_near(distance(6 * n, seen.light, driven.light), 0, 1e-7);
  assert_near(distance(n, seen.rest, driven.rest), 0, 1e-7);
  /* Seitz's operators: A^k picture is what is left, C^k picture the k-th alone */
  memcpy(wanted, driven.picture, n * sizeof *wanted);
  for (int k = 1; k <= 4; k++) {
    const double *bounce = driven.light + (size_t)(k - 1) * n;
    for (size_t i = 0; i < n; i++) {
      wanted[i] -= bounce[i];
    }
    assert_ok(clt_bounces_cancel(op, driven.picture, k, out, &error), error);
    assert_near(distance(n, out, wanted), 0, 1e-6);
    assert_ok(clt_bounces_keep(op, driven.picture, k, out, &error), error);
    assert_near(distance(n, out, bounce), 0, 1e-6);
  }
  clt_bounces_finish(&driven);
  clt_bounces_finish(&seen);
  clt_interreflection_destroy(op);
  cube_free(&made);
  free(x);
  free(out);
  free(wanted);
}

/* Every third cell is not lit. With l the lit and d the dark cells, what dark ones return belongs to the bounce that
 * reaches them: A_l = A_ll + A_ld (I - A_dd)^-1 A_dl, and they show C b with C = (I - A_dd)^-1 A_dl. */
static void dark_cells_show_their_share(void **state) {
  (void)state;
  cube made = cube_make(3, 0.7, 2);
  size_t n = made.cells;
  float *entries = clt_transport_entries(made.transport, 0);
  double *matrix = numbers(n * n), *bounced = numbers(n * n), *x = numbers(n), *b = numbers(n), *next = numbers(n);
  lapack_int *pivots = calloc(n, sizeof *pivots);
  for (size_t i = 0; i < n; i++) {
    x[i] = i % 3 ? 1 : 0.5;
    for (size_t j = 0; j < n; j++) { /* (I - A over dark columns) out = A over lit columns */
      entries[i * n + j] *= j % 3 == 0 ? 0 : 1;
      matrix[i * n + j] = (i == j) - (j % 3 == 0 ? made.exchange[i * n + j] : 0);
      bounced[i * n + j] = j % 3 == 0 ? 0 : made.exchange[i * n + j];
    }
    b[i] = i % 3 ? made.first[i] * x[i] : 0;
  }
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, (int)n, (int)n, matrix, (int)n, pivots, bounced, (int)n), 0);
  clt_certificate_destroy(made.certificate);
  clt_error error = {0};
  assert_ok(clt_certify(made.transport, &made.certificate, &error), error);
  assert_int_equal(clt_certificate_channel(made.certificate, 0)->dark, n / 3);
  clt_interreflection *op = analyse(made.transport, made.certificate, true, 0);
  clt_bounces bounces;
  assert_ok(clt_bounces_of_drive(op, x, 3, &bounces, &error), error);
  const double *first = clt_interreflection_first_bounce(op, 0);
  for (size_t i = 0; i < n; i++) { /* A_ii of the path through dark cells is folded into F by 1 / (T^-1)_ii */
    double folded = 1 - bounced[i * n + i];
    b[i] = i % 3 ? first[i] * x[i] : 0;
    assert_near(first[i], i % 3 ? made.first[i] / folded : 0, 1e-5);
    for (size_t j = 0; j < n; j++) {
      matrix[i * n + j] = i == j && i % 3 ? 0 : bounced[i * n + j] / (i % 3 ? folded : 1);
    }
  }
  for (int k = 0; k <= 3; k++) {
    assert_near(distance(n, bounces.light + (size_t)k * n, b), 0, 1e-5);
    multiply(n, matrix, b, next);
    memcpy(b, next, n * sizeof *b);
  }
  x[0] = x[3] = 0; /* dark: their drive is not part of the picture */
  for (size_t i = 0; i < n; i++) {
    double sum = bounces.rest[i], seen = 0;
    for (int k = 0; k <= 3; k++) {
      sum += bounces.light[(size_t)k * n + i];
    }
    for (size_t j = 0; j < n; j++) {
      seen += (double)entries[i * n + j] * x[j];
    }
    assert_near(sum, seen, 1e-6);
  }
  clt_bounces_finish(&bounces);
  clt_interreflection_destroy(op);
  cube_free(&made);
  free(matrix);
  free(bounced);
  free(x);
  free(b);
  free(next);
  free(pivots);
}

/* T seen through a blur along the grid has A_ii != 0. */
static void case_23_subsurface_or_defocus(void **state) {
  (void)state;
  for (int n = 0; n < 3; n++) {
    int side = 16;
    size_t cells = (size_t)(side * side);
    double share = n == 0 ? 0 : 0.1 * n;
    clt_transport *transport = NULL;
    clt_certificate *certificate = NULL;
    clt_error error = {0};
    assert_ok(clt_transport_create_dense(side, side, 1, cells, &transport, &error), error);
    float *entries = clt_transport_entries(transport, 0);
    uint64_t seed = (uint64_t)n;
    for (size_t i = 0; i < cells; i++) { /* far light of 40 % beside what the neighbours get */
      for (size_t j = 0; j < cells; j++) {
        long dx = labs((long)(i % (size_t)side) - (long)(j % (size_t)side)),
             dy = labs((long)(i / (size_t)side) - (long)(j / (size_t)side));
        double far = 0.4 / (double)cells, noise = 1e-4 * test_random(&seed);
        entries[i * cells + j] = (float)(i == j ? 1 - share : dx + dy == 1 ? share / 4 + far + noise : far + noise);
      }
    }
    assert_ok(clt_certify(transport, &certificate, &error), error);
    clt_interreflection *op = analyse(transport, certificate, false, 0);
    clt_interreflection_info info = clt_interreflection_describe(op);
    /* the neighbours' share against the cell's own, less the smooth light that alternates away */
    assert_near(info.spread, share / (1 - share), 0.01);
    assert_int_equal(info.inexact, n > 0);
    assert_int_equal(strlen(info.why) > 0, n > 0);
    clt_interreflection_destroy(op);
    clt_certificate_destroy(certificate);
    clt_transport_destroy(transport);
  }
}

/* Channels of albedo .95, .05 and 0 in one transport: each has its own bounces. */
static void channels_do_not_mix(void **state) {
  (void)state;
  static const double albedos[] = {0.95, 0.05, 0};
  clt_transport *transport = NULL;
  clt_certificate *certificate = NULL;
  clt_error error = {0};
  cube rooms[3];
  size_t n = 54;
  assert_ok(clt_transport_create_dense(18, 3, 3, n, &transport, &error), error);
  for (int c = 0; c < 3; c++) {
    rooms[c] = cube_make(3, albedos[c], (uint64_t)c);
    memcpy(clt_transport_entries(transport, c), clt_transport_entries(rooms[c].transport, 0), n * n * sizeof(float));
  }
  assert_ok(clt_certify(transport, &certificate, &error), error);
  clt_interreflection *op = analyse(transport, certificate, true, 0);
  clt_bounces bounces;
  double *x = numbers(3 * n), *b = numbers(n), *next = numbers(n);
  draw_drive(3 * n, 4, x);
  assert_ok(clt_bounces_of_drive(op, x, 4, &bounces, &error), error);
  for (size_t c = 0; c < 3; c++) {
    for (size_t i = 0; i < n; i++) {
      b[i] = rooms[c].first[i] * x[c * n + i];
    }
    for (size_t k = 0; k <= 4; k++) {
      for (size_t i = 0; i < n; i++) {
        assert_near(bounces.light[(3 * k + c) * n + i], b[i], 2e-6);
      }
      multiply(n, rooms[c].exchange, b, next);
      memcpy(b, next, n * sizeof *b);
    }
    cube_free(&rooms[c]);
  }
  clt_bounces_finish(&bounces);
  clt_interreflection_destroy(op);
  clt_certificate_destroy(certificate);
  clt_transport_destroy(transport);
  free(x);
  free(b);
  free(next);
}

static void refusals_say_why(void **state) {
  (void)state;
  clt_transport *tall = NULL;
  clt_certificate *certificate = NULL;
  clt_interreflection *op = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_dense(2, 1, 1, 3, &tall, &error), error);
  for (int k = 0; k < 6; k++) {
    clt_transport_entries(tall, 0)[k] = (float)(k % 3 == 0);
  }
  assert_ok(clt_certify(tall, &certificate, &error), error);
  assert_int_equal(clt_interreflection_create(tall, certificate, NULL, &op, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "3 cells but drives 2"));
  clt_certificate_destroy(certificate);
  clt_transport_destroy(tall);

  cube made = cube_make(2, 0.5, 1);
  double x[24] = {1}, out[24];
  clt_bounces bounces;
  static const struct {
    clt_interreflection_options options;
    const char *wanted;
  } cases[] = {{{.tolerance = -1}, "tolerance -1"},
               {{.tolerance = NAN}, "tolerance"},
               {{.method = "bounded"}, "0..1"},
               {{.method = "none"}, "no method"}};
  for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
    assert_int_equal(clt_interreflection_create(made.transport, made.certificate, &cases[n].options, &op, &error),
                     CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, cases[n].wanted));
  }
  op = analyse(made.transport, made.certificate, false, 0);
  assert_int_equal(clt_bounces_of_drive(op, x, 65, &bounces, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_bounces_of_drive(op, x, -1, &bounces, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_bounces_keep(op, x, 0, out, &error), CLT_BAD_INPUT);
  x[3] = NAN;
  assert_int_equal(clt_bounces_of_drive(op, x, 2, &bounces, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_bounces_of_picture(op, x, 2, &bounces, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "value 3 of the picture"));
  assert_null(bounces.light);
  clt_interreflection_destroy(op);
  clt_interreflection_destroy(NULL);
  clt_bounces_finish(NULL);

  float *entries = clt_transport_entries(made.transport, 0); /* two equal columns and rows: T has no inverse */
  for (int k = 0; k < 24; k++) {
    entries[k * 24 + 1] = entries[k * 24];
  }
  memcpy(entries + 24, entries, 24 * sizeof *entries);
  clt_certificate_destroy(made.certificate);
  assert_ok(clt_certify(made.transport, &made.certificate, &error), error);
  clt_interreflection_options exact = {.exact_first_bounce = true};
  assert_int_equal(clt_interreflection_create(made.transport, made.certificate, &exact, &op, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "F = diag(T)"));
  cube_free(&made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(form_factors_close),
      cmocka_unit_test(each_bounce_is_that_of_an_independent_inverse),
      cmocka_unit_test(diagonal_of_t_biases_the_first_bounce),
      cmocka_unit_test(eq51_cancels_where_ours_does_not),
      cmocka_unit_test(a_picture_comes_apart_like_its_drive),
      cmocka_unit_test(dark_cells_show_their_share),
      cmocka_unit_test(case_23_subsurface_or_defocus),
      cmocka_unit_test(channels_do_not_mix),
      cmocka_unit_test(refusals_say_why),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
