/* Rooms with a known answer, for the tests of the solve room. */
#ifndef CLT_TESTS_ROOMS_H
#define CLT_TESTS_ROOMS_H

#include <lapacke.h>

#include "counterlight/solve.h"
#include "support.h"

/* What to make. A closed room's form factors sum to 1 in every row. Light goes from every cell to every other at
 * random; between the faces of a cube (width = 6 height); or at random between two plates, the halves of the cells,
 * only. */
typedef struct recipe {
  int width, height, channels;
  uint64_t seed;
  double albedo[CLT_CHANNELS_MAX]; /* of every cell, if spread is 0 */
  double spread;                   /* cells' albedos vary by this factor below albedo */
  double openness;                 /* share of the light that leaves the room */
  enum { SHAPE_RANDOM, SHAPE_CUBE, SHAPE_PLATES } shape;
} recipe;

/* T as float32 entries, as the transport holds them, and what made them. Arrays are channel after channel. */
typedef struct test_room {
  recipe made;
  size_t cells;
  clt_transport *transport;
  clt_certificate *certificate;
  double *flux;          /* S_ii m_i / a_i before scaling: the weights that symmetrise S */
  double *known, *b, *x; /* a drive, b = T known, and room for an answer, once room_ask has been called */
} test_room;

static inline double *room_numbers(size_t count) {
  double *numbers = calloc(count, sizeof *numbers);
  assert_non_null(numbers);
  return numbers;
}

/* Centre and inward normal of patch i of a unit cube, six faces of side x side patches side by side. */
static inline void room_cube_patch(size_t side, size_t i, double centre[3], double normal[3]) {
  size_t row = i / (6 * side), column = i % (6 * side), face = column / side, axis = face / 2;
  double far = (double)(face % 2);
  for (size_t k = 0; k < 3; k++) {
    centre[k] = normal[k] = 0;
  }
  centre[axis] = far;
  normal[axis] = 1 - 2 * far;
  centre[(axis + 1) % 3] = ((double)(column % side) + 0.5) / (double)side;
  centre[(axis + 2) % 3] = ((double)row + 0.5) / (double)side;
}

/* cos cos / (pi r^2) between two patches: symmetric; 0 on one face. */
static inline double room_cube_exchange(size_t side, size_t i, size_t j) {
  double p[3], q[3], n[3], m[3], square = 0, from = 0, to = 0;
  room_cube_patch(side, i, p, n);
  room_cube_patch(side, j, q, m);
  for (int k = 0; k < 3; k++) {
    square += (q[k] - p[k]) * (q[k] - p[k]);
    from += (q[k] - p[k]) * n[k];
    to += (p[k] - q[k]) * m[k];
  }
  return from > 1e-12 && to > 1e-12 ? from * to / (M_PI * square * square) : 0;
}

static inline double room_exchange(const recipe *made, size_t i, size_t j, double u) {
  size_t half = (size_t)made->width * (size_t)made->height / 2;
  if (made->shape == SHAPE_CUBE) {
    return room_cube_exchange((size_t)made->height, i, j);
  }
  return made->shape == SHAPE_PLATES && (i < half) == (j < half) ? 0 : 0.02 + u * u;
}

/* G with a_i G_ij = a_j G_ji > 0 and row sums 1 - openness: a symmetric kernel E scaled to D E D (Sinkhorn). */
static inline void room_form_factors(const recipe *made, uint64_t *random, double *area, double *g) {
  size_t n = (size_t)made->width * (size_t)made->height;
  double *scale = room_numbers(n);
  for (size_t i = 0; i < n; i++) {
    area[i] = made->shape == SHAPE_CUBE ? 1 : 0.5 + 1.5 * test_random(random);
    scale[i] = 1;
    for (size_t j = 0; j < i; j++) {
      g[i * n + j] = g[j * n + i] = room_exchange(made, i, j, test_random(random));
    }
  }
  for (int pass = 0; pass < 200; pass++) {
    for (size_t i = 0; i < n; i++) {
      double sum = 0;
      for (size_t j = 0; j < n; j++) {
        sum += scale[i] * g[i * n + j] * scale[j];
      }
      scale[i] *= sqrt(area[i] / sum);
    }
  }
  for (size_t i = 0; i < n; i++) {
    for (size_t j = 0; j < n; j++) {
      g[i * n + j] *= scale[i] * scale[j] * (1 - made->openness) / area[i];
    }
  }
  free(scale);
}

/* T = (I - K G)^-1 diag(phi) of one channel, by LAPACK. */
static inline void room_fill_channel(test_room *room, int c, uint64_t *random, const double *area, const double *g) {
  size_t n = room->cells;
  double *matrix = room_numbers(n * n), *inverse = room_numbers(n * n);
  lapack_int *pivots = calloc(n, sizeof *pivots);
  double *flux = room->flux + (size_t)c * n;
  for (size_t i = 0; i < n; i++) {
    double albedo = room->made.albedo[c] * (1 - room->made.spread * test_random(random));
    for (size_t j = 0; j < n; j++) {
      matrix[i * n + j] = (i == j) - albedo * g[i * n + j];
      inverse[i * n + j] = i == j;
    }
    flux[i] = albedo / area[i];
  }
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, (lapack_int)n, (lapack_int)n, matrix, (lapack_int)n, pivots, inverse,
                                 (lapack_int)n),
                   0);
  float *entries = clt_transport_entries(room->transport, c);
  for (size_t j = 0; j < n; j++) {
    double phi = 0.3 + 0.7 * test_random(random);
    flux[j] *= inverse[j * n + j];
    for (size_t i = 0; i < n; i++) {
      entries[i * n + j] = (float)(inverse[i * n + j] * phi);
    }
  }
  free(matrix);
  free(inverse);
  free(pivots);
}

static inline void room_certify(test_room *room) {
  clt_error error = {0};
  clt_certificate_destroy(room->certificate);
  assert_ok(clt_certify(room->transport, &room->certificate, &error), error);
}

static inline test_room room_make(recipe made) {
  clt_error error = {0};
  test_room room = {.made = made, .cells = (size_t)made.width * (size_t)made.height};
  size_t n = room.cells;
  assert_ok(clt_transport_create_dense(made.width, made.height, made.channels, n, &room.transport, &error), error);
  double *area = room_numbers(n), *g = room_numbers(n * n);
  room.flux = room_numbers((size_t)made.channels * n);
  uint64_t random = made.seed;
  room_form_factors(&made, &random, area, g);
  for (int c = 0; c < made.channels; c++) {
    room_fill_channel(&room, c, &random, area, g);
  }
  free(area);
  free(g);
  room_certify(&room);
  return room;
}

/* One channel of width x height cells with the same albedo everywhere. */
static inline test_room room_closed(int width, int height, double albedo, uint64_t seed) {
  return room_make((recipe){.width = width, .height = height, .channels = 1, .seed = seed, .albedo = {albedo}});
}

/* A closed cube of side x side patches a face. */
static inline test_room room_cube(int side, double albedo, double spread, uint64_t seed) {
  return room_make((recipe){.width = 6 * side,
                            .height = side,
                            .channels = 1,
                            .seed = seed,
                            .albedo = {albedo},
                            .spread = spread,
                            .shape = SHAPE_CUBE});
}

static inline void room_free(test_room *room) {
  clt_certificate_destroy(room->certificate);
  clt_transport_destroy(room->transport);
  free(room->flux);
  free(room->known);
  free(room->b);
  free(room->x);
}

/* A dense transport of given float32 entries; one channel, cells x 1. */
static inline test_room room_of(size_t rows, size_t cols, const float *entries) {
  clt_error error = {0};
  test_room room = {.cells = cols, .made = {.width = (int)cols, .height = 1, .channels = 1}};
  assert_ok(clt_transport_create_dense((int)cols, 1, 1, rows, &room.transport, &error), error);
  memcpy(clt_transport_entries(room.transport, 0), entries, rows * cols * sizeof *entries);
  room_certify(&room);
  return room;
}

/* y = T x in double from the entries themselves. */
static inline void room_product(const clt_transport *transport, int c, const double *x, double *y) {
  clt_transport_info info = clt_transport_describe(transport);
  const float *entries = clt_transport_entries(transport, c);
  for (size_t i = 0; i < info.rows; i++) {
    y[i] = 0;
    for (size_t j = 0; j < info.cols; j++) {
      y[i] += (double)entries[i * info.cols + j] * x[j];
    }
  }
}

/* ||T x - b|| / ||b|| over the lit rows of every channel, recomputed. */
static inline double room_residual(const test_room *room, const double *x, const double *b) {
  clt_transport_info info = clt_transport_describe(room->transport);
  double *y = room_numbers(info.rows), rest = 0, size = 0;
  for (int c = 0; c < info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(room->certificate, c);
    room_product(room->transport, c, x + (size_t)c * info.cols, y);
    for (size_t i = 0; i < info.rows; i++) {
      double wanted = b[(size_t)c * info.rows + i];
      bool counts = info.rows != info.cols || lit[i];
      rest += counts ? (y[i] - wanted) * (y[i] - wanted) : 0;
      size += counts ? wanted * wanted : 0;
    }
  }
  free(y);
  return sqrt(rest / size);
}

/* The drive by LAPACK's LU of channel c's entries; every cell must be lit. */
static inline void room_direct(const test_room *room, int c, const double *b, double *x) {
  size_t n = room->cells;
  const float *entries = clt_transport_entries(room->transport, c);
  double *matrix = room_numbers(n * n);
  lapack_int *pivots = calloc(n, sizeof *pivots);
  for (size_t i = 0; i < n * n; i++) {
    matrix[i] = entries[i];
  }
  memcpy(x, b, n * sizeof *x);
  assert_int_equal(LAPACKE_dgesv(LAPACK_ROW_MAJOR, (lapack_int)n, 1, matrix, (lapack_int)n, pivots, x, 1), 0);
  free(matrix);
  free(pivots);
}

/* b = T x for random x in low..high, all channels. */
static inline void room_wanted(const test_room *room, uint64_t seed, double low, double high, double *x, double *b) {
  clt_transport_info info = clt_transport_describe(room->transport);
  for (int c = 0; c < info.channels; c++) {
    double *channel = x + (size_t)c * info.cols;
    for (size_t j = 0; j < info.cols; j++) {
      channel[j] = low + (high - low) * test_random(&seed);
    }
    room_product(room->transport, c, channel, b + (size_t)c * info.rows);
  }
}

/* Makes the room's own problem of it. */
static inline void room_ask(test_room *room, uint64_t seed, double low, double high) {
  clt_transport_info info = clt_transport_describe(room->transport);
  room->known = room_numbers((size_t)info.channels * info.cols);
  room->x = room_numbers((size_t)info.channels * info.cols);
  room->b = room_numbers((size_t)info.channels * info.rows);
  room_wanted(room, seed, low, high, room->known, room->b);
}

static inline double room_distance(const double *a, const double *b, size_t count) {
  double rest = 0, size = 0;
  for (size_t i = 0; i < count; i++) {
    rest += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return sqrt(rest / size);
}

#endif
