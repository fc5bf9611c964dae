/* A room in closed form: M = f g' + g f' with f bilinear and g even in every block, so that far light is what blocks
 * tell (transport/blocks.h). */
#include <stdlib.h>

#include "base/memory.h"
#include "tradeoff/bench/bench.h"

typedef struct room {
  int width, height, blocks;
  size_t cells;
  int32_t *block, *cell;
  int64_t *start;
  float *flux, *column, *value, *even; /* even: f */
  double *sum;                         /* of f over a block, and its cells */
} room;

static double draw(unsigned *state) {
  *state = *state * 1664525u + 1013904223u;
  return (double)(*state >> 8) / 0x1p24;
}

/* Blocks are bands across the grid, of whole rows of tiles. */
static void fill_cells(room *own) {
  for (size_t j = 0; j < own->cells; j++) {
    const int x = (int)(j % (size_t)own->width), y = (int)(j / (size_t)own->width);
    const int half = own->blocks > 1 && 2 * x >= own->width, bands = (own->blocks + 1) / 2;
    const int block = 2 * (int)((long)y * bands / own->height) + half;
    own->block[j] = block < own->blocks ? block : own->blocks - 1;
    own->flux[j] = 1;
    own->even[j] = (float)(0.7 + 0.4 * x / own->width - 0.2 * y / own->height);
    own->sum[own->block[j]] += (double)own->even[j];
    own->sum[own->blocks + own->block[j]] += 1;
    own->start[j + 1] = own->start[j] + 1 + (x + 1 < own->width);
    own->cell[own->start[j]] = (int32_t)j;
    if (x + 1 < own->width) {
      own->cell[own->start[j] + 1] = (int32_t)j + 1;
    }
  }
}

/* Far light is about half as much as near light where every cell is driven. */
static void fill_channel(room *own, size_t channel, unsigned *state) {
  const int64_t entries = own->start[own->cells];
  double level[256];
  for (int b = 0; b < own->blocks; b++) {
    level[b] = (0.2 + 0.2 * draw(state)) / (double)own->cells;
  }
  for (int b = 0; b < own->blocks; b++) {
    float *column = own->column + (channel * (size_t)own->blocks + (size_t)b) * own->cells;
    for (size_t i = 0; i < own->cells; i++) {
      column[i] =
          (float)((double)own->even[i] * level[b] * own->sum[own->blocks + b] + level[own->block[i]] * own->sum[b]);
    }
  }
  for (size_t i = 0; i < own->cells; i++) {
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      own->value[(int64_t)channel * entries + e] =
          own->cell[e] == (int32_t)i ? (float)(0.9 + 0.2 * draw(state)) : (float)(0.02 * draw(state));
    }
  }
}

clt_status clt_bench_room(int width, int height, int blocks, unsigned seed, clt_transport **out, clt_error *error) {
  enum { CHANNELS = 3, BLOCKS_MOST = 256 };
  *out = NULL;
  if (width < 1 || height < 1 || width > CLT_GRID_SIDE_MAX || height > CLT_GRID_SIDE_MAX || blocks < 1 ||
      blocks > BLOCKS_MOST || blocks > height) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "a room of %d x %d cells and %d blocks; blocks are 1..%d and at most the rows", width, height,
                    blocks, BLOCKS_MOST);
  }
  room own = {.width = width, .height = height, .blocks = blocks, .cells = (size_t)width * (size_t)height};
  unsigned state = seed;
  own.block = clt_alloc(own.cells, sizeof *own.block);
  own.cell = clt_alloc(2 * own.cells, sizeof *own.cell);
  own.start = clt_alloc(own.cells + 1, sizeof *own.start);
  own.flux = clt_alloc(2 * own.cells, sizeof *own.flux);
  own.even = own.flux + own.cells;
  own.column = clt_alloc(own.cells * (size_t)blocks, CHANNELS * sizeof *own.column);
  own.value = clt_alloc(2 * own.cells, CHANNELS * sizeof *own.value);
  own.sum = clt_alloc(2 * (size_t)blocks, sizeof *own.sum);
  clt_status status = CLT_OK;
  if (own.block == NULL || own.cell == NULL || own.start == NULL || own.flux == NULL || own.column == NULL ||
      own.value == NULL || own.sum == NULL) {
    status = clt_fail(error, CLT_FAILED, "no memory for a room of %zu cells", own.cells);
  } else {
    fill_cells(&own);
    for (size_t c = 0; c < CHANNELS; c++) {
      fill_channel(&own, c, &state);
    }
    const clt_block_parts parts = {blocks, own.block, own.flux, own.column, own.start, own.cell, own.value};
    status = clt_transport_create_blocks(width, height, CHANNELS, &parts, out, error);
  }
  free(own.block);
  free(own.cell);
  free(own.start);
  free(own.flux);
  free(own.column);
  free(own.value);
  free(own.sum);
  return status;
}
