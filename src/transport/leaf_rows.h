/* A factor of far light in hierarchy storage (transport/hierarchy.h): four rows of R numbers for every leaf, each
 * channel's own or the same for all of them, as floats or as codes of fewer bits.
 *
 * A code of 16 bits is IEEE half precision, with a power of two for every row that brings its largest to 2^14..2^15; of
 * 8 bits an integer -127..127, with a scale for every 32 neighbours of a row. */
#ifndef CLT_TRANSPORT_LEAF_ROWS_H
#define CLT_TRANSPORT_LEAF_ROWS_H

#include "counterlight/status.h"
#include "transport/kernels.h"

enum { CLT_LEAF_TERMS = 4, CLT_RANK_STEP = 8 /* columns that kernels take at once */ };

typedef struct clt_leaf_rows {
  int bits;    /* 32, 16 or 8 */
  size_t sets; /* of 4 L rows: one for each channel, or one for all */
  size_t leaves, rank;
  float *value;   /* sets x 4L x R, or NULL with codes: */
  uint16_t *half; /* the same */
  int8_t *byte;   /* the same */
  float *scale;   /* of 16 bits sets x 4L, of 8 bits sets x 4L x clt_leaf_rows_blocks */
  const clt_plain_kernels *plain;
  const clt_float_kernels *floats;
  const clt_half_kernels *halves;
  const clt_byte_kernels *bytes;
} clt_leaf_rows;

static inline size_t clt_leaf_rows_blocks(size_t rank) {
  return (rank + CLT_BLOCK - 1) / CLT_BLOCK;
}

/* Takes the kernels that run here. */
void clt_leaf_rows_choose(clt_leaf_rows *rows);
/* Room for rows, zeros. false: no memory; the caller finishes them either way. */
bool clt_leaf_rows_reserve(clt_leaf_rows *rows, int bits, size_t sets, size_t leaves, size_t rank);
void clt_leaf_rows_finish(clt_leaf_rows *rows);
/* The same rows, of floats, in codes of 16 or 8 bits; false: no memory. The caller finishes out either way. */
bool clt_leaf_rows_pack(const clt_leaf_rows *rows, int bits, clt_leaf_rows *out);
/* What they take. */
size_t clt_leaf_rows_bytes(const clt_leaf_rows *rows);

/* out_k += the sum over the terms of a leaf of term_t row_tk, k < count; in float. */
void clt_leaf_rows_add(const clt_leaf_rows *rows, int channel, size_t leaf, const float term[CLT_LEAF_TERMS],
                       size_t count, float *out);
/* term_t = the sum over k < count of row_tk in_k. */
void clt_leaf_rows_dot(const clt_leaf_rows *rows, int channel, size_t leaf, const float *in, size_t count,
                       float term[CLT_LEAF_TERMS]);
/* Both over all columns, in double; rows of floats alone. */
void clt_leaf_rows_add_wide(const clt_leaf_rows *rows, int channel, size_t leaf, const double term[CLT_LEAF_TERMS],
                            double *out);
void clt_leaf_rows_dot_wide(const clt_leaf_rows *rows, int channel, size_t leaf, const double *in,
                            double term[CLT_LEAF_TERMS]);
/* The four rows of a leaf, 4 x R. */
void clt_leaf_rows_read(const clt_leaf_rows *rows, int channel, size_t leaf, float *out);

#endif
