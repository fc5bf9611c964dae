/* The transport from inside: one table of functions for each kind of storage. */
#ifndef CLT_TRANSPORT_KIND_H
#define CLT_TRANSPORT_KIND_H

#include <float.h>

#include "counterlight/transport.h"
#include "transport/hdf.h"

/* What a storage kind does. Arrays are as in counterlight/transport.h; every function may be called from several
 * threads at once on one transport, except load and destroy. */
typedef struct clt_kind {
  const char *name; /* of the storage, and of its dataset or group in the file's root */
  void (*apply)(const clt_transport *transport, int channel, const double *x, double *y);
  /* NULL where the channels share nothing: then `apply` runs for each. */
  void (*apply_all)(const clt_transport *transport, const double *x, double *y);
  void (*apply_transposed)(const clt_transport *transport, int channel, const double *y, double *x);
  void (*diagonal)(const clt_transport *transport, int channel, double *diagonal);
  void (*row_sums)(const clt_transport *transport, int channel, double *sums);
  size_t (*bytes)(const clt_transport *transport);
  float *(*entries)(const clt_transport *transport, int channel); /* NULL where T is not held entry by entry */
  /* values_j = T_ij; NULL where a row is had by a transposed product. */
  void (*row)(const clt_transport *transport, int channel, size_t row, double *values);
  /* A transport that is made row by row (clt_transport_convert): the largest magnitude of an entry that it can hold,
   * room for the entries of one that knows its grid, channels and rows, and a row of them. 0 and NULL where a kind is
   * not made that way. Several threads may put rows at once. */
  double most;
  clt_status (*reserve)(clt_transport *transport, clt_error *error);
  void (*put_row)(clt_transport *transport, int channel, size_t row, const double *values);
  /* Whether every entry is one that a file may hold; the message begins with `source`. */
  clt_status (*check)(const clt_transport *transport, const char *source, clt_error *error);
  /* Reads its part of a file into a transport that knows its grid and channels but neither rows nor storage. What it
   * has allocated when it fails, destroy frees. */
  clt_status (*load)(clt_transport *transport, const clt_hdf *hdf, clt_error *error);
  clt_status (*save)(const clt_transport *transport, const clt_hdf *hdf, clt_error *error);
  void (*destroy)(clt_transport *transport); /* frees the storage, also a half-built one and none */
} clt_kind;

enum { CLT_WORTH_SHARING = 32768 }; /* dense entries from which threads pay */

extern const clt_kind clt_kind_dense, clt_kind_dense64, clt_kind_dense16, clt_kind_dense8, clt_kind_tree,
    clt_kind_blocks, clt_kind_hierarchy;

/* Every kind, ended by NULL. */
extern const clt_kind *const clt_kinds[];

struct clt_transport {
  const clt_kind *kind;
  int width, height, channels;
  size_t rows, cols;
  clt_provenance provenance;
  float *black, *flood, *sigma; /* channels x rows; flood and sigma are NULL where there is none */
  void *storage;                /* the kind's own */
};

/* A transport of a kind without storage or rows: the grid and the channels are checked, the provenance is "not known".
 * `source` begins the message of a failure. */
clt_status clt_transport_begin(const clt_kind *kind, int width, int height, int channels, const char *source,
                               clt_transport **out, clt_error *error);
/* Gives it its rows, 1..CLT_GRID_SIDE_MAX^2. */
clt_status clt_transport_set_rows(clt_transport *transport, size_t rows, const char *source, clt_error *error);
/* Fails as a dense transport of so many bytes finds no memory. */
clt_status clt_transport_too_large(const clt_transport *transport, size_t bytes, clt_error *error);
/* Makes room for the black, which every transport has; zeros. */
clt_status clt_transport_keep_black(clt_transport *transport, clt_error *error);
/* Copies black, flood and deviations. */
clt_status clt_transport_copy_planes(const clt_transport *from, clt_transport *to, clt_error *error);

#endif
