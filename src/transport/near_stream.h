/* Near light as products read it: a stream of entries with a cell's own light apart, instead of rows whose lengths
 * differ from cell to cell and are foreseen by no processor.
 *
 * Entries stand slice by slice of the rows, in a slice by how far apart the two cells are, and then by rows, so that
 * sums of one cell do not follow each other. */
#ifndef CLT_TRANSPORT_NEAR_STREAM_H
#define CLT_TRANSPORT_NEAR_STREAM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/turns.h"
#include "counterlight/status.h"

enum { CLT_SLICES = 16 }; /* of the cells; fixed, so that sums do not depend on the number of threads */

typedef struct clt_near_stream {
  size_t cells, entries;
  size_t first[CLT_SLICES + 1]; /* of each slice's entries */
  int32_t *row, *cell;
  float *value; /* channels x entries */
  bool apart;   /* entries of two slices of even numbers, or two of odd ones, have no cell in common */
} clt_near_stream;

static inline size_t clt_slice_first(size_t cells, size_t slice) {
  return cells * slice / CLT_SLICES;
}

/* From compressed rows (start: cells + 1; cell and value as in clt_block_parts). own, channels x cells, takes the first
 * entry of a row on the diagonal, 0 where there is none; NULL leaves these in the stream. The caller finishes near,
 * also after a failure (CLT_FAILED: no memory). */
clt_status clt_near_stream_make(size_t cells, size_t channels, const int64_t *start, const int32_t *cell,
                                const float *value, float *own, clt_near_stream *near, clt_error *error);
void clt_near_stream_finish(clt_near_stream *near);
/* What a product of one channel reads. */
size_t clt_near_stream_bytes(const clt_near_stream *near);

/* y += near x, of the rows of a slice. */
void clt_near_stream_add(const clt_near_stream *near, int channel, size_t slice, const double *x, double *y);
/* x += near' y, by every thread of a team, in two loops; the team meets before it returns. */
void clt_near_stream_turns(clt_turns turns[2]);
void clt_near_stream_add_transposed(const clt_near_stream *near, int channel, clt_turns turns[2], const double *y,
                                    double *x);

#endif
