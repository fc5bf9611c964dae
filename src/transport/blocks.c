/* Products with blocks storage. */
#include "transport/blocks.h"

#include <stdbool.h>
#include <string.h>

#include "transport/kernels.h"

/* A product walks down slices of cells, their number fixed so that sums do not depend on the number of threads, in
 * pieces that stay in the cache while the columns pass. */
enum { SLICES = 16, PIECE = 8192 };
enum { WORTH_SHARING = 16384 }; /* values of the columns from which threads pay */

/* scratch: twice SLICES x K partial sums, twice K sums, N values */
typedef struct workspace {
  double *partial, *of_blocks; /* SLICES x K: of the columns, and over the blocks */
  double *total, *even;        /* K: their sums */
  double *cells;
} workspace;

/* The cells first <= j < end. */
typedef struct slice {
  size_t first, end;
  double *partial, *of_blocks; /* K, its own */
} slice;

size_t clt_block_scratch(size_t cells, size_t count) {
  return 2 * (SLICES + 1) * count + cells;
}

static workspace begin_turn(const clt_transport *transport, int channel) {
  clt_block_storage *own = transport->storage;
  pthread_mutex_lock(&own->turn[channel]);
  double *scratch = own->scratch + (size_t)channel * clt_block_scratch(transport->cols, own->count);
  return (workspace){.partial = scratch,
                     .of_blocks = scratch + SLICES * own->count,
                     .total = scratch + 2 * SLICES * own->count,
                     .even = scratch + (2 * SLICES + 1) * own->count,
                     .cells = scratch + 2 * (SLICES + 1) * own->count};
}

static void end_turn(const clt_transport *transport, int channel) {
  clt_block_storage *own = transport->storage;
  pthread_mutex_unlock(&own->turn[channel]);
}

static slice slice_of(const clt_transport *transport, const workspace *room, size_t number) {
  const clt_block_storage *own = transport->storage;
  return (slice){.first = transport->cols * number / SLICES,
                 .end = transport->cols * (number + 1) / SLICES,
                 .partial = room->partial + number * own->count,
                 .of_blocks = room->of_blocks + number * own->count};
}

static bool is_worth_sharing(const clt_transport *transport) {
  const clt_block_storage *own = transport->storage;
  return transport->cols * own->count >= WORTH_SHARING;
}

static const float *column_of(const clt_transport *transport, int channel, size_t b) {
  const clt_block_storage *own = transport->storage;
  return own->column + ((size_t)channel * own->count + b) * transport->cols;
}

static const float *near_of(const clt_transport *transport, int channel) {
  const clt_block_storage *own = transport->storage;
  return own->value + (size_t)channel * (size_t)own->start[transport->rows];
}

/* out = the sums of the slices. */
static void fold_slices(const double *partial, size_t count, double *out) {
  memset(out, 0, count * sizeof *out);
  for (size_t k = 0; k < SLICES * count; k++) {
    out[k % count] += partial[k];
  }
}

/* The mean of the values over every block from their sums: 0 where it has no flux. */
static void fold_means(const clt_block_storage *own, const double *partial, double *out) {
  fold_slices(partial, own->count, out);
  for (size_t b = 0; b < own->count; b++) {
    out[b] *= own->inverse[b];
  }
}

/* The sums of a slice's values over every block, weighted by the flux where it is asked for. Cells of a block lie side
 * by side: a sum is added to once a run. */
static void sum_blocks(const clt_block_storage *own, const slice *of, const double *values, bool weighted,
                       double *sums) {
  memset(sums, 0, own->count * sizeof *sums);
  for (size_t first = of->first; first < of->end;) {
    const int32_t block = own->block[first];
    size_t end = first + 1;
    while (end < of->end && own->block[end] == block) {
      end++;
    }
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (size_t j = first; j < end; j++) {
      sum += weighted ? (double)own->flux[j] * values[j] : values[j];
    }
    sums[block] += sum;
    first = end;
  }
}

/* room->even = the means over the blocks, by every thread of a team. */
static void find_even(const clt_transport *transport, const workspace *room, const double *values, bool weighted) {
  const clt_block_storage *own = transport->storage;
#pragma omp for schedule(dynamic, 1)
  for (size_t k = 0; k < SLICES; k++) {
    const slice of = slice_of(transport, room, k);
    sum_blocks(own, &of, values, weighted, of.of_blocks);
  }
#pragma omp single
  fold_means(own, room->of_blocks, room->even);
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

/* Of a slice: out += C gain and partial = C' in, reading the columns once. */
static void pass_columns(const clt_transport *transport, int channel, const slice *of, const double *gain,
                         const double *in, double *out) {
  const size_t count = ((const clt_block_storage *)transport->storage)->count;
  const clt_pass_kernels *kernels = clt_pass_choose();
  memset(of->partial, 0, count * sizeof *of->partial);
  for (size_t first = of->first; first < of->end; first += PIECE) {
    const size_t length = of->end - first < PIECE ? of->end - first : PIECE;
    for (size_t b = 0; b < count; b += CLT_PLAIN_ROWS) {
      const size_t columns = count - b < CLT_PLAIN_ROWS ? count - b : CLT_PLAIN_ROWS;
      const float *column[CLT_PLAIN_ROWS];
      for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) { /* behind the last column, that column again */
        column[r] = column_of(transport, channel, r < columns ? b + r : count - 1) + first;
      }
      pass_piece(kernels, column, columns, length, gain + b, in + first, out + first, of->partial + b);
    }
  }
}

/* Of a slice: y = near x. */
static void apply_near(const clt_transport *transport, int channel, const slice *of, const double *x, double *y) {
  const clt_block_storage *own = transport->storage;
  const float *value = near_of(transport, channel);
  for (size_t i = of->first; i < of->end; i++) {
    double sum = 0;
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      sum += (double)value[e] * x[own->cell[e]];
    }
    y[i] = sum;
  }
}

/* Of a slice: x += near' y, from the rows that reach it. */
static void add_near_transposed(const clt_transport *transport, int channel, const slice *of, const double *y,
                                double *x) {
  const clt_block_storage *own = transport->storage;
  const float *value = near_of(transport, channel);
  const size_t first = of->first > own->reach ? of->first - own->reach : 0;
  const size_t end = transport->rows - of->end > own->reach ? of->end + own->reach : transport->rows;
  for (size_t i = first; i < end; i++) {
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      const size_t j = (size_t)own->cell[e];
      if (j >= of->first && j < of->end) {
        x[j] += (double)value[e] * y[i];
      }
    }
  }
}

/* e_b the mean of x over b by flux, u = W (x - P e), z = C' u:  y = near x + C e + P D^-1 z */
static void blocks_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  const clt_block_storage *own = transport->storage;
  workspace room = begin_turn(transport, channel);
#pragma omp parallel if (is_worth_sharing(transport))
  {
    find_even(transport, &room, x, true);
#pragma omp for schedule(dynamic, 1)
    for (size_t k = 0; k < SLICES; k++) {
      const slice of = slice_of(transport, &room, k);
      apply_near(transport, channel, &of, x, y);
      for (size_t j = of.first; j < of.end; j++) {
        room.cells[j] = (double)own->flux[j] * (x[j] - room.even[own->block[j]]);
      }
      pass_columns(transport, channel, &of, room.even, room.cells, y);
    }
#pragma omp single
    fold_means(own, room.partial, room.total);
#pragma omp for schedule(static)
    for (size_t i = 0; i < transport->rows; i++) {
      y[i] += room.total[own->block[i]];
    }
  }
  end_turn(transport, channel);
}

/* q = D^-1 P' y, p = C' y, v = C q, v_b the mean of v over b by flux:  x = near' y + W (P D^-1 p + v - P v_b) */
static void blocks_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  const clt_block_storage *own = transport->storage;
  workspace room = begin_turn(transport, channel);
#pragma omp parallel if (is_worth_sharing(transport))
  {
    find_even(transport, &room, y, false);
#pragma omp for schedule(dynamic, 1)
    for (size_t k = 0; k < SLICES; k++) {
      const slice of = slice_of(transport, &room, k);
      memset(room.cells + of.first, 0, (of.end - of.first) * sizeof *room.cells);
      pass_columns(transport, channel, &of, room.even, y, room.cells);
      sum_blocks(own, &of, room.cells, true, of.of_blocks);
    }
#pragma omp single
    {
      fold_means(own, room.partial, room.total);
      fold_means(own, room.of_blocks, room.even);
      for (size_t b = 0; b < own->count; b++) {
        room.total[b] -= room.even[b];
      }
    }
#pragma omp for schedule(dynamic, 1)
    for (size_t k = 0; k < SLICES; k++) {
      const slice of = slice_of(transport, &room, k);
      for (size_t j = of.first; j < of.end; j++) {
        x[j] = (double)own->flux[j] * (room.total[own->block[j]] + room.cells[j]);
      }
      add_near_transposed(transport, channel, &of, y, x);
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
  find_even(transport, &room, room.cells, true);
  for (size_t i = 0; i < transport->rows; i++) {
    const int32_t a = own->block[i];
    double entry = (double)own->flux[i] * own->inverse[a] * (2 * room.cells[i] - room.even[a]);
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
#pragma omp parallel for schedule(static) if (is_worth_sharing(transport))
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
