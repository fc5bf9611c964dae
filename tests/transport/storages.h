/* Transports with a contact corner (entries that range over 1e5 in one row), converted to every dense storage, with
 * what conversion may do to an entry. */
#ifndef CLT_TESTS_TRANSPORT_STORAGES_H
#define CLT_TESTS_TRANSPORT_STORAGES_H

#include <float.h>

#include "cases.h"

/* A bright diagonal, light that falls off with the distance of cells by up to 1e5, and noise that goes below zero. */
static inline known_transport contact_dense(const size_case *size, uint64_t *state) {
  known_transport known = random_dense(size, state);
  const size_t cols = (size_t)size->width * (size_t)size->height, count = size->rows * cols;
  for (int c = 0; c < size->channels; c++) {
    float *entries = clt_transport_entries(known.transport, c);
    for (size_t k = 0; k < count; k++) {
      const double away = fabs((double)(k / cols) - (double)(k % cols));
      const double light = away == 0 ? 0.7 : 0.2 * test_random(state) * pow(10, -5 * fmin(away / 40, 1));
      entries[k] = (float)(light + 1e-5 * (test_random(state) - 0.5));
      known.reference[(size_t)c * count + k] = (double)entries[k];
    }
  }
  return known;
}

/* What clt_transport_convert says of a storage's entries off the diagonal. */
typedef struct storage_case {
  const char *name;
  double itself, row; /* times the entry, and the largest off the diagonal of its row */
  double block;       /* times the largest of its block; and the mean of that over the row, which the offset may be */
  double diagonal;    /* times the entry on the diagonal */
  double rounding;    /* of a product, relative to the sum of the terms' magnitudes */
} storage_case;

static const storage_case storage_cases[] = {{"dense64", 0, 0, 0, 0, 1e-14},
                                             {"dense", 0x1p-24, 0, 0, 0x1p-24, 1e-14},
                                             {"dense16", 0x1p-11, 0x1p-29, 0, 0x1p-24, 3e-7},
                                             {"dense8", 0, 1e-7, 1 / 253.9, 0x1p-24, 3e-7}};
enum { STORAGES = sizeof storage_cases / sizeof storage_cases[0] };

static inline double largest_off_diagonal(const double *row, size_t i, size_t first, size_t end) {
  double largest = 0;
  for (size_t j = first; j < end; j++) {
    largest = j != i ? fmax(largest, fabs(row[j])) : largest;
  }
  return largest;
}

/* By how much each entry of row i may change. */
static inline void entry_bounds(const storage_case *storage, const double *row, size_t cols, size_t i, double *bound) {
  const double largest = largest_off_diagonal(row, i, 0, cols);
  double mean = 0;
  for (size_t first = 0; first < cols; first += 32) {
    const size_t end = first + 32 < cols ? first + 32 : cols;
    const double own = storage->block * largest_off_diagonal(row, i, first, end);
    mean += own * (double)(end - first) / (double)cols;
    for (size_t j = first; j < end; j++) {
      bound[j] = storage->itself * fabs(row[j]) + storage->row * largest + own;
    }
  }
  for (size_t j = 0; j < cols; j++) {
    bound[j] = j == i ? storage->diagonal * fabs(row[j]) : bound[j] + mean * (double)cols / fmax((double)cols - 1, 1);
  }
}

static inline clt_transport *convert(const clt_transport *from, const char *storage) {
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_convert(from, storage, &made, &error), error);
  assert_string_equal(clt_transport_describe(made).storage, storage);
  return made;
}

/* known_transport of a storage; the reference stays that of the float entries. */
static inline known_transport contact_in(const char *storage, const size_case *size, uint64_t *state) {
  known_transport known = contact_dense(size, state);
  clt_transport *made = convert(known.transport, storage);
  clt_transport_destroy(known.transport);
  known.transport = made;
  return known;
}

static inline known_transport contact_dense64(const size_case *size, uint64_t *state) {
  return contact_in("dense64", size, state);
}

static inline known_transport contact_dense16(const size_case *size, uint64_t *state) {
  return contact_in("dense16", size, state);
}

static inline known_transport contact_dense8(const size_case *size, uint64_t *state) {
  return contact_in("dense8", size, state);
}

/* The entries of a channel as the transport gives its rows. */
static inline double *rows_of(const clt_transport *transport, int channel) {
  const clt_transport_info info = clt_transport_describe(transport);
  double *entries = malloc(info.rows * info.cols * sizeof *entries);
  clt_error error = {0};
  for (size_t i = 0; i < info.rows; i++) {
    assert_ok(clt_transport_row(transport, channel, i, entries + i * info.cols, &error), error);
  }
  return entries;
}

#endif
