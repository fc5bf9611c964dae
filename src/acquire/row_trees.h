/* The rows of T while they are being measured hierarchically.
 *
 * Row i covers the grid by leaves, nodes of the pyramid: leaf e in start[i] .. start[i + 1] - 1 holds, for channel c,
 * value[e * channels + c], the light that the row's observed cell gets from the whole block node[e] fully driven, in
 * units of the channel's scale. Every leaf carries what is known about its error, common to all channels:
 *   variance  of value (largest of the channels)
 *   spread    how far its children are expected to lie from an even split of value: an estimate from above
 * Leaves of one family (children of one node) stand together in clt_block_children's order, and a split family stands
 * where its parent stood. */
#ifndef CLT_ACQUIRE_ROW_TREES_H
#define CLT_ACQUIRE_ROW_TREES_H

#include <stdbool.h>
#include <stddef.h>

#include "acquire/blocks.h"
#include "counterlight/image.h"
#include "counterlight/status.h"

typedef struct clt_row_trees {
  size_t rows;
  int channels;
  int64_t *start;
  int32_t *node;
  float *value, *variance, *spread;
} clt_row_trees;

/* Rows of one leaf each, the top node with value flood[c * rows + i] / scale[c] and variance[i]. */
clt_status clt_row_trees_plant(const clt_pyramid *pyramid, const clt_image *flood, const double *scale,
                               const float *variance, clt_row_trees *trees, clt_error *error);
void clt_row_trees_finish(clt_row_trees *trees); /* accepts a zeroed one */

/* The blocks of a level that each row sees with a spread above threshold, as columns (node - first node of the level)
 * for clt_colour_columns; column has room for the leaves of all rows. */
void clt_row_trees_active(const clt_row_trees *trees, const clt_pyramid *pyramid, int level, double threshold,
                          int64_t *start, int32_t *column);

/* Splits, in every row, the leaves of a level >= 1 whose spread is above threshold and whose block has a colour >= 0.
 * A child starts with its even share of the parent's value and with the variance that the parent's spread gives it. */
clt_status clt_row_trees_split(const clt_row_trees *before, const clt_pyramid *pyramid, int level, double threshold,
                               const int32_t *colour, clt_row_trees *after, clt_error *error);

/* Corrects the children at `level` by one photograph: fill holds the pattern's mean over every node (see
 * clt_block_fill), seen the black-free observation and noise[i] its variance in squared scales (infinite: not
 * seen). What the leaves do not explain of it goes to the fully lit children in proportion to their variance. */
void clt_row_trees_correct(clt_row_trees *trees, const clt_pyramid *pyramid, int level, const double *fill,
                           const clt_image *seen, const double *scale, const float *noise);

/* Makes the children of every family split at `level` add up to their parent in `before`, each side giving way by its
 * variance, and sets the children's spreads from how unevenly the parent's light turned out to be shared. */
void clt_row_trees_settle(clt_row_trees *after, const clt_row_trees *before, const clt_pyramid *pyramid, int level);

/* Clips what is negative beyond noise, then makes the leaves of every row add up to its flood exactly, each giving way
 * by its variance. */
void clt_row_trees_match_flood(clt_row_trees *trees, const clt_image *flood, const double *scale,
                               const float *variance);

#endif
