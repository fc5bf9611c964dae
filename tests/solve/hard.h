/* The hard cases: each in single and in double precision, over several seeds. */
#ifndef CLT_TESTS_SOLVE_HARD_H
#define CLT_TESTS_SOLVE_HARD_H

#include "rooms.h"

enum { HARD_SEEDS = 5 };

/* A room whose transport is held in one of the two storages; its float entries, which both hold exactly, stay in
 * `room` for the test's own products. */
typedef struct hard {
  test_room room;
  uint64_t seed;
  clt_transport *transport;
  clt_certificate *certificate;
} hard;

/* Runs a case for every storage and seed. */
static inline void hard_each(void (*run)(const char *storage, uint64_t seed)) {
  const char *storages[] = {"dense", "dense64"};
  for (int s = 0; s < 2; s++) {
    for (uint64_t seed = 1; seed <= HARD_SEEDS; seed++) {
      run(storages[s], seed);
    }
  }
}

/* Takes the room over. */
static inline hard hard_hold(test_room room, const char *storage, uint64_t seed) {
  clt_error error = {0};
  hard held = {.room = room, .seed = seed};
  assert_ok(clt_transport_convert(room.transport, storage, &held.transport, &error), error);
  assert_ok(clt_certify(held.transport, &held.certificate, &error), error);
  return held;
}

static inline void hard_free(hard *held) {
  clt_certificate_destroy(held->certificate);
  clt_transport_destroy(held->transport);
  room_free(&held->room);
}

static inline clt_solve_result hard_solve(const hard *held, const clt_solve_options *options) {
  clt_error error = {0};
  clt_solve_result result;
  assert_ok(clt_solve(held->transport, held->certificate, held->room.b, options, held->room.x, &result, &error), error);
  return result;
}

static inline clt_solve_result hard_solve_by(const hard *held, const char *method, double tolerance) {
  return hard_solve(held, &(clt_solve_options){.method = method, .tolerance = tolerance});
}

static inline double hard_residual(const hard *held) {
  return room_residual(&held->room, held->room.x, held->room.b);
}

/* The method is refused, and the message holds the phrase. */
static inline void hard_refused(const hard *held, const char *method, const char *phrase) {
  clt_error error = {0};
  clt_solver *solver = NULL;
  clt_solve_options options = {.method = method};
  assert_int_equal(clt_solver_create(held->transport, held->certificate, &options, &solver, &error), CLT_BAD_INPUT);
  if (strstr(error.message, phrase) == NULL) {
    fail_msg("\"%s\" does not say \"%s\"", error.message, phrase);
  }
}

/* rho(R) of a non-negative R by power steps on R + I, in double, from the entries; every cell lit. */
static inline double hard_radius(const test_room *room) {
  size_t n = room->cells;
  const float *entries = clt_transport_entries(room->transport, 0);
  double *x = room_numbers(n), *y = room_numbers(n), radius = 0, before = -1;
  for (size_t i = 0; i < n; i++) {
    x[i] = 1;
  }
  for (int step = 0; step < 400 && fabs(radius - before) > 1e-12 * radius; step++) {
    double top = 0;
    before = radius;
    for (size_t j = 0; j < n; j++) {
      y[j] = x[j] / (double)entries[j * n + j];
    }
    room_product(room->transport, 0, y, x);
    for (size_t i = 0; i < n; i++) {
      top = fmax(top, x[i]);
    }
    radius = top - 1;
    for (size_t i = 0; i < n; i++) {
      x[i] /= top;
    }
  }
  free(x);
  free(y);
  return radius;
}

#endif
