/* Products with blocks storage. */
#include "transport/blocks.h"

#include <stdbool.h>
#include <string.h>

#include "base/turns.h"
#include "transport/kernels.h"

/* A product walks down slices of cells in pieces that stay in the cache while the columns pass. */
enum { SLICES = CLT_SLICES, PIECE = 8192 };
enum { WORTH_SHARING = 16384 }; /* values of the columns from which threads pay */

/* scratch: twice SLICES x K partial sums, twice K sums */
typedef struct workspace {
  double *partial, *of_blocks; /* SLICES x K: of the columns, and over the blocks */
  double *total, *even;        /* K: their sums */
} workspace;

/* The cells first <= j < end. */
typedef struct slice {
  size_t number, first, end;
  double *partial, *of_blocks; /* K, its own */
} slice;

size_t clt_block_scratch(size_t count) {
  return 2 * (SLICES + 1) * count;
}

static workspace begin_turn(const clt_transport *transport, int channel) {
  clt_block_storage *own = transport->storage;
  pthread_mutex_lock(&own->turn[channel]);
  double *scratch = own->scratch + (size_t)channel * clt_block_scratch(own->count);
  return (workspace){.partial = scratch,
                     .of_blocks = scratch + SLICES * own->count,
                     .total = scratch + 2 * SLICES * own->count,
                     .even = scratch + (2 * SLICES + 1) * own->count};
}

static void end_turn(const clt_transport *transport, int channel) {
  clt_block_storage *own = transport->storage;
  pthread_mutex_unlock(&own->turn[channel]);
}

static slice slice_of(const clt_transport *transport, const workspace *room, size_t number) {
  const clt_block_storage *own = transport->storage;
  return (slice){.number = number,
                 .first = clt_slice_first(transport->cols, number),
                 .end = clt_slice_first(transport->cols, number + 1),
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

static const float *own_of(const clt_transport *transport, int channel) {
  const clt_block_storage *own = transport->storage;
  return own->own + (size_t)channel * transport->cols;
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

/* The sums of a slice's values over every block, weighted by the flux where it is asked for. */
static void sum_blocks(const clt_block_storage *own, const slice *of, const double *values, bool weighted,
                       double *sums) {
  memset(sums, 0, own->count * sizeof *sums);
  for (size_t k = own->first_run[of->number]; k < own->first_run[of->number + 1]; k++) {
    const int32_t end = own->run[k + 1].first;
    double sum = 0;
#pragma omp simd reduction(+ : sum)
    for (int32_t j = own->run[k].first; j < end; j++) {
      sum += weighted ? (double)own->flux[j] * values[j] : values[j];
    }
    sums[own->run[k].block] += sum;
  }
}

/* The loops of a product. */
typedef struct loops {
  clt_turns even, columns, end, near[2];
} loops;

static loops begin_loops(void) {
  const clt_turns slices = clt_turns_of(SLICES);
  loops all = {.even = slices, .columns = slices, .end = slices};
  clt_near_stream_turns(all.near);
  return all;
}

/* room->even = the means over the blocks, by every thread of a team. */
static void find_even(const clt_transport *transport, const workspace *room, clt_turns *turns, const double *values,
                      bool weighted) {
  const clt_block_storage *own = transport->storage;
  size_t turn = 0;
  while (clt_turns_next(turns, &turn)) {
    const slice of = slice_of(transport, room, turn);
    sum_blocks(own, &of, values, weighted, of.of_blocks);
  }
#pragma omp barrier
#pragma omp single
  fold_means(own, room->of_blocks, room->even);
}

/* Up to four columns: out += C gain and partial += C' in. */
static void pass_four(const clt_pass_kernels *kernels, const float *const column[CLT_PLAIN_ROWS], size_t columns,
                      size_t count, const double *gain, const double *in, double *out, double *partial) {
  double sum[CLT_PLAIN_ROWS], factor[CLT_PLAIN_ROWS] = {0};
  memcpy(factor, gain, columns * sizeof *factor);
  kernels->pass(column, factor, in, count, sum, out);
  for (size_t r = 0; r < columns; r++) {
    partial[r] += sum[r];
  }
}

/* Of a piece: out += C gain and partial += C' in, reading the columns once. in and out begin with the piece. */
static void pass_columns(const clt_transport *transport, int channel, const slice *piece, const double *gain,
                         const double *in, double *out) {
  const size_t count = ((const clt_block_storage *)transport->storage)->count;
  const clt_pass_kernels *kernels = clt_pass_choose();
  for (size_t b = 0; b < count; b += CLT_PLAIN_ROWS) {
    const size_t columns = count - b < CLT_PLAIN_ROWS ? count - b : CLT_PLAIN_ROWS;
    const float *column[CLT_PLAIN_ROWS];
    for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) { /* behind the last column, that column again */
      column[r] = column_of(transport, channel, r < columns ? b + r : count - 1) + piece->first;
    }
    pass_four(kernels, column, columns, piece->end - piece->first, gain + b, in, out, piece->partial + b);
  }
}

/* The next piece of a slice behind `first`. */
static slice piece_of(const slice *of, size_t first) {
  slice piece = *of;
  piece.first = first;
  piece.end = of->end - first < PIECE ? of->end : first + PIECE;
  return piece;
}

/* Of a piece: y = own x, and its uneven = W (x - P even). *run: that of its first cell, and then of the next piece's.
 */
static void begin_piece(const clt_block_storage *own, const float *near, const slice *piece, size_t *run,
                        const double *even, const double *x, double *y, double *uneven) {
  for (size_t first = piece->first; first < piece->end;) {
    const double mean = even[own->run[*run].block];
    const size_t next = (size_t)own->run[*run + 1].first, end = next < piece->end ? next : piece->end;
    for (size_t j = first; j < end; j++) {
      y[j] = (double)near[j] * x[j];
      uneven[j - piece->first] = (double)own->flux[j] * (x[j] - mean);
    }
    *run += end == next;
    first = end;
  }
}

/* Of a slice: y = near x + C even, partial = C' W (x - P even). */
static void apply_slice(const clt_transport *transport, int channel, const slice *of, const double *even,
                        const double *x, double *y) {
  const clt_block_storage *own = transport->storage;
  double uneven[PIECE];
  size_t run = own->first_run[of->number];
  memset(of->partial, 0, own->count * sizeof *of->partial);
  for (size_t first = of->first; first < of->end; first += PIECE) {
    const slice piece = piece_of(of, first);
    begin_piece(own, own_of(transport, channel), &piece, &run, even, x, y, uneven);
    pass_columns(transport, channel, &piece, even, uneven, y + first);
  }
  clt_near_stream_add(&own->near, channel, of->number, x, y);
}

/* Of a slice: v = C even, partial = C' y. */
static void apply_slice_transposed(const clt_transport *transport, int channel, const slice *of, const double *even,
                                   const double *y, double *v) {
  const clt_block_storage *own = transport->storage;
  memset(of->partial, 0, own->count * sizeof *of->partial);
  memset(v + of->first, 0, (of->end - of->first) * sizeof *v);
  for (size_t first = of->first; first < of->end; first += PIECE) {
    const slice piece = piece_of(of, first);
    pass_columns(transport, channel, &piece, even, y + first, v + first);
  }
}

/* Of a slice: y += P total. */
static void add_total(const clt_block_storage *own, const slice *of, const double *total, double *y) {
  for (size_t k = own->first_run[of->number]; k < own->first_run[of->number + 1]; k++) {
    const double here = total[own->run[k].block];
    for (int32_t j = own->run[k].first; j < own->run[k + 1].first; j++) {
      y[j] += here;
    }
  }
}

/* Of a slice: x = own y + W (P total + x). */
static void end_slice(const clt_block_storage *own, const float *near, const slice *of, const double *total,
                      const double *y, double *x) {
  for (size_t k = own->first_run[of->number]; k < own->first_run[of->number + 1]; k++) {
    const double here = total[own->run[k].block];
    for (int32_t j = own->run[k].first; j < own->run[k + 1].first; j++) {
      x[j] = (double)near[j] * y[j] + (double)own->flux[j] * (here + x[j]);
    }
  }
}

/* e_b the mean of x over b by flux, u = W (x - P e), z = C' u:  y = near x + C e + P D^-1 z */
static void blocks_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  const clt_block_storage *own = transport->storage;
  workspace room = begin_turn(transport, channel);
  loops all = begin_loops();
#pragma omp parallel if (is_worth_sharing(transport))
  {
    size_t turn = 0;
    find_even(transport, &room, &all.even, x, true);
    while (clt_turns_next(&all.columns, &turn)) {
      const slice of = slice_of(transport, &room, turn);
      apply_slice(transport, channel, &of, room.even, x, y);
    }
#pragma omp barrier
#pragma omp single
    fold_means(own, room.partial, room.total);
    while (clt_turns_next(&all.end, &turn)) {
      const slice of = slice_of(transport, &room, turn);
      add_total(own, &of, room.total, y);
    }
  }
  end_turn(transport, channel);
}

/* q = D^-1 P' y, p = C' y, v = C q, v_b the mean of v over b by flux:  x = near' y + W (P D^-1 p + v - P v_b) */
static void blocks_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  const clt_block_storage *own = transport->storage;
  workspace room = begin_turn(transport, channel);
  loops all = begin_loops();
#pragma omp parallel if (is_worth_sharing(transport))
  {
    size_t turn = 0;
    find_even(transport, &room, &all.even, y, false);
    while (clt_turns_next(&all.columns, &turn)) {
      const slice of = slice_of(transport, &room, turn);
      apply_slice_transposed(transport, channel, &of, room.even, y, x);
      sum_blocks(own, &of, x, true, of.of_blocks);
    }
#pragma omp barrier
#pragma omp single
    {
      fold_means(own, room.partial, room.total);
      fold_means(own, room.of_blocks, room.even);
      for (size_t b = 0; b < own->count; b++) {
        room.total[b] -= room.even[b];
      }
    }
    while (clt_turns_next(&all.end, &turn)) {
      const slice of = slice_of(transport, &room, turn);
      end_slice(own, own_of(transport, channel), &of, room.total, y, x);
    }
#pragma omp barrier
    clt_near_stream_add_transposed(&own->near, channel, all.near, y, x);
  }
  end_turn(transport, channel);
}

/* far_ii = w_i (2 C_ia - mean of C_a over a) / D_a */
static void blocks_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  const clt_block_storage *own = transport->storage;
  const float *value = near_of(transport, channel);
  workspace room = begin_turn(transport, channel);
  for (size_t i = 0; i < transport->cols; i++) {
    diagonal[i] = (double)column_of(transport, channel, (size_t)own->block[i])[i];
  }
  loops all = begin_loops();
#pragma omp parallel if (is_worth_sharing(transport))
  find_even(transport, &room, &all.even, diagonal, true);
  for (size_t i = 0; i < transport->rows; i++) {
    const int32_t a = own->block[i];
    double entry = (double)own->flux[i] * own->inverse[a] * (2 * diagonal[i] - room.even[a]);
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
  const size_t per_cell = sizeof *own->flux + sizeof *own->own + own->count * sizeof *own->column;
  const size_t runs = own->first_run[CLT_SLICES] * sizeof *own->run;
  return (size_t)transport->channels * (clt_near_stream_bytes(&own->near) + runs + transport->cols * per_cell);
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
