/* Factors of far light, whatever the bits of their numbers. */
#include "transport/leaf_rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { TERMS = CLT_LEAF_TERMS, MOST_BYTE = 127 };

static size_t row_of(const clt_leaf_rows *rows, int channel, size_t leaf) {
  return TERMS * ((rows->sets > 1 ? (size_t)channel : 0) * rows->leaves + leaf);
}

static size_t scales_of(const clt_leaf_rows *rows) {
  return rows->sets * TERMS * rows->leaves * (rows->bits == 8 ? clt_leaf_rows_blocks(rows->rank) : 1);
}

void clt_leaf_rows_choose(clt_leaf_rows *rows) {
  rows->plain = clt_plain_choose();
  rows->floats = clt_float_choose();
  rows->halves = clt_half_choose();
  rows->bytes = clt_byte_choose();
}

bool clt_leaf_rows_reserve(clt_leaf_rows *rows, int bits, size_t sets, size_t leaves, size_t rank) {
  *rows = (clt_leaf_rows){.bits = bits, .sets = sets, .leaves = leaves, .rank = rank};
  clt_leaf_rows_choose(rows);
  const size_t count = sets * TERMS * leaves;
  if (bits == 32) {
    rows->value = clt_alloc(count, rank * sizeof *rows->value);
    return rows->value != NULL;
  }
  rows->half = bits == 16 ? clt_alloc(count, rank * sizeof *rows->half) : NULL;
  rows->byte = bits == 8 ? clt_alloc(count, rank * sizeof *rows->byte) : NULL;
  rows->scale = clt_alloc(scales_of(rows), sizeof *rows->scale);
  return (rows->half != NULL || rows->byte != NULL) && rows->scale != NULL;
}

void clt_leaf_rows_finish(clt_leaf_rows *rows) {
  free(rows->value);
  free(rows->half);
  free(rows->byte);
  free(rows->scale);
  *rows = (clt_leaf_rows){0};
}

static float largest_of(const float *values, size_t count) {
  float largest = 0;
  for (size_t k = 0; k < count; k++) {
    largest = fmaxf(largest, fabsf(values[k]));
  }
  return largest;
}

static void pack_half(const float *row, size_t rank, uint16_t *code, float *scale) {
  int exponent = 0;
  frexpf(largest_of(row, rank), &exponent);
  *scale = ldexpf(1, exponent - 15 > -126 ? exponent - 15 : -126);
  for (size_t k = 0; k < rank; k++) {
    code[k] = clt_half_code(row[k] / *scale);
  }
}

static void pack_bytes(const float *row, size_t rank, int8_t *code, float *scale) {
  for (size_t first = 0; first < rank; first += CLT_BLOCK) {
    const size_t count = rank - first < CLT_BLOCK ? rank - first : CLT_BLOCK;
    const float block = fmaxf(largest_of(row + first, count) / MOST_BYTE, 0x1p-126f);
    scale[first / CLT_BLOCK] = block;
    for (size_t k = first; k < first + count; k++) {
      code[k] = (int8_t)lrintf(row[k] / block);
    }
  }
}

bool clt_leaf_rows_pack(const clt_leaf_rows *rows, int bits, clt_leaf_rows *out) {
  if (!clt_leaf_rows_reserve(out, bits, rows->sets, rows->leaves, rows->rank)) {
    return false;
  }
  const size_t rank = rows->rank;
  for (size_t row = 0; row < rows->sets * TERMS * rows->leaves; row++) {
    if (bits == 16) {
      pack_half(rows->value + row * rank, rank, out->half + row * rank, out->scale + row);
    } else {
      pack_bytes(rows->value + row * rank, rank, out->byte + row * rank, out->scale + row * clt_leaf_rows_blocks(rank));
    }
  }
  return true;
}

size_t clt_leaf_rows_bytes(const clt_leaf_rows *rows) {
  const size_t codes = rows->sets * TERMS * rows->leaves * rows->rank * (size_t)rows->bits / 8;
  return codes + (rows->scale != NULL ? scales_of(rows) * sizeof *rows->scale : 0);
}

/* The four rows of a leaf as kernels take them. */
typedef struct leaf {
  const float *value[TERMS];
  const uint16_t *half[TERMS];
  const int8_t *byte[TERMS];
  const float *scale[TERMS];
} leaf;

/* Asks memory for the rows of a leaf to come, into the second cache. */
static void foresee(const leaf *of, const clt_leaf_rows *rows) {
  enum { AHEAD = 8 /* leaves */, LINE = 64, SECOND = 2 };
  const void *plain = of->value[0], *half = of->half[0], *byte = of->byte[0];
  const char *at = plain != NULL ? plain : half != NULL ? half : byte;
  const size_t bytes = TERMS * rows->rank * (size_t)rows->bits / 8;
  for (size_t k = 0; k < bytes; k += LINE) {
    __builtin_prefetch(at + AHEAD * bytes + k, 0, SECOND);
  }
}

static leaf leaf_of(const clt_leaf_rows *rows, int channel, size_t at) {
  const size_t first = row_of(rows, channel, at), blocks = clt_leaf_rows_blocks(rows->rank);
  leaf of = {{0}, {0}, {0}, {0}};
  for (size_t t = 0; t < TERMS; t++) {
    const size_t row = first + t;
    of.value[t] = rows->bits == 32 ? rows->value + row * rows->rank : NULL;
    of.half[t] = rows->bits == 16 ? rows->half + row * rows->rank : NULL;
    of.byte[t] = rows->bits == 8 ? rows->byte + row * rows->rank : NULL;
    of.scale[t] = rows->bits == 8 ? rows->scale + row * blocks : rows->bits == 16 ? rows->scale + row : NULL;
  }
  foresee(&of, rows);
  return of;
}

void clt_leaf_rows_add(const clt_leaf_rows *rows, int channel, size_t at, const float term[TERMS], size_t count,
                       float *out) {
  const leaf of = leaf_of(rows, channel, at);
  if (rows->bits == 32) {
    rows->floats->add(of.value, term, count, out);
  } else if (rows->bits == 16) {
    const float scaled[TERMS] = {term[0] * *of.scale[0], term[1] * *of.scale[1], term[2] * *of.scale[2],
                                 term[3] * *of.scale[3]};
    rows->halves->add(of.half, scaled, count, out);
  } else {
    rows->bytes->add(of.byte, of.scale, term, count, out);
  }
}

void clt_leaf_rows_dot(const clt_leaf_rows *rows, int channel, size_t at, const float *in, size_t count,
                       float term[TERMS]) {
  const leaf of = leaf_of(rows, channel, at);
  if (rows->bits == 32) {
    rows->floats->dot(of.value, in, count, term);
  } else if (rows->bits == 16) {
    rows->halves->dots(of.half, in, count, term);
    for (size_t t = 0; t < TERMS; t++) {
      term[t] *= *of.scale[t];
    }
  } else {
    rows->bytes->dots(of.byte, of.scale, in, count, term);
  }
}

void clt_leaf_rows_add_wide(const clt_leaf_rows *rows, int channel, size_t at, const double term[TERMS], double *out) {
  rows->plain->add_float(leaf_of(rows, channel, at).value, term, rows->rank, out);
}

void clt_leaf_rows_dot_wide(const clt_leaf_rows *rows, int channel, size_t at, const double *in, double term[TERMS]) {
  rows->plain->dot_float(leaf_of(rows, channel, at).value, in, rows->rank, term);
}

void clt_leaf_rows_read(const clt_leaf_rows *rows, int channel, size_t at, float *out) {
  const leaf of = leaf_of(rows, channel, at);
  for (size_t t = 0; t < TERMS; t++) {
    for (size_t k = 0; k < rows->rank; k++) {
      out[t * rows->rank + k] = rows->bits == 32   ? of.value[t][k]
                                : rows->bits == 16 ? *of.scale[t] * clt_half_value(of.half[t][k])
                                                   : of.scale[t][k / CLT_BLOCK] * (float)of.byte[t][k];
    }
  }
}
