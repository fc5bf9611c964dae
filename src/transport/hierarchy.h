/* Hierarchy storage from inside: near light cell by cell, far light between the leaves of a block tree.
 *
 * The grid is cut in halves again and again until light from afar varies bilinearly over each leaf, as well as its
 * noise lets one tell. Over a leaf with the coordinates -1 < u, v < 1 stand the four functions 1, u, v, u v; P (N x 4L)
 * holds them for all L leaves. With a rank R of far light that a few blocks determine,
 *
 *   T = diag(own) + near + diag(scale) P left right' P' diag(gather) + flood 1' / N,
 *
 * left and right 4L x R. `flood` is what makes every row's sum that of the transport it was made from. Of light that is
 * known by whole blocks (transport/blocks.h), with v = gather, c the columns over scale, d_b the sum of v over block b,
 *   left  = [P^+ c, indicators],   right = [indicators / d, (P^+ c less its mean over blocks) / d]. */
#ifndef CLT_TRANSPORT_HIERARCHY_H
#define CLT_TRANSPORT_HIERARCHY_H

#include <pthread.h>

#include "transport/kind.h"

enum {
  CLT_LEAF_TERMS = 4,
  CLT_LEAF_SIDE_MAX = 32,
  CLT_HIERARCHY_CHUNKS = 8 /* of leaves, so that sums do not depend on the number of threads */
};

typedef struct clt_leaf {
  int32_t x, y, width, height;
} clt_leaf;

typedef struct clt_hierarchy_storage {
  size_t leaves, rank; /* L, R */
  clt_leaf *leaf;
  float *left, *right;                 /* channels x 4L x R */
  float *scale, *gather, *own, *flood; /* channels x N */
  int64_t *start;                      /* N + 1: near by compressed rows, without the diagonal; one pattern for all */
  int32_t *cell;
  float *value;    /* channels x entries */
  double error;    /* relative RMS by which a product differs from that of the transport it was made from */
  double *scratch; /* per channel: CLT_HIERARCHY_CHUNKS + 1 times R values */
  pthread_mutex_t turn[CLT_CHANNELS_MAX]; /* products of one channel take turns */
} clt_hierarchy_storage;

/* The storage of a transport of this kind, or NULL of another. */
const clt_hierarchy_storage *clt_hierarchic_of(const clt_transport *transport);

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
