/* Hierarchy storage from inside: near light cell by cell, far light between the leaves of a block tree.
 *
 * The grid is cut in halves again and again until light from afar varies bilinearly over each leaf, as well as its
 * noise lets one tell. Over a leaf with the coordinates -1 < u, v < 1 stand the four functions 1, u, v, u v; P (N x 4L)
 * holds them for all L leaves. With a rank R of far light that a few blocks determine,
 *
 *   T = diag(own) + near + diag(scale) P left core right' P' diag(gather) + flood 1' / N,
 *
 * left and right 4L x R. Where light comes back from the same walls in every colour, the channels share left and right
 * and differ in core (R x R) alone; else core is 1 and each has its own (hierarchy_share.c). `flood` is what makes
 * every row's sum that of the transport it was made from. Of light that is known by whole blocks (transport/blocks.h),
 * with v = gather, c the columns over scale, d_b the sum of v over block b, left  = [P^+ c, indicators],   right =
 * [indicators / d, (P^+ c less its mean over blocks) / d]. */
#ifndef CLT_TRANSPORT_HIERARCHY_H
#define CLT_TRANSPORT_HIERARCHY_H

#include <pthread.h>

#include "transport/kind.h"
#include "transport/leaf_rows.h"
#include "transport/near_stream.h"

enum {
  CLT_LEAF_SIDE_MAX = 32,
  CLT_HIERARCHY_CHUNKS = 16 /* of leaves, so that sums do not depend on the number of threads */
};

typedef struct clt_leaf {
  int32_t x, y, width, height;
} clt_leaf;

/* The cells as products walk over them: in their own order, slice by slice (transport/near_stream.h), each a line of
 * spans of leaves. A slice's part of a leaf has its own sums. */
typedef struct clt_leaf_spans {
  clt_span *span;
  int32_t *leaf;                     /* of each part */
  size_t first_span[CLT_SLICES + 1]; /* of each slice */
  size_t first_part[CLT_SLICES + 1]; /* of each slice; the parts of its spans count from there */
  double place[(CLT_LEAF_SIDE_MAX + 1) * CLT_LEAF_SIDE_MAX]; /* of cell k of a side: [CLT_LEAF_SIDE_MAX side + k] */
} clt_leaf_spans;

typedef struct clt_hierarchy_storage {
  size_t leaves, rank; /* L, R */
  clt_leaf *leaf;
  clt_leaf_rows left, right;           /* 4L x R */
  float *core;                         /* channels x R x R where the channels share left and right; else NULL */
  float *scale, *gather, *own, *flood; /* channels x N */
  int64_t *start;                      /* N + 1: near by compressed rows, without the diagonal; one pattern for all */
  int32_t *cell;
  float *value;         /* channels x entries */
  double error;         /* relative RMS by which a product differs from that of the transport it was made from */
  clt_near_stream near; /* the same entries as products read them */
  clt_leaf_spans spans;
  double *scratch;                        /* per channel: clt_hierarchic_scratch */
  pthread_mutex_t turn[CLT_CHANNELS_MAX]; /* products of one channel take turns */
} clt_hierarchy_storage;

/* The storage of a transport of this kind, or NULL of another. */
const clt_hierarchy_storage *clt_hierarchic_of(const clt_transport *transport);

/* Doubles of scratch that a channel needs. */
size_t clt_hierarchic_scratch(const clt_hierarchy_storage *own);

/* The spans of leaves that share out the grid. The caller finishes them, also after a failure (CLT_FAILED: no memory).
 */
clt_status clt_leaf_spans_make(const clt_leaf *leaf, size_t leaves, int width, int height, clt_leaf_spans *spans,
                               clt_error *error);
void clt_leaf_spans_finish(clt_leaf_spans *spans);

/* out = core in, or core' in; a copy where there is no core. `in` and `out` hold R and do not overlap. */
void clt_hierarchic_core(const clt_hierarchy_storage *own, int channel, bool transposed, const float *in, float *out);

/* Storage without arrays, into transport->storage. */
clt_status clt_hierarchic_begin(clt_transport *transport, size_t leaves, size_t rank, const char *source,
                                clt_error *error);
/* Makes storage that has its leaves and its near pattern ready for products, after checking both. */
clt_status clt_hierarchic_finish(clt_transport *transport, size_t entries, const char *source, clt_error *error);
clt_status clt_hierarchic_check(const clt_transport *transport, const char *source, clt_error *error);
clt_status clt_hierarchic_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error);
clt_status clt_hierarchic_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error);
void clt_hierarchic_destroy(clt_transport *transport);

/* u or v of the middle of cell k of a side. */
static inline double clt_leaf_place(int32_t k, int32_t side) {
  return (2 * k + 1) / (double)side - 1;
}

#endif
