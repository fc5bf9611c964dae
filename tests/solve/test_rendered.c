/* The solve room on a transport that an independent path tracer rendered (cycles-dihedral.json says how). */
#include "rooms.h"

/* From cycles-dihedral.json: the eigenvalues of its R by numpy. */
static const double KNOWN_RADIUS = 0.3092274466018601, KNOWN_NORM = 0.31253440837662155;

static bool load(test_room *room) {
  char path[1024];
  const char *folder = getenv("CLT_SHARED");
  snprintf(path, sizeof path, "%s/data/cycles-dihedral.h5", folder != NULL ? folder : CLT_SOURCE_ROOT "/../shared");
  if (access(path, R_OK) != 0) {
    return false;
  }
  clt_error error = {0};
  *room = (test_room){0};
  assert_ok(clt_transport_load(path, &room->transport, &error), error);
  clt_transport_info info = clt_transport_describe(room->transport);
  room->cells = info.cols;
  room->made = (recipe){.width = info.width, .height = info.height, .channels = info.channels};
  room_certify(room);
  return true;
}

static void its_spectrum_is_certified(void **state) {
  (void)state;
  test_room room;
  if (!load(&room)) {
    skip();
  }
  const clt_channel_certificate *channel = clt_certificate_channel(room.certificate, 0);
  assert_int_equal(channel->lit, 768);
  assert_true(channel->radius_low <= KNOWN_RADIUS && KNOWN_RADIUS <= channel->radius_high);
  assert_true(channel->radius_high - channel->radius_low < .05);
  assert_true(channel->norm_high >= KNOWN_NORM);
  room_free(&room);
}

static void every_method_solves_it(void **state) {
  (void)state;
  test_room room;
  if (!load(&room)) {
    skip();
  }
  room_ask(&room, 4, .05, .95);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    clt_error error = {0};
    clt_solve_result result;
    clt_solve_options options = {.method = clt_method_name(m), .tolerance = 1e-7};
    assert_ok(clt_solve(room.transport, room.certificate, room.b, &options, room.x, &result, &error), error);
    assert_true(result.converged && result.iterations < 40);
    assert_string_equal(result.method, options.method);
    assert_true(room_distance(room.x, room.known, room.cells) < 1e-5);
  }
  room_free(&room);
}

/* A soft picture with dark parts, as photographs have: far better than uncompensated, and at the bounded optimum. */
static void a_picture_is_compensated(void **state) {
  (void)state;
  test_room room;
  if (!load(&room)) {
    skip();
  }
  clt_error error = {0};
  clt_image picture, drive;
  clt_compensation result;
  assert_ok(clt_image_init(&picture, 1, room.made.height, room.made.width, &error), error);
  for (size_t i = 0; i < room.cells; i++) {
    double x = (double)(i % 32) / 31, y = (double)(i / 32) / 23;
    picture.data[i] = (float)(.04 + .8 * pow(sin(7 * x) * cos(4 * y), 2));
  }
  assert_ok(clt_compensate(room.transport, room.certificate, &picture, NULL, NULL, true, &drive, &result, &error),
            error);
  print_message("rendered dihedral: before %.4f after %.5f limit %.5f, %.3f clipped; %s\n", result.error_before,
                result.error_after, result.error_limit, result.clipped_fraction, result.solve.reason);
  assert_true(result.error_after <= fmax(1.02 * result.error_limit, 1e-4));
  assert_true(result.error_before > 5 * result.error_after);
  clt_image_finish(&picture);
  clt_image_finish(&drive);
  room_free(&room);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(its_spectrum_is_certified),
      cmocka_unit_test(every_method_solves_it),
      cmocka_unit_test(a_picture_is_compensated),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
