/* Blocks storage from inside: T = near + far, where the light of whole blocks of drive cells is known in every cell.
 *
 * far is W-symmetric in the sense of NUMERICS section 1: far_ij = M_ij w_j with M symmetric and w the flux of a drive
 * cell. Known are the columns C = far P, P the indicators of K blocks that share out the grid. With D_b the flux of
 * block b and the projector Pi = P D^-1 P' W onto what is even in every block, two of the three parts of far,
 *   far Pi = C D^-1 P' W   and   Pi far (I - Pi) = P D^-1 C' W (I - Pi),
 * are known without knowing more: light of a block in every cell, and by reciprocity light of every cell in a block.
 * (I - Pi) far (I - Pi), uneven from uneven, is left out. So for j in block b, i in block a,
 *   far_ij = w_j [C_ib / D_b + (C_ja - mean of C_a over b) / D_a],
 * and far P = C exactly. A block without flux gives and, by reciprocity, takes nothing. */
#ifndef CLT_TRANSPORT_BLOCKS_H
#define CLT_TRANSPORT_BLOCKS_H

#include <pthread.h>

#include "transport/kind.h"
#include "transport/near_stream.h"

/* Cells of one block side by side: from `first` to the first of the next. */
typedef struct clt_run {
  int32_t first, block;
} clt_run;

typedef struct clt_block_storage {
  size_t count;                           /* K */
  int32_t *block;                         /* N: the block of each cell */
  float *flux;                            /* N: w */
  float *column;                          /* channels x K x N: C */
  int64_t *start;                         /* N + 1: near by compressed rows; every channel has the same pattern */
  int32_t *cell;                          /* entries */
  float *value;                           /* channels x entries */
  float *own;                             /* channels x N: near light of cells to themselves, as products read it */
  clt_near_stream near;                   /* and all other near light */
  clt_run *run;                           /* that share out the cells; none crosses slices (transport/near_stream.h) */
  size_t first_run[CLT_SLICES + 1];       /* of each slice */
  double *inverse;                        /* K: 1 / D_b; 0 for a block without flux */
  double *scratch;                        /* per channel: room for a product; see blocks.c */
  pthread_mutex_t turn[CLT_CHANNELS_MAX]; /* products of one channel take turns */
} clt_block_storage;

/* Doubles of scratch that a channel needs. */
size_t clt_block_scratch(size_t count);

/* The kind's part in blocks_file.c. */
clt_status clt_blocks_check(const clt_transport *transport, const char *source, clt_error *error);
clt_status clt_blocks_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error);
clt_status clt_blocks_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error);
void clt_blocks_destroy(clt_transport *transport);

#endif
