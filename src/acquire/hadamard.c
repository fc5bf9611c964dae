/* Hadamard multiplexing: half of the cells are lit in every pattern.
 *
 * With the Sylvester-Hadamard matrix H of order n + 1, a power of two above N, pattern i = 1..n lights cell j - 1 where
 * H_ij = -1: the S-matrix (1 - H) / 2 (Harwit and Sloane 1979; Schechner, Nayar, Belhumeur 2007). Its photographs y_i
 * with y_0 = 0 give t_j = -2 / (n + 1) sum_i H_ij y_i, a fast Walsh-Hadamard transform of every observed cell. Noise
 * that does not grow with light falls by (n + 1) / (2 sqrt(n)) in deviation; that of photons does not fall. */
#include <math.h>
#include <stdlib.h>

#include "acquire/session.h"
#include "base/memory.h"

enum { CELLS_MAX = 4096 };

/* The order n + 1. */
static size_t find_order(size_t cells) {
  size_t order = 2;
  while (order <= cells) {
    order *= 2;
  }
  return order;
}

static int repeats_of_black(size_t cells) {
  (void)cells;
  return CLT_REPEATS_DEFAULT;
}

static long count_patterns(const clt_session *session) {
  return (long)find_order(session->cells) - 1;
}

/* H_ij is negative where the numbers have an odd number of ones in common. */
static void light_pattern(clt_session *session, size_t i) {
  clt_image *drive = &session->drive;
  for (size_t at = 0; at < clt_image_size(drive); at++) {
    drive->data[at] = (float)__builtin_parityll((unsigned long long)(i & (at % session->cells + 1)));
  }
}

/* The sum of 16 patterns that differ in the last four bits of i, weighted by 1/4 (-1)^(i0 i1 + i2 i3), is a pattern of
 * zeros and ones itself: a bent function, whose transform has one magnitude (Rothaus 1976). Smaller orders have none
 * of that size. */
static double weight_in_sum(size_t i, size_t order) {
  const size_t odd = (i & (i >> 1) & 1) ^ ((i >> 2) & (i >> 3) & 1);
  return order < 16 ? 0 : odd ? -0.25 : 0.25;
}

/* In place, without scaling. */
static void transform(float *values, size_t order) {
  for (size_t half = 1; half < order; half *= 2) {
    for (size_t first = 0; first < order; first += 2 * half) {
      for (size_t k = first; k < first + half; k++) {
        const float sum = values[k] + values[k + half], difference = values[k] - values[k + half];
        values[k] = sum;
        values[k + half] = difference;
      }
    }
  }
}

/* light: [c][row][pattern]; variance: of a row's photographs, summed. */
static clt_status photograph(clt_session *session, size_t order, float *light, double *variance, clt_error *error) {
  const size_t values = clt_image_size(&session->seen);
  for (size_t i = 1; i < order; i++) {
    light_pattern(session, i);
    session->weight = weight_in_sum(i, order);
    clt_status status = clt_session_observe(session, "hadamard", error);
    if (status != CLT_OK) {
      return status;
    }
    for (size_t at = 0; at < values; at++) {
      const double deviation = (double)session->deviation.data[at];
      light[at * order + i] = session->seen.data[at] - session->black.data[at];
      variance[at] += deviation * deviation;
    }
  }
  return CLT_OK;
}

/* All entries of a row have the same variance: what they lack to the flood is shared evenly. */
static void write_row(float *row, const float *transformed, size_t cells, size_t order, double flood) {
  double missing = flood;
  for (size_t j = 0; j < cells; j++) {
    row[j] = -2 / (float)order * transformed[j + 1];
    missing -= (double)row[j];
  }
  for (size_t j = 0; j < cells; j++) {
    row[j] += (float)(missing / (double)cells);
  }
}

static void demultiplex(const clt_session *session, size_t order, float *light, const double *variance,
                        clt_transport *transport) {
  const size_t cells = session->cells, values = clt_image_size(&session->seen);
#pragma omp parallel for schedule(static)
  for (size_t at = 0; at < values; at++) {
    const int c = (int)(at / cells);
    transform(light + at * order, order);
    write_row(clt_transport_entries(transport, c) + at % cells * cells, light + at * order, cells, order,
              (double)session->flood.data[at]);
    clt_transport_sigma_values(transport, c)[at % cells] = (float)(2 / (double)order * sqrt(variance[at]));
  }
}

static clt_status measure_hadamard(clt_session *session, clt_transport **out, clt_error *error) {
  const clt_rig_info *info = &session->info;
  if (session->cells > CELLS_MAX) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "hadamard on %zu cells would take %ld patterns; it serves up to %d cells: take blocks or hierarchical",
        session->cells, count_patterns(session), CELLS_MAX);
  }
  const size_t order = find_order(session->cells), values = clt_image_size(&session->seen);
  clt_transport *transport = NULL;
  float *light = clt_alloc(values, order * sizeof *light);
  double *variance = clt_alloc(values, sizeof *variance);
  clt_status status =
      light != NULL && variance != NULL
          ? clt_transport_create_dense(info->width, info->height, info->channels, session->cells, &transport, error)
          : clt_fail(error, CLT_FAILED, "out of memory for %zu patterns", order);
  if (status == CLT_OK) {
    status = clt_transport_keep_sigma(transport, error);
  }
  if (status == CLT_OK) {
    status = photograph(session, order, light, variance, error);
  }
  if (status == CLT_OK) {
    demultiplex(session, order, light, variance, transport);
  }
  free(light);
  free(variance);
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  *out = transport;
  return CLT_OK;
}

/* None where the grid is too large. */
static double expected_error(const clt_session *session) {
  return session->cells <= CELLS_MAX ? 0.004 : INFINITY;
}

const clt_scheme clt_scheme_hadamard = {"hadamard", repeats_of_black, count_patterns, expected_error,
                                        false,      measure_hadamard};
