/* A room whose transport is known in closed form and smooth from afar: T = near + (f g' + g f') W, g even in every
 * block, f bilinear over the grid, so that blocks determine it and leaves hold it exactly. Any flux W. */
#ifndef CLT_TESTS_TRANSPORT_SMOOTH_H
#define CLT_TESTS_TRANSPORT_SMOOTH_H

#include "cases.h"

typedef struct smooth_room {
  clt_transport *blocks;
  double *entries; /* channels x N x N */
} smooth_room;

enum { SMOOTH_BLOCKS = 6 };

/* Blocks are strips of unlike width, in two tiers; block 0 has no flux where dead. */
static inline int smooth_block(int cell, int width, int height) {
  const int x = cell % width, y = cell / width;
  return (x < width / 4 ? 0 : x < width / 2 ? 1 : 2) + (y < height / 2 ? 0 : 3);
}

typedef struct smooth_arrays {
  int32_t *block, *cell;
  int64_t *start;
  float *flux, *column, *value;
} smooth_arrays;

/* far: how much light comes from afar, relative to a cell's own, if all cells are driven. */
static inline void fill_smooth(const size_case *size, int c, double far, double noise, uint64_t *state,
                               smooth_arrays *own, double *entries) {
  const int cells = size->width * size->height;
  const int64_t near = own->start[cells];
  double level[SMOOTH_BLOCKS], slope[4];
  for (int b = 0; b < SMOOTH_BLOCKS; b++) {
    level[b] = far * (0.3 + test_random(state)) / cells;
  }
  for (int k = 0; k < 4; k++) {
    slope[k] = 0.3 * (test_random(state) - 0.5);
  }
  for (int i = 0; i < cells; i++) {
    const double x = (double)(i % size->width) / size->width, y = (double)(i / size->width) / size->height;
    const double f = 0.6 + slope[0] * x + slope[1] * y + slope[2] * x * y, g = level[own->block[i]];
    for (int j = 0; j < cells; j++) {
      const double xj = (double)(j % size->width) / size->width, yj = (double)(j / size->width) / size->height;
      const double fj = 0.6 + slope[0] * xj + slope[1] * yj + slope[2] * xj * yj;
      const bool dead = own->flux[i] == 0 || own->flux[j] == 0;
      entries[(size_t)i * (size_t)cells + (size_t)j] =
          dead ? 0 : (f * level[own->block[j]] + g * fj) * (double)own->flux[j];
      own->column[((size_t)c * SMOOTH_BLOCKS + (size_t)own->block[j]) * (size_t)cells + (size_t)i] +=
          (float)entries[(size_t)i * (size_t)cells + (size_t)j];
    }
    for (int b = 0; b < SMOOTH_BLOCKS; b++) {
      own->column[((size_t)c * SMOOTH_BLOCKS + (size_t)b) * (size_t)cells + (size_t)i] +=
          (float)(noise * (test_random(state) + test_random(state) - 1));
    }
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      const float value =
          own->cell[e] == i ? (float)(0.8 + 0.4 * test_random(state)) : (float)(0.02 * test_random(state));
      own->value[c * near + e] = value;
      entries[(size_t)i * (size_t)cells + (size_t)own->cell[e]] += (double)value;
    }
  }
}

/* Each cell's own light and that of its right neighbour. */
static inline smooth_room make_smooth_room(const size_case *size, double far, double noise, bool dead,
                                           uint64_t *state) {
  const size_t cells = (size_t)size->width * (size_t)size->height, channels = (size_t)size->channels;
  smooth_arrays own = {calloc(cells, sizeof(int32_t)),
                       calloc(2 * cells, sizeof(int32_t)),
                       calloc(cells + 1, sizeof(int64_t)),
                       calloc(cells, sizeof(float)),
                       calloc(channels * SMOOTH_BLOCKS * cells, sizeof(float)),
                       calloc(2 * channels * cells, sizeof(float))};
  smooth_room room = {.entries = calloc(channels * cells * cells, sizeof(double))};
  for (size_t j = 0; j < cells; j++) {
    own.block[j] = smooth_block((int)j, size->width, size->height);
    own.flux[j] = dead && own.block[j] == 0 ? 0 : (float)(0.7 + 0.6 * test_random(state));
    int64_t e = own.start[j];
    own.cell[e++] = (int32_t)j;
    if (j % (size_t)size->width + 1 < (size_t)size->width) {
      own.cell[e++] = (int32_t)j + 1;
    }
    own.start[j + 1] = e;
  }
  for (int c = 0; c < size->channels; c++) {
    fill_smooth(size, c, far, noise, state, &own, room.entries + (size_t)c * cells * cells);
  }
  const clt_block_parts parts = {SMOOTH_BLOCKS, own.block, own.flux, own.column, own.start, own.cell, own.value};
  clt_error error = {0};
  assert_ok(clt_transport_create_blocks(size->width, size->height, size->channels, &parts, &room.blocks, &error),
            error);
  free(own.block);
  free(own.cell);
  free(own.start);
  free(own.flux);
  free(own.column);
  free(own.value);
  return room;
}

static inline void finish_smooth_room(smooth_room *room) {
  clt_transport_destroy(room->blocks);
  free(room->entries);
}

static inline clt_transport *hierarchy_of(const clt_transport *blocks, double tolerance) {
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_hierarchy(blocks, tolerance, &made, &error), error);
  assert_string_equal(clt_transport_describe(made).storage, "hierarchy");
  return made;
}

/* For the lists of storages that other tests go through. */
static inline known_transport random_hierarchy(const size_case *size, uint64_t *state) {
  smooth_room room = make_smooth_room(size, 0.5, 0, false, state);
  known_transport known = {hierarchy_of(room.blocks, 1e-6), room.entries};
  clt_transport_destroy(room.blocks);
  return known;
}

#endif
