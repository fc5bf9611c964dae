/* The report's iteration l = b - R l in single precision, R by compressed rows.
 *
 * All of R is too large to keep. A row holds one entry for each tile of the grid: the light that the tile's cells give
 * to this one, for the l of the cell in their middle, as the report's rows of 128 entries keep far light by parts. All
 * rows take the same cells, which favours the iteration: what it reads of l stays in the nearest cache. Entries are
 * doubled until the drive that the iteration ends at is as exact as the frame's, or memory is short. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "tradeoff/bench/bench.h"

enum { ENTRIES_LEAST = 128, LANES = 8 };
static const double BYTES_MOST = 1.25 * 0x1p30;

typedef struct rows {
  int channels, width, height;
  size_t cells, entries;
  int32_t *cell;                  /* cells x entries */
  float *value;                   /* channels x cells x entries: R */
  float *inverse;                 /* channels x cells: 1 / F */
  float *light, *before, *wanted; /* channels x cells */
  float *target;
  double *x, *y;
} rows;

static clt_status reserve_vectors(rows *own, clt_error *error) {
  const size_t values = (size_t)own->channels * own->cells;
  own->inverse = clt_alloc(5 * values, sizeof *own->inverse);
  own->x = clt_alloc(2 * values, sizeof *own->x);
  if (own->inverse == NULL || own->x == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for an iteration over %zu cells", own->cells);
  }
  own->light = own->inverse + values;
  own->before = own->inverse + 2 * values;
  own->wanted = own->inverse + 3 * values;
  own->target = own->inverse + 4 * values;
  own->y = own->x + values;
  return CLT_OK;
}

static void release_rows(rows *own) {
  free(own->cell);
  free(own->value);
  own->cell = NULL;
  own->value = NULL;
}

static void release(rows *own) {
  release_rows(own);
  free(own->inverse);
  free(own->x);
}

static double bytes_of(const rows *own, size_t entries) {
  return (double)own->cells * (double)entries *
         ((double)sizeof *own->cell + (double)own->channels * (double)sizeof *own->value);
}

static clt_status reserve_rows(rows *own, size_t entries, clt_error *error) {
  release_rows(own);
  own->entries = entries;
  own->cell = clt_alloc(own->cells * entries, sizeof *own->cell);
  own->value = clt_alloc((size_t)own->channels * own->cells * entries, sizeof *own->value);
  return own->cell != NULL && own->value != NULL
             ? CLT_OK
             : clt_fail(error, CLT_FAILED, "no memory for compressed rows of %zu x %zu entries", own->cells, entries);
}

/* As many tiles as a row has entries, across and down, as square as halving allows. */
static void choose_tiles(const rows *own, int *across, int *down) {
  *across = *down = 1;
  for (size_t tiles = 1; tiles < own->entries; tiles *= 2) {
    if ((long)own->width * *down >= (long)own->height * *across) {
      *across *= 2;
    } else {
      *down *= 2;
    }
  }
}

/* Products with a lit tile each tell what its cells give together; each cell's own light is left out. */
static void fill_rows(rows *own, const clt_transport *transport, int channel) {
  const size_t cells = own->cells, base = (size_t)channel * cells, width = (size_t)own->width;
  double *x = own->x + base, *y = own->y + base;
  int across, down;
  choose_tiles(own, &across, &down);
  for (size_t k = 0; k < own->entries; k++) {
    const int tile_x = (int)k % across, tile_y = (int)k / across;
    const int left = own->width * tile_x / across, right = own->width * (tile_x + 1) / across;
    const int top = own->height * tile_y / down, bottom = own->height * (tile_y + 1) / down;
    const size_t lit = (size_t)((top + bottom) / 2) * width + (size_t)((left + right) / 2);
    for (size_t j = 0; j < cells; j++) {
      const int cell_x = (int)(j % width), cell_y = (int)(j / width);
      const bool inside = cell_x >= left && cell_x < right && cell_y >= top && cell_y < bottom;
      x[j] = inside ? (double)own->inverse[base + j] : 0;
    }
    clt_transport_apply(transport, channel, x, y);
    for (size_t i = 0; i < cells; i++) {
      const double own_light = x[i] > 0 ? 1 : 0;
      own->cell[i * own->entries + k] = (int32_t)lit;
      own->value[(base + i) * own->entries + k] = (float)(y[i] - own_light);
    }
  }
}

static void invert_diagonal(rows *own, const clt_transport *transport) {
  for (int c = 0; c < own->channels; c++) {
    float *inverse = own->inverse + (size_t)c * own->cells;
    clt_transport_diagonal(transport, c, own->y);
    for (size_t i = 0; i < own->cells; i++) {
      inverse[i] = own->y[i] > 0 ? (float)(1 / own->y[i]) : 0;
    }
  }
}

/* light = b - R before; returns ||light - before||, the residual of before. */
static double iterate(rows *own) {
  const size_t entries = own->entries;
  double sum = 0;
#pragma omp parallel for schedule(static) reduction(+ : sum)
  for (size_t at = 0; at < (size_t)own->channels * own->cells; at++) {
    const float *value = own->value + at * entries, *light = own->before + at / own->cells * own->cells;
    const int32_t *cell = own->cell + at % own->cells * entries;
    float lane[LANES] = {0};
    for (size_t k = 0; k < entries; k += LANES) {
      for (size_t l = 0; l < LANES; l++) {
        lane[l] += value[k + l] * light[cell[k + l]];
      }
    }
    const float seen = ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
    own->light[at] = own->wanted[at] - seen;
    const double apart = (double)(own->light[at] - own->before[at]);
    sum += apart * apart;
  }
  return sqrt(sum);
}

/* Fills what is wanted of a frame; returns its norm. */
static double want(rows *own, const clt_transport *transport, int number) {
  double sum = 0;
  clt_bench_picture(transport, number, CLT_BENCH_WITHIN, own->x, own->y, own->target);
  for (size_t at = 0; at < (size_t)own->channels * own->cells; at++) {
    own->wanted[at] = (float)own->y[at];
    sum += own->y[at] * own->y[at];
  }
  return sqrt(sum);
}

/* One frame from `light`, *ms it takes; false where it does not come to the end. */
static bool run(rows *own, double stop_at, double *ms) {
  enum { ITERATIONS_MOST = 200 };
  const int64_t since_ns = clt_clock_ns();
  bool done = false;
  for (int k = 0; k < ITERATIONS_MOST && !done; k++) {
    float *before = own->light;
    own->light = own->before;
    own->before = before;
    done = iterate(own) <= stop_at;
  }
  *ms = 1e3 * clt_clock_since(since_ns);
  return done;
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

/* Frames from nothing and, where `warm`, from the light of the frame before. */
static void measure(rows *own, const clt_transport *transport, double tolerance, clt_bench_peer *peer) {
  double cold[CLT_BENCH_TURNS], warm[CLT_BENCH_TURNS];
  for (int k = 0; k < CLT_BENCH_TURNS; k++) {
    const double wanted = want(own, transport, 0);
    memset(own->light, 0, (size_t)own->channels * own->cells * sizeof *own->light);
    run(own, tolerance * wanted, &cold[k]);
  }
  peer->error = judge(own, transport);
  for (int k = 0; k < CLT_BENCH_TURNS; k++) {
    run(own, tolerance * want(own, transport, k + 1), &warm[k]);
  }
  peer->ms = clt_bench_median(cold, CLT_BENCH_TURNS);
  peer->warm_ms = clt_bench_median(warm, CLT_BENCH_TURNS);
  peer->entries = (int)own->entries;
}

/* The loosest tolerance of its own, down to a quarter of the target error, whose answer is within that by all of T; 0
 * where it does not come to the end. */
static double choose_tolerance(rows *own, const clt_transport *transport, double target_error, double *error) {
  double tolerance = 2 * target_error, ms;
  do {
    tolerance /= 2;
    const double wanted = want(own, transport, 0);
    memset(own->light, 0, (size_t)own->channels * own->cells * sizeof *own->light);
    if (!run(own, tolerance * wanted, &ms)) {
      return 0;
    }
    *error = judge(own, transport);
  } while (*error > target_error && tolerance > target_error / 4);
  return tolerance;
}

static bool is_known_to_diverge(const clt_certificate *certificate, int channels) {
  bool diverges = false;
  for (int c = 0; c < channels; c++) {
    diverges = diverges || clt_certificate_channel(certificate, c)->radius_low >= 1;
  }
  return diverges;
}

/* With rows of so many entries, as many as are worth it: *done. */
static clt_status try_rows(rows *own, const clt_transport *transport, size_t entries, double target_error,
                           clt_bench_peer *peer, bool *done, clt_error *error) {
  clt_status status = reserve_rows(own, entries, error);
  if (status != CLT_OK) {
    return status;
  }
  double left = 0;
  invert_diagonal(own, transport);
  for (int c = 0; c < own->channels; c++) {
    fill_rows(own, transport, c);
  }
  const double tolerance = choose_tolerance(own, transport, target_error, &left);
  peer->converged = tolerance > 0;
  *done = left <= target_error || bytes_of(own, 2 * entries) > BYTES_MOST || 2 * entries > own->cells;
  if (*done && peer->converged) {
    measure(own, transport, tolerance, peer);
  }
  *done = *done || !peer->converged;
  return CLT_OK;
}

clt_status clt_bench_jacobi(const clt_transport *transport, const clt_certificate *certificate, double target_error,
                            clt_bench_peer *peer, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  rows own = {.cells = info.cols, .channels = info.channels, .width = info.width, .height = info.height};
  *peer = (clt_bench_peer){.name = "report-jacobi-csr-f32"};
  bool done = is_known_to_diverge(certificate, info.channels);
  clt_status status = done ? CLT_OK : reserve_vectors(&own, error);
  for (size_t entries = ENTRIES_LEAST; status == CLT_OK && !done; entries *= 2) {
    status = try_rows(&own, transport, entries, target_error, peer, &done, error);
  }
  release(&own);
  return status;
}
