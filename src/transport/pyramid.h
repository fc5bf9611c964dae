/* The pyramid of square blocks over a grid of drive cells; counterlight/transport.h says how its nodes are numbered. */
#ifndef CLT_TRANSPORT_PYRAMID_H
#define CLT_TRANSPORT_PYRAMID_H

#include <stdint.h>

enum { CLT_PYRAMID_LEVELS_MAX = 15 }; /* CLT_GRID_SIDE_MAX is 2^14 */

typedef struct clt_pyramid {
  int levels;
  int width[CLT_PYRAMID_LEVELS_MAX], height[CLT_PYRAMID_LEVELS_MAX]; /* of a level, in blocks */
  int32_t first[CLT_PYRAMID_LEVELS_MAX + 1]; /* number of a level's first node; then the total */
} clt_pyramid;

/* width and height are 1..CLT_GRID_SIDE_MAX. */
clt_pyramid clt_pyramid_of(int width, int height);
/* The level that a node stands on. */
int clt_pyramid_level(const clt_pyramid *pyramid, int32_t node);
/* The node of a level whose block contains the cell. */
int32_t clt_pyramid_above(const clt_pyramid *pyramid, int level, int32_t cell);
/* nodes holds a value per node: those above the cells become the sum over their block's cells. */
void clt_pyramid_sum_up(const clt_pyramid *pyramid, double *nodes);
/* The transposed: every cell gets the values of all blocks that contain it; values of inner nodes are changed too. */
void clt_pyramid_push_down(const clt_pyramid *pyramid, double *nodes);

#endif
