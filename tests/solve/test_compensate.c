/* Targets, white, predictions and errors, against sums written out here. */
#include "rooms.h"

static clt_image picture_of(const test_room *room, const double *values) {
  clt_error error = {0};
  clt_image picture;
  assert_ok(clt_image_init(&picture, room->made.channels, room->made.height, room->made.width, &error), error);
  for (size_t i = 0; i < clt_image_size(&picture); i++) {
    picture.data[i] = (float)values[i];
  }
  return picture;
}

/* A random picture between low and high. */
static clt_image random_picture(const test_room *room, uint64_t seed, double low, double high) {
  size_t values = room->cells * (size_t)room->made.channels;
  double *numbers = room_numbers(values);
  for (size_t i = 0; i < values; i++) {
    numbers[i] = low + (high - low) * test_random(&seed);
  }
  clt_image picture = picture_of(room, numbers);
  free(numbers);
  return picture;
}

static test_room colour_room(double albedo, uint64_t seed) {
  return room_make((recipe){.width = 18,
                            .height = 3,
                            .channels = 3,
                            .seed = seed,
                            .albedo = {albedo, .8 * albedo, .5 * albedo},
                            .spread = .3,
                            .shape = SHAPE_CUBE});
}

/* ||gain (b0 + T x) - target|| / ||target|| over lit cells, with the best gain where asked. */
static double error_of(const test_room *room, const float *drive, const double *target, bool best_gain) {
  size_t n = room->cells;
  double *x = room_numbers(n), *y = room_numbers(n), yy = 0, yt = 0, tt = 0;
  for (int c = 0; c < room->made.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(room->certificate, c);
    for (size_t j = 0; j < n; j++) {
      x[j] = drive[(size_t)c * n + j];
    }
    room_product(room->transport, c, x, y);
    for (size_t i = 0; i < n; i++) {
      double t = target[(size_t)c * n + i], seen = y[i] + (double)clt_transport_black(room->transport, c)[i];
      yy += lit[i] ? seen * seen : 0;
      yt += lit[i] ? seen * t : 0;
      tt += lit[i] ? t * t : 0;
    }
  }
  free(x);
  free(y);
  double gain = best_gain ? yt / yy : 1;
  return sqrt(fmax(gain * gain * yy - 2 * gain * yt + tt, 0) / tt);
}

static int compare(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double median_of_diagonal(const test_room *room, int c) {
  double *f = room_numbers(room->cells);
  for (size_t i = 0; i < room->cells; i++) {
    f[i] = clt_transport_entries(room->transport, c)[i * (room->cells + 1)];
  }
  qsort(f, room->cells, sizeof *f, compare);
  size_t half = room->cells / 2;
  double median = room->cells % 2 ? f[half] : (f[half - 1] + f[half]) / 2;
  free(f);
  return median;
}

static void white_is_parsed(void **state) {
  (void)state;
  clt_white white;
  clt_error error = {0};
  assert_ok(clt_white_parse("auto", &white, &error), error);
  assert_int_equal(white.kind, CLT_WHITE_AUTO);
  assert_ok(clt_white_parse("feasible", &white, &error), error);
  assert_int_equal(white.kind, CLT_WHITE_FEASIBLE);
  assert_ok(clt_white_parse("0.25", &white, &error), error);
  assert_int_equal(white.kind, CLT_WHITE_VALUE);
  assert_near(white.value, .25, 1e-15);
  const char *wrong[] = {"", "-1", "0", "nan", "inf", "1x", "brightest"};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
    assert_int_equal(clt_white_parse(wrong[i], &white, &error), CLT_BAD_INPUT);
  }
}

static void a_compensation_reports_what_numpy_would(void **state) {
  (void)state;
  test_room room = colour_room(.8, 3);
  size_t n = room.cells;
  for (int c = 0; c < 3; c++) {
    for (size_t i = 0; i < n; i++) {
      clt_transport_black(room.transport, c)[i] = .002f * (float)(i % 5);
    }
  }
  clt_image picture = random_picture(&room, 5, 0, 1.3), drive;
  clt_error error = {0};
  clt_compensation result;
  assert_ok(clt_compensate(room.transport, room.certificate, &picture, NULL, NULL, true, &drive, &result, &error),
            error);
  double *target = room_numbers(3 * n);
  float *before = calloc(3 * n, sizeof *before);
  size_t clipped = 0;
  for (size_t i = 0; i < 3 * n; i++) {
    assert_near(result.white[i / n], median_of_diagonal(&room, (int)(i / n)), 1e-12);
    target[i] = (double)(float)(result.white[i / n] * (double)picture.data[i]);
    before[i] = fminf(picture.data[i], 1);
    assert_true(drive.data[i] >= 0 && drive.data[i] <= 1);
    clipped += drive.data[i] <= 0 || drive.data[i] >= 1;
  }
  assert_near(result.error_before, error_of(&room, before, target, true), 1e-6);
  assert_near(result.error_after, error_of(&room, drive.data, target, false), 1e-6);
  assert_near(result.clipped_fraction, (double)clipped / (double)(3 * n), 1e-12);
  assert_true(clipped > 0 && result.error_limit > 0);
  assert_true(result.error_limit <= result.error_after && result.error_after <= 1.02 * result.error_limit);
  assert_true(result.error_before > 2 * result.error_after);
  print_message("colour cube: before %.4f after %.4f limit %.6f; %s\n", result.error_before, result.error_after,
                result.error_limit, result.solve.reason);
  free(target);
  free(before);
  clt_image_finish(&picture);
  clt_image_finish(&drive);
  room_free(&room);
}

/* The limit is a property of the target, not of the method. */
static void the_limit_does_not_depend_on_the_method(void **state) {
  (void)state;
  test_room room = colour_room(.85, 4);
  clt_image picture = random_picture(&room, 6, 0, 1.2), drive;
  clt_error error = {0};
  clt_compensation result;
  double limit = -1;
  const char *methods[] = {"pcg", "gmres", "bounded", "auto"};
  for (int m = 0; m < 4; m++) {
    clt_solve_options options = {.method = methods[m], .tolerance = m == 2 ? 1e-6 : 1e-4};
    assert_ok(clt_compensate(room.transport, room.certificate, &picture, NULL, &options, true, &drive, &result, &error),
              error);
    limit = m == 0 ? result.error_limit : limit;
    assert_near(result.error_limit / limit, 1, 1e-4);
    assert_true(result.error_after >= result.error_limit);
    clt_image_finish(&drive);
  }
  assert_ok(clt_compensate(room.transport, room.certificate, &picture, NULL, NULL, false, &drive, &result, &error),
            error);
  assert_true(result.error_limit < 0);
  clt_image_finish(&drive);
  clt_image_finish(&picture);
  room_free(&room);
}

/* A target built from a drive inside 0..1 is met, and the drive found again. */
static void a_reachable_picture_is_met(void **state) {
  (void)state;
  test_room room = colour_room(.7, 7);
  size_t n = room.cells;
  double *known = room_numbers(3 * n), *wanted = room_numbers(3 * n);
  room_wanted(&room, 8, .1, .9, known, wanted);
  for (int c = 0; c < 3; c++) {
    for (size_t i = 0; i < n; i++) {
      clt_transport_black(room.transport, c)[i] = .01f;
      wanted[(size_t)c * n + i] = (wanted[(size_t)c * n + i] + (double).01f) / .5;
    }
  }
  clt_image picture = picture_of(&room, wanted), drive;
  clt_white white = {.kind = CLT_WHITE_VALUE, .value = .5};
  clt_solve_options options = {.tolerance = 1e-7};
  clt_error error = {0};
  clt_compensation result;
  assert_ok(clt_compensate(room.transport, room.certificate, &picture, &white, &options, true, &drive, &result, &error),
            error);
  assert_true(result.error_after < 1e-6 && result.error_limit < 1e-6 && result.clipped_fraction == 0);
  for (size_t i = 0; i < 3 * n; i++) {
    assert_near(drive.data[i], known[i], 2e-6);
    assert_near(result.white[i / n], .5, 1e-15);
  }
  free(known);
  free(wanted);
  clt_image_finish(&picture);
  clt_image_finish(&drive);
  room_free(&room);
}

/* x = s u - v by LU in double; s is the largest that keeps every x in 0..1. */
static void the_feasible_white_is_the_largest(void **state) {
  (void)state;
  test_room room = colour_room(.6, 9);
  size_t n = room.cells;
  double *u = room_numbers(3 * n), *v = room_numbers(3 * n), *b = room_numbers(n), *known = room_numbers(3 * n),
         *values = room_numbers(3 * n);
  room_wanted(&room, 8, .2, .9, known, values);
  clt_image picture = picture_of(&room, values), drive;
  for (int c = 0; c < 3; c++) {
    double white = median_of_diagonal(&room, c);
    for (size_t i = 0; i < n; i++) {
      picture.data[(size_t)c * n + i] = (float)(values[(size_t)c * n + i] / white);
      clt_transport_black(room.transport, c)[i] = .003f * (float)(1 + i % 3);
      b[i] = (double)picture.data[(size_t)c * n + i] * white;
    }
    room_direct(&room, c, b, u + (size_t)c * n);
    for (size_t i = 0; i < n; i++) {
      b[i] = clt_transport_black(room.transport, c)[i];
    }
    room_direct(&room, c, b, v + (size_t)c * n);
  }
  double low = 0, high = INFINITY;
  for (size_t i = 0; i < 3 * n; i++) {
    assert_true(u[i] > 0);
    low = fmax(low, v[i] / u[i]);
    high = fmin(high, (1 + v[i]) / u[i]);
  }
  assert_true(low < high && high < 5);
  clt_white white = {.kind = CLT_WHITE_FEASIBLE};
  clt_error error = {0};
  clt_compensation result;
  clt_solve_options options = {.tolerance = 1e-8};
  assert_ok(clt_compensate(room.transport, room.certificate, &picture, &white, &options, true, &drive, &result, &error),
            error);
  for (int c = 0; c < 3; c++) {
    assert_near(result.white[c] / median_of_diagonal(&room, c) / high, 1, 1e-5);
  }
  float brightest = 0;
  for (size_t i = 0; i < 3 * n; i++) {
    brightest = fmaxf(brightest, drive.data[i]);
  }
  assert_near(brightest, 1, 1e-5);
  assert_true(result.error_after < 1e-5);
  clt_image_finish(&drive);

  /* a black cell in a bright room is out of reach at any brightness */
  picture.data[7] = 0;
  assert_int_equal(
      clt_compensate(room.transport, room.certificate, &picture, &white, &options, false, &drive, &result, &error),
      CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "use white auto"));
  assert_null(drive.data);
  clt_image_finish(&picture);
  free(u);
  free(v);
  free(b);
  free(known);
  free(values);
  room_free(&room);
}

static void errors_are_what_the_hand_computes(void **state) {
  (void)state;
  float entries[9] = {1, 0, 0, 0, 1, 0, 0, 0, 0}; /* the third cell is dark */
  test_room room = room_of(3, 3, entries);
  double seen_values[3] = {1, 2, 50}, target_values[3] = {2, 1, 7}, none[3] = {0, 0, 0};
  clt_image seen = picture_of(&room, seen_values), target = picture_of(&room, target_values),
            black = picture_of(&room, none);
  /* (1 - 2)^2 + (2 - 1)^2 over 4 + 1; gain 4 / 5: (0.8 - 2)^2 + (1.6 - 1)^2 */
  assert_near(clt_appearance_error(room.certificate, &seen, &target, false), sqrt(2.0 / 5), 1e-12);
  assert_near(clt_appearance_error(room.certificate, &seen, &target, true), sqrt((1.44 + .36) / 5), 1e-12);
  assert_near(clt_best_gain(room.certificate, &seen, &target), .8, 1e-12);
  assert_near(clt_best_gain(room.certificate, &black, &target), 1, 0);
  assert_near(clt_appearance_error(room.certificate, &target, &target, false), 0, 1e-12);
  assert_near(clt_appearance_error(room.certificate, &black, &target, true), 1, 1e-12);
  /* a black target: relative to white, which is 1 on two cells */
  assert_near(clt_appearance_error(room.certificate, &seen, &black, false), sqrt(5.0 / 2), 1e-12);
  assert_near(clt_appearance_error(room.certificate, &black, &black, false), 0, 1e-12);
  clt_image_finish(&seen);
  clt_image_finish(&target);
  clt_image_finish(&black);
  room_free(&room);
}

static void a_prediction_is_black_plus_light(void **state) {
  (void)state;
  test_room room = colour_room(.5, 2);
  size_t n = room.cells;
  clt_image drive = random_picture(&room, 3, 0, 1), seen;
  clt_error error = {0};
  double *x = room_numbers(n), *y = room_numbers(n);
  for (int c = 0; c < 3; c++) {
    clt_transport_black(room.transport, c)[4] = .25f;
  }
  assert_ok(clt_predict(room.transport, &drive, &seen, &error), error);
  for (int c = 0; c < 3; c++) {
    for (size_t j = 0; j < n; j++) {
      x[j] = drive.data[(size_t)c * n + j];
    }
    room_product(room.transport, c, x, y);
    for (size_t i = 0; i < n; i++) {
      assert_near(seen.data[(size_t)c * n + i], y[i] + (i == 4 ? .25 : 0), 1e-6 * y[i] + 1e-7);
    }
  }
  free(x);
  free(y);
  clt_image_finish(&drive);
  clt_image_finish(&seen);
  room_free(&room);
}

static void a_black_picture_and_a_black_scene_are_served(void **state) {
  (void)state;
  test_room room = room_closed(4, 3, .5, 2);
  clt_image picture = random_picture(&room, 1, 0, 0), grey = random_picture(&room, 1, .5, .5), drive;
  clt_error error = {0};
  clt_compensation result;
  assert_ok(clt_compensate(room.transport, room.certificate, &picture, NULL, NULL, true, &drive, &result, &error),
            error);
  assert_true(result.error_after == 0 && result.error_limit == 0 && result.error_before == 0);
  clt_image_finish(&drive);
  memset(clt_transport_entries(room.transport, 0), 0, room.cells * room.cells * sizeof(float));
  room_certify(&room);
  assert_ok(clt_compensate(room.transport, room.certificate, &grey, NULL, NULL, true, &drive, &result, &error), error);
  for (size_t i = 0; i < room.cells; i++) {
    assert_true(drive.data[i] == 0);
  }
  assert_true(result.error_after == 0 && result.clipped_fraction == 0);
  clt_image_finish(&drive);
  clt_image_finish(&picture);
  clt_image_finish(&grey);
  room_free(&room);
}

static void wrong_pictures_are_refused(void **state) {
  (void)state;
  test_room room = colour_room(.5, 2);
  clt_image picture = random_picture(&room, 3, 0, 1), other, drive;
  clt_error error = {0};
  clt_compensation result;
  assert_ok(clt_image_init(&other, 3, 3, 17, &error), error);
  assert_int_equal(clt_compensate(room.transport, room.certificate, &other, NULL, NULL, false, &drive, &result, &error),
                   CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "the picture is 17 x 3 with 3 channels"));
  clt_image_finish(&other);
  const float wrong[] = {NAN, INFINITY, -.1f};
  for (int k = 0; k < 3; k++) {
    picture.data[11] = wrong[k];
    assert_int_equal(
        clt_compensate(room.transport, room.certificate, &picture, NULL, NULL, false, &drive, &result, &error),
        CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "sample 11 of the picture"));
  }
  picture.data[11] = .5f;
  clt_white white = {.kind = CLT_WHITE_VALUE, .value = -1};
  assert_int_equal(
      clt_compensate(room.transport, room.certificate, &picture, &white, NULL, false, &drive, &result, &error),
      CLT_BAD_INPUT);
  clt_image_finish(&picture);
  room_free(&room);

  float entries[12] = {1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1};
  test_room tall = room_of(4, 3, entries);
  clt_image three = random_picture(&tall, 3, 0, 1);
  assert_int_equal(clt_compensate(tall.transport, tall.certificate, &three, NULL, NULL, false, &drive, &result, &error),
                   CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "observes 4 cells but drives 3"));
  clt_image_finish(&three);
  room_free(&tall);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(white_is_parsed),
      cmocka_unit_test(a_compensation_reports_what_numpy_would),
      cmocka_unit_test(the_limit_does_not_depend_on_the_method),
      cmocka_unit_test(a_reachable_picture_is_met),
      cmocka_unit_test(the_feasible_white_is_the_largest),
      cmocka_unit_test(errors_are_what_the_hand_computes),
      cmocka_unit_test(a_prediction_is_black_plus_light),
      cmocka_unit_test(a_black_picture_and_a_black_scene_are_served),
      cmocka_unit_test(wrong_pictures_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
