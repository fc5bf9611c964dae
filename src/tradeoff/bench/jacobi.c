/* The report's iteration l = b - R l in single precision, R by compressed rows.
 *
 * All of R is too large to keep. As the report's figures for 131072 cells do, a row holds 128 entries: those on and
 * next to the diagonal, and far light of a sample of cells, each with the light of the cells around it that it stands
 * for. All rows take the same sample, which favours the iteration: what it reads of l stays in the nearest cache. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"
#include "tradeoff/bench/bench.h"

enum { SAMPLE = 125, NEAR = 3, ROW = SAMPLE + NEAR };

typedef struct rows {
  size_t cells;
  int channels, width;
  int32_t *cell;          /* cells x ROW */
  float *value, *inverse; /* channels x cells x ROW: R; channels x cells: 1 / F */
  float *light, *next, *wanted;
  double *x, *y;
} rows;

static clt_status reserve(rows *own, clt_error *error) {
  const size_t values = (size_t)own->channels * own->cells;
  own->cell = clt_alloc(own->cells * ROW, sizeof *own->cell);
  own->value = clt_alloc(values * ROW, sizeof *own->value);
  own->inverse = clt_alloc(4 * values, sizeof *own->inverse);
  own->x = clt_alloc(2 * values, sizeof *own->x);
  if (own->cell == NULL || own->value == NULL || own->inverse == NULL || own->x == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for compressed rows of %zu cells", own->cells);
  }
  own->light = own->inverse + values;
  own->next = own->inverse + 2 * values;
  own->wanted = own->inverse + 3 * values;
  own->y = own->x + values;
  return CLT_OK;
}

/* Products with a lit cell each tell columns of T: with one lit cell in every stretch, its light as seen far away. */
static void fill_channel(rows *own, const clt_transport *transport, int channel) {
  const size_t cells = own->cells, base = (size_t)channel * cells;
  double *x = own->x + base, *y = own->y + base;
  clt_transport_diagonal(transport, channel, y);
  for (size_t i = 0; i < cells; i++) {
    own->inverse[base + i] = y[i] > 0 ? (float)(1 / y[i]) : 0;
  }
  for (size_t k = 0; k < SAMPLE; k++) {
    const size_t first = cells * k / SAMPLE, end = cells * (k + 1) / SAMPLE, lit = (first + end) / 2;
    for (size_t j = 0; j < cells; j++) {
      x[j] = j >= first && j < end ? 1 : 0;
    }
    clt_transport_apply(transport, channel, x, y);
    for (size_t i = 0; i < cells; i++) {
      const double own_light = i >= first && i < end ? 1 / fmax((double)own->inverse[base + i], 1e-30) : 0;
      own->cell[i * ROW + NEAR + k] = (int32_t)lit;
      own->value[(base + i) * ROW + NEAR + k] = (float)((y[i] - own_light) * (double)own->inverse[base + lit]);
    }
  }
  for (size_t i = 0; i < cells; i++) {
    for (size_t k = 0; k < NEAR; k++) {
      own->cell[i * ROW + k] = (int32_t)(i + k < cells ? i + k : i);
    }
  }
}

/* next = b - R l; returns ||next - l||, the residual of l. */
static double iterate(rows *own) {
  double sum = 0;
#pragma omp parallel for schedule(static) reduction(+ : sum)
  for (size_t at = 0; at < (size_t)own->channels * own->cells; at++) {
    const float *value = own->value + at * ROW, *light = own->light + at / own->cells * own->cells;
    const int32_t *cell = own->cell + at % own->cells * ROW;
    float lane[8] = {0};
    for (size_t k = 0; k < ROW; k += 8) {
      for (size_t l = 0; l < 8; l++) {
        lane[l] += value[k + l] * light[cell[k + l]];
      }
    }
    const float seen = ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
    own->next[at] = own->wanted[at] - seen;
    const double apart = (double)(own->next[at] - own->light[at]);
    sum += apart * apart;
  }
  return sqrt(sum);
}

static double run(rows *own, double target_error, double wanted) {
  enum { ITERATIONS_MOST = 200 };
  const int64_t since_ns = clt_clock_ns();
  for (int k = 0; k < ITERATIONS_MOST; k++) {
    const double left = iterate(own);
    float *before = own->light;
    own->light = own->next;
    own->next = before;
    if (left <= target_error * wanted) {
      break;
    }
  }
  return 1e3 * clt_clock_since(since_ns);
}

/* ||T F^-1 l - b|| / ||b|| by T as stored. */
static double judge(rows *own, const clt_transport *transport) {
  double apart = 0, whole = 0;
  for (size_t at = 0; at < (size_t)own->channels * own->cells; at++) {
    own->x[at] = (double)own->light[at] * (double)own->inverse[at];
  }
  clt_transport_apply_all(transport, own->x, own->y);
  for (size_t at = 0; at < (size_t)own->channels * own->cells; at++) {
    const double wanted = (double)own->wanted[at];
    apart += (own->y[at] - wanted) * (own->y[at] - wanted);
    whole += wanted * wanted;
  }
  return whole > 0 ? sqrt(apart / whole) : 0;
}

clt_status clt_bench_jacobi(const clt_transport *transport, double target_error, clt_bench_peer *peer,
                            clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  rows own = {.cells = info.cols, .channels = info.channels, .width = info.width};
  clt_status status = reserve(&own, error);
  float *first = own.inverse;
  if (status == CLT_OK) {
    double wanted = 0;
    for (int c = 0; c < own.channels; c++) {
      fill_channel(&own, transport, c);
    }
    clt_bench_picture(transport, 0, own.x, own.y, own.wanted);
    for (size_t at = 0; at < (size_t)own.channels * own.cells; at++) {
      own.wanted[at] = (float)own.y[at];
      wanted += own.y[at] * own.y[at];
    }
    snprintf(peer->name, sizeof peer->name, "report-jacobi-csr-f32");
    peer->ms = run(&own, target_error, sqrt(wanted));
    peer->error = judge(&own, transport);
  }
  free(own.cell);
  free(own.value);
  free(first);
  free(own.x);
  return status;
}
