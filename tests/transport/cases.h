/* Random transports with their entries in double, made without the code under test. */
#ifndef CLT_TESTS_TRANSPORT_CASES_H
#define CLT_TESTS_TRANSPORT_CASES_H

#include "counterlight/transport.h"
#include "support.h"

typedef struct size_case {
  int width, height, channels;
  size_t rows;
} size_case;

/* Odd sizes; rows differ from cells in some; 48 x 47 is above the size from which threads share the work. */
static const size_case size_cases[] = {{1, 1, 1, 1},     {5, 3, 3, 15},   {7, 13, 1, 91},   {33, 17, 3, 561},
                                       {33, 17, 1, 400}, {9, 10, 2, 133}, {48, 47, 1, 2256}};
enum { SIZE_CASES = sizeof size_cases / sizeof size_cases[0] };

/* A transport and its entries, channels x rows x cols; reference is freed by the caller. */
typedef struct known_transport {
  clt_transport *transport;
  double *reference;
} known_transport;

static inline double *random_vector(size_t count, uint64_t *state) {
  double *vector = malloc(count * sizeof *vector);
  for (size_t i = 0; i < count; i++) {
    vector[i] = 2 * test_random(state) - 1;
  }
  return vector;
}

static inline known_transport random_dense(const size_case *size, uint64_t *state) {
  clt_error error;
  known_transport known = {0};
  assert_ok(clt_transport_create_dense(size->width, size->height, size->channels, size->rows, &known.transport, &error),
            error);
  size_t cols = (size_t)size->width * (size_t)size->height, count = size->rows * cols;
  known.reference = malloc((size_t)size->channels * count * sizeof *known.reference);
  for (int c = 0; c < size->channels; c++) {
    float *entries = clt_transport_entries(known.transport, c);
    for (size_t k = 0; k < count; k++) {
      entries[k] = (float)(test_random(state) - 0.005);
      known.reference[(size_t)c * count + k] = (double)entries[k];
    }
  }
  return known;
}

/* The block of a node by walking over every level and block, in the order that the header states. */
typedef struct block {
  int left, top, right, bottom; /* right and bottom not included */
} block;

static inline block find_block(int width, int height, int32_t node) {
  for (int side = 1;; side *= 2) {
    for (int top = 0; top < height; top += side) {
      for (int left = 0; left < width; left += side) {
        if (node-- == 0) {
          return (block){left, top, left + side < width ? left + side : width,
                         top + side < height ? top + side : height};
        }
      }
    }
    assert_true(side < width || side < height);
  }
}

/* Adds value to the entries of one row under a node's block. */
static inline void add_block(const size_case *size, int32_t node, double value, double *row) {
  block b = find_block(size->width, size->height, node);
  for (int y = b.top; y < b.bottom; y++) {
    for (int x = b.left; x < b.right; x++) {
      row[y * size->width + x] += value;
    }
  }
}

/* Rows of 0..11 entries at random nodes of all levels, the same node now and then twice. */
static inline known_transport random_tree(const size_case *size, uint64_t *state) {
  enum { MOST = 12 };
  clt_error error;
  known_transport known = {0};
  const int32_t nodes = clt_tree_nodes(size->width, size->height);
  const size_t cols = (size_t)size->width * (size_t)size->height, channels = (size_t)size->channels;
  int64_t *start = calloc(size->rows + 1, sizeof *start);
  int32_t *node = calloc(size->rows * MOST, sizeof *node);
  for (size_t i = 0; i < size->rows; i++) {
    start[i + 1] = start[i] + (int64_t)(MOST * test_random(state));
    for (int64_t e = start[i]; e < start[i + 1]; e++) {
      node[e] = (int32_t)(nodes * test_random(state));
    }
  }
  const size_t entries = (size_t)start[size->rows];
  float *value = calloc(entries * channels + 1, sizeof *value);
  known.reference = calloc(channels * size->rows * cols, sizeof *known.reference);
  for (size_t c = 0; c < channels; c++) {
    for (size_t i = 0; i < size->rows; i++) {
      for (int64_t e = start[i]; e < start[i + 1]; e++) {
        float v = value[c * entries + (size_t)e] = (float)(test_random(state) - 0.005);
        add_block(size, node[e], (double)v, known.reference + (c * size->rows + i) * cols);
      }
    }
  }
  assert_ok(clt_transport_create_tree(size->width, size->height, size->channels, size->rows, start, node, value,
                                      &known.transport, &error),
            error);
  free(start);
  free(node);
  free(value);
  return known;
}

typedef known_transport (*make_known)(const size_case *size, uint64_t *state);

static inline void finish_known(known_transport *known) {
  clt_transport_destroy(known->transport);
  free(known->reference);
}

#endif
