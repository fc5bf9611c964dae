/* Products with blocks storage. */
#include "transport/blocks.h"

#include <stdbool.h>
#include <string.h>

#include "transport/kernels.h"

/* A product walks down slices of cells, their number fixed so that sums do not depend on the number of threads, in
 * pieces that stay in the cache while the columns pass. */
enum { SLICES = 4, PIECE = 8192 };
enum { WORTH_SHARING = 16384 }; /* values of the columns from which threads pay */

/* scratch: SLICES x K partial sums, K gains, K totals, N values */
typedef struct workspace {
  double *partial, *gain, *total, *cells;
} workspace;

size_t clt_block_scratch(size_t cells, size_t count) {
  return (SLICES + 2) * count + cells;
}

static workspace begin_turn(const clt_transport *transport, int channel) {
  clt_block_storage *own = transport->storage;
  pthread_mutex_lock(&own->turn[channel]);
  double *scratch = own->scratch + (size_t)channel * clt_block_scratch(transport->cols, own->count);
  return (workspace){.partial = scratch,
                     .gain = scratch + SLICES * own->count,
                     .total = scratch + (SLICES + 1) * own->count,
                     .cells = scratch + (SLICES + 2) * own->count};
}

static void end_turn(const clt_transport *transport, int channel) {
  clt_block_storage *own = transport->storage;
  pthread_mutex_unlock(&own->turn[channel]);
}

static const float *column_of(const clt_transport *transport, int channel, size_t b) {
  const clt_block_storage *own = transport->storage;
  return own->column + ((size_t)channel * own->count + b) * transport->cols;
}

/* out = the sums of the slices. */
static void fold_slices(const double *partial, size_t count, double *out) {
  memset(out, 0, count * sizeof *out);
  for (size_t k = 0; k < SLICES * count; k++) {
    out[k % count] += partial[k];
  }
}

/* The sums of values over every block, weighted by the flux where it is asked for. */
static void sum_blocks(const clt_transport *transport, const workspace *room, const double *values, bool weighted,
                       double *sums) {
  const clt_block_storage *own = transport->storage;
  const size_t cells = transport->cols;
  memset(room->partial, 0, SLICES * own->count * sizeof *room->partial);
#pragma omp parallel for schedule(dynamic, 1) if (cells >= WORTH_SHARING)
  for (size_t slice = 0; slice < SLICES; slice++) {
    double *partial = room->partial + slice * own->count;
    for (size_t j = cells * slice / SLICES; j < cells * (slice + 1) / SLICES; j++) {
      partial[own->block[j]] += weighted ? (double)own->flux[j] * values[j] : values[j];
    }
  }
  fold_slices(room->partial, own->count, sums);
}

/* One piece of up to four columns: out += C gain and partial += C' in. */
static void pass_piece(const clt_pass_kernels *kernels, const float *const column[CLT_PLAIN_ROWS], size_t columns,
                       size_t count, const double *gain, const double *in, double *out, double *partial) {
  double sum[CLT_PLAIN_ROWS], factor[CLT_PLAIN_ROWS] = {0};
  memcpy(factor, gain, columns * sizeof *factor);
  kernels->pass(column, factor, in, count, sum, out);
  for (size_t r = 0; r < columns; r++) {
    partial[r] += sum[r];
  }
}

/* out += C gain and total = C' in, reading the columns once. */
static void pass_columns(const clt_transport *transport, int channel, const double *in, const workspace *room,
                         double *out) {
  const clt_block_storage *own = transport->storage;
  const size_t cells = transport->cols, count = own->count;
  const clt_pass_kernels *kernels = clt_pass_choose();
  memset(room->partial, 0, SLICES * count * sizeof *room->partial);
#pragma omp parallel for schedule(dynamic, 1) if (cells * count >= WORTH_SHARING)
  for (size_t slice = 0; slice < SLICES; slice++) {
    double *partial = room->partial + slice * count;
    const size_t end = cells * (slice + 1) / SLICES;
    for (size_t first = cells * slice / SLICES; first < end; first += PIECE) {
      const size_t length = end - first < PIECE ? end - first : PIECE;
      for (size_t b = 0; b < count; b += CLT_PLAIN_ROWS) {
        const size_t columns = count - b < CLT_PLAIN_ROWS ? count - b : CLT_PLAIN_ROWS;
        const float *column[CLT_PLAIN_ROWS];
        for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) { /* behind the last column, that column again */
          column[r] = column_of(transport, channel, r < columns ? b + r : count - 1) + first;
        }
        pass_piece(kernels, column, columns, length, room->gain + b, in + first, out + first, partial + b);
      }
    }
  }
  fold_slices(room->partial, count, room->total);
}

static const float *near_of(const clt_transport *transport, int channel) {
  const clt_block_storage *own = transport->storage;
  return own->value + (size_t)channel * (size_t)own->start[transport->rows];
}

static void near_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  const clt_block_storage *own = transport->storage;
  const float *value = near_of(transport, channel);
#pragma omp parallel for schedule(static) if (own->start[transport->rows] >= WORTH_SHARING)
  for (size_t i = 0; i < transport->rows; i++) {
    double sum = 0;
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      sum += (double)value[e] * x[own->cell[e]];
    }
    y[i] = sum;
  }
}

/* e_b the mean of x over b by flux, u = W (x - P e), z = C' u:  y = near x + C e + P D^-1 z */
static void blocks_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  const clt_block_storage *own = transport->storage;
  workspace room = begin_turn(transport, channel);
  near_apply(transport, channel, x, y);
  sum_blocks(transport, &room, x, true, room.gain);
  for (size_t b = 0; b < own->count; b++) {
    room.gain[b] *= own->inverse[b];
  }
#pragma omp parallel for schedule(static) if (transport->cols >= WORTH_SHARING)
  for (size_t j = 0; j < transport->cols; j++) {
    room.cells[j] = (double)own->flux[j] * (x[j] - room.gain[own->block[j]]);
  }
  pass_columns(transport, channel, room.cells, &room, y);
#pragma omp parallel for schedule(static) if (transport->cols >= WORTH_SHARING)
  for (size_t i = 0; i < transport->rows; i++) {
    y[i] += own->inverse[own->block[i]] * room.total[own->block[i]];
  }
  end_turn(transport, channel);
}

/* q = D^-1 P' y, p = C' y, v = C q, v_b the mean of v over b by flux:  x = near' y + W (P D^-1 p + v - P v_b) */
static void blocks_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  const clt_block_storage *own = transport->storage;
  workspace room = begin_turn(transport, channel);
  sum_blocks(transport, &room, y, false, room.gain);
  for (size_t b = 0; b < own->count; b++) {
    room.gain[b] *= own->inverse[b];
  }
  memset(room.cells, 0, transport->cols * sizeof *room.cells);
  pass_columns(transport, channel, y, &room, room.cells);
  sum_blocks(transport, &room, room.cells, true, room.gain);
  for (size_t j = 0; j < transport->cols; j++) {
    const int32_t b = own->block[j];
    x[j] = (double)own->flux[j] * (own->inverse[b] * (room.total[b] - room.gain[b]) + room.cells[j]);
  }
  const float *value = near_of(transport, channel);
  for (size_t i = 0; i < transport->rows; i++) {
    for (int64_t e = own->start[i]; y[i] != 0 && e < own->start[i + 1]; e++) {
      x[own->cell[e]] += (double)value[e] * y[i];
    }
  }
  end_turn(transport, channel);
}

/* far_ii = w_i (2 C_ia - mean of C_a over a) / D_a */
static void blocks_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  const clt_block_storage *own = transport->storage;
  const float *value = near_of(transport, channel);
  workspace room = begin_turn(transport, channel);
  for (size_t i = 0; i < transport->cols; i++) {
    room.cells[i] = (double)column_of(transport, channel, (size_t)own->block[i])[i];
  }
  sum_blocks(transport, &room, room.cells, true, room.total);
  for (size_t i = 0; i < transport->rows; i++) {
    const int32_t a = own->block[i];
    const double mean = room.total[a] * own->inverse[a];
    double entry = (double)own->flux[i] * own->inverse[a] * (2 * room.cells[i] - mean);
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      entry += own->cell[e] == (int32_t)i ? (double)value[e] : 0;
    }
    diagonal[i] = entry;
  }
  end_turn(transport, channel);
}

/* Where every block has flux, far 1 is the sum of the columns. */
static void blocks_row_sums(const clt_transport *transport, int channel, double *sums) {
  const clt_block_storage *own = transport->storage;
  const float *value = near_of(transport, channel);
#pragma omp parallel for schedule(static) if (transport->cols * own->count >= WORTH_SHARING)
  for (size_t i = 0; i < transport->rows; i++) {
    double sum = 0;
    for (size_t b = 0; b < own->count; b++) {
      sum += own->inverse[b] > 0 ? (double)column_of(transport, channel, b)[i] : 0;
    }
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      sum += (double)value[e];
    }
    sums[i] = sum;
  }
}

static size_t blocks_bytes(const clt_transport *transport) {
  const clt_block_storage *own = transport->storage;
  const size_t entries = (size_t)own->start[transport->rows], cells = transport->cols;
  const size_t pattern = entries * sizeof *own->cell + (cells + 1) * sizeof *own->start;
  const size_t per_cell = sizeof *own->block + sizeof *own->flux + own->count * sizeof *own->column;
  return (size_t)transport->channels * (pattern + entries * sizeof *own->value + cells * per_cell);
}

static float *blocks_entries(const clt_transport *transport, int channel) {
  (void)transport;
  (void)channel;
  return NULL;
}

const clt_kind clt_kind_blocks = {.name = "blocks",
                                  .apply = blocks_apply,
                                  .apply_transposed = blocks_apply_transposed,
                                  .diagonal = blocks_diagonal,
                                  .row_sums = blocks_row_sums,
                                  .bytes = blocks_bytes,
                                  .entries = blocks_entries,
                                  .check = clt_blocks_check,
                                  .load = clt_blocks_load,
                                  .save = clt_blocks_save,
                                  .destroy = clt_blocks_destroy};
