/* The blocks of the pyramid over the grid, as acquisition lights them. */
#ifndef CLT_ACQUIRE_BLOCKS_H
#define CLT_ACQUIRE_BLOCKS_H

#include <stdint.h>

#include "transport/pyramid.h"

/* A block of drive cells: columns x .. x + width - 1, rows y .. y + height - 1 (clipped at the grid's border). */
typedef struct clt_block {
  int x, y, width, height;
} clt_block;

/* The cells of a node that stands on level. */
clt_block clt_block_of(const clt_pyramid *pyramid, int level, int32_t node);
int clt_block_cells(const clt_pyramid *pyramid, int level, int32_t node);
/* The 1, 2 or 4 nodes of level - 1 inside a node of a level >= 1, in row-major order; returns their count. */
int clt_block_children(const clt_pyramid *pyramid, int level, int32_t node, int32_t children[4]);
/* fill holds a value per node: those above the cells become the mean over their block's cells. */
void clt_block_fill(const clt_pyramid *pyramid, double *fill);

#endif
