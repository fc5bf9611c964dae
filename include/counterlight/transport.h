/* The light transport T: how much light each observed cell (row) returns for each drive cell (column).
 *
 * Observation y = b0 + T x, per colour channel. x is a projector drive in linear light, 0..1; y is linear radiance; b0
 * is the black: what the camera sees while the drive is zero (projector black and ambient light). Rows and columns are
 * two spaces: rows are observed cells, columns are the width x height drive cells in row-major order, row 0 at the top.
 * Vectors are double: they are small beside T, whose storage kind decides its precision. Products may be called from
 * several threads at once on one transport; they spread over OpenMP's threads themselves. */
#ifndef COUNTERLIGHT_TRANSPORT_H
#define COUNTERLIGHT_TRANSPORT_H

#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_transport clt_transport;

/* Limits of every transport, checked wherever one is made or read. */
enum { CLT_GRID_SIDE_MAX = 16384, CLT_CHANNELS_MAX = 4, CLT_TEXT_MAX = 128 };

/* Where a transport comes from; all fields are optional and travel in the file's root attributes. */
typedef struct clt_provenance {
  char scheme[CLT_TEXT_MAX];   /* how it was acquired: "brute", "hierarchical", ...; empty: not known */
  char plan[CLT_TEXT_MAX];     /* which scheme was taken and why, in one sentence */
  char source[CLT_TEXT_MAX];   /* the rig or scene it was measured on */
  char response[CLT_TEXT_MAX]; /* the projector's response curve, as clt_curve_parse reads it; empty: sRGB */
  int64_t acquired;            /* seconds since 1970-01-01 UTC; 0: not known */
  int patterns, frames;        /* patterns projected, camera frames used */
  double seconds;              /* how long the acquisition took */
  double error; /* relative RMS of check patterns, predicted by T against observed, less the observations' noise;
                   < 0: not known */
} clt_provenance;

typedef struct clt_transport_info {
  int width, height, channels;
  size_t rows, cols;   /* cols = width * height; rows = cols where one camera shares the projector's grid */
  const char *storage; /* "dense", "dense64", "dense16", "dense8", "tree", "blocks", "hierarchy" */
  size_t bytes;        /* memory that one product of every channel reads */
} clt_transport_info;

/* Makes a dense transport of zeros: float32, row-major, channels x rows x (width * height). */
CLT_PUBLIC clt_status clt_transport_create_dense(int width, int height, int channels, size_t rows, clt_transport **out,
                                                 clt_error *error);

/* Makes a sparse transport over the nodes of the grid's pyramid ("tree" storage).
 *
 * A node is a square block of 2^level x 2^level drive cells (clipped at the grid's border); node numbers run through
 * level 0 (the cells themselves, row-major), then level 1, up to the level at which one node covers the grid:
 * clt_tree_levels and clt_tree_node give them. Row i of T is the sum over its entries e in start[i]..start[i+1]-1 of
 * value[c][e] times the indicator of block node[e]; so a product first sums x over blocks, then adds. An entry at the
 * top node is a flood correction (value * N * mean(x)). start has rows + 1 entries, ascending, start[0] = 0; node has
 * start[rows]; value has channels * start[rows], channel after channel. All three are copied. CLT_BAD_INPUT where an
 * index is out of range or a value is not finite. */
CLT_PUBLIC clt_status clt_transport_create_tree(int width, int height, int channels, size_t rows, const int64_t *start,
                                                const int32_t *node, const float *value, clt_transport **out,
                                                clt_error *error);
CLT_PUBLIC int clt_tree_levels(int width, int height);
/* Number of the node at column bx, row by of level `level`, and the total of nodes. */
CLT_PUBLIC int32_t clt_tree_node(int width, int height, int level, int bx, int by);
CLT_PUBLIC int32_t clt_tree_nodes(int width, int height);

/* The parts of a transport in "blocks" storage, for N cells and as many rows: T = near + far. Blocks share out the
 * drive cells; far is given by the light that each whole block sends to every cell, and by reciprocity. With w the flux
 * of a cell, D_b that of a block, cell i in block a and j in b, far_ij = w_j [C_ib / D_b + (C_ja - mean of C_a over b
 * by flux) / D_a], so that a block fully driven gives its column C_b exactly, and one with flux 0 nothing. */
typedef struct clt_block_parts {
  int count;            /* K blocks, 1..N */
  const int32_t *block; /* N: 0..K-1, the block of each cell */
  const float *flux;    /* N: w, >= 0; what light a cell sends into the room, in any unit */
  const float *column;  /* channels x K x N: C */
  /* near, by compressed rows with the same pattern in every channel: row i has the entries start[i] .. start[i + 1] - 1
   * of cell (their columns) and of value, which holds channel after channel */
  const int64_t *start;
  const int32_t *cell;
  const float *value;
} clt_block_parts;
/* Makes a transport of them, which are copied. CLT_BAD_INPUT where an index is out of range, a value not finite or a
 * flux negative. */
CLT_PUBLIC clt_status clt_transport_create_blocks(int width, int height, int channels, const clt_block_parts *parts,
                                                  clt_transport **out, clt_error *error);

/* Makes a transport in "hierarchy" storage: near light as it is, far light by the leaves of a block tree over which it
 * varies bilinearly, so that a product reads little more than one number a cell, and noise is smoothed. Every row keeps
 * its sum. Black, flood, deviations and provenance are copied. tolerance is 0 or more, below 1. Channels share one pair
 * of factors where that takes less room, and factors are kept in the fewest bits (8, 16, 32) that change products by no
 * more than .3 of the tolerance; then their sums are float.
 * From "blocks" storage: tolerance is the rms of a cell's light, all blocks together and relative to its own, that a
 * leaf may leave out; noise is not told by finer leaves either. Time and memory grow with the cells times the blocks.
 * From any other storage of a square T, by its rows: tolerance is the root of the sum of squares of the entries that
 * are left out, relative to that of the diagonal, beyond what deviations tell of noise. Time grows with the square of
 * the cells (some seconds at 3072). CLT_BAD_INPUT where rows are not the cells, and where far light does not vary
 * evenly, so that a quarter of the entries would stand by themselves. */
CLT_PUBLIC clt_status clt_transport_create_hierarchy(const clt_transport *from, double tolerance, clt_transport **out,
                                                     clt_error *error);
/* Relative RMS by which products with a hierarchy differ from those with what it was made from: the worst of several
 * patterns; 0 of other storage, which is the transport itself. */
CLT_PUBLIC double clt_transport_simplified(const clt_transport *transport);

/* Makes a copy in another dense storage, from any storage: entries, black, flood, deviations and provenance. Errors are
 * relative to the largest entry off the diagonal of a row (max_i) or of 32 neighbours in it (max_b); "rms" is what they
 * make of the compensated picture (NUMERICS section 3).
 *   storage    bytes an entry  an entry off the diagonal                      diagonal  accumulation            rms
 *   "dense64"  8               exact                                          exact     double                  0
 *   "dense"    4               2^-24 of itself                                float     double                  1e-8
 *   "dense16"  2               2^-11 of itself, at least 2^-30 max_i          float     float over 1024 terms
 * 1e-5..3e-4 "dense8"   1.125           max_b / 254, and the row's exact sum is kept   float     float over 1024 terms
 * 2e-4 The vectors of a product with "dense16" and "dense8" count as floats. CLT_BAD_INPUT for a storage that does not
 * exist (the message lists those that do) and for an entry that it cannot hold (beyond float; "dense8": beyond 1e30).
 */
CLT_PUBLIC clt_status clt_transport_convert(const clt_transport *transport, const char *storage, clt_transport **out,
                                            clt_error *error);
/* The storages that clt_transport_convert makes, in order: index 0.. until NULL. */
CLT_PUBLIC const char *clt_transport_storage_name(size_t index);

/* Frees a transport; accepts NULL. */
CLT_PUBLIC void clt_transport_destroy(clt_transport *transport);

/* Reads and writes docs/transport-file.md. Loading refuses (CLT_BAD_INPUT, naming file and field) what is missing,
 * truncated, damaged, of a wrong size, NaN or infinite (but a sigma may be: a cell never seen), or negative beyond
 * noise (an entry below -1e-2 of the largest). HDF5 1.10 trusts a file's structure and does not survive every flipped
 * byte: a program that must not end by that tries the file in a process of its own first, as counterlightd does. Saving
 * writes a temporary file in the same folder, syncs it and renames it over `path`. */
CLT_PUBLIC clt_status clt_transport_load(const char *path, clt_transport **out, clt_error *error);
CLT_PUBLIC clt_status clt_transport_save(const clt_transport *transport, const char *path, clt_error *error);

CLT_PUBLIC clt_transport_info clt_transport_describe(const clt_transport *transport);
CLT_PUBLIC clt_provenance *clt_transport_provenance(clt_transport *transport);
CLT_PUBLIC const clt_provenance *clt_transport_origin(const clt_transport *transport);

/* The black b0 of a channel, rows values; zeros until set. The transport owns the array. */
CLT_PUBLIC float *clt_transport_black(const clt_transport *transport, int channel);
/* The observed flood T 1 of a channel (rows values), or NULL where none was stored; `keep` makes room for it. */
CLT_PUBLIC const float *clt_transport_flood(const clt_transport *transport, int channel);
CLT_PUBLIC clt_status clt_transport_keep_flood(clt_transport *transport, clt_error *error);
CLT_PUBLIC float *clt_transport_flood_values(clt_transport *transport, int channel);
/* Standard deviation of an entry of T in a channel's row (rows values), or NULL; `keep` makes room for it. */
CLT_PUBLIC const float *clt_transport_sigma(const clt_transport *transport, int channel);
CLT_PUBLIC clt_status clt_transport_keep_sigma(clt_transport *transport, clt_error *error);
CLT_PUBLIC float *clt_transport_sigma_values(clt_transport *transport, int channel);

/* The entries of a "dense" transport's channel, rows x cols row-major, to read or fill; NULL for other storage. */
CLT_PUBLIC float *clt_transport_entries(const clt_transport *transport, int channel);

/* y = T x: x has cols values, y has rows; they must not overlap. */
CLT_PUBLIC void clt_transport_apply(const clt_transport *transport, int channel, const double *x, double *y);
/* The same of every channel, channel after channel: x has channels * cols values, y has channels * rows. Storage that
 * the channels share is read once. */
CLT_PUBLIC void clt_transport_apply_all(const clt_transport *transport, const double *x, double *y);
/* Row i of a channel: row_j = T_ij, cols values. At once of dense storage, by a transposed product of any other. */
CLT_PUBLIC clt_status clt_transport_row(const clt_transport *transport, int channel, size_t i, double *row,
                                        clt_error *error);
/* x = T' y: y has rows values, x has cols. */
CLT_PUBLIC void clt_transport_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x);
/* d_i = T_ii for i < min(rows, cols): the response of a cell to its own drive, F up to the light that returns to it. */
CLT_PUBLIC void clt_transport_diagonal(const clt_transport *transport, int channel, double *diagonal);
/* sums_i = sum_j T_ij, rows values: the observation of a fully driven grid, less the black. */
CLT_PUBLIC void clt_transport_row_sums(const clt_transport *transport, int channel, double *sums);

#ifdef __cplusplus
}
#endif
#endif
