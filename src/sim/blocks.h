/* The exchange of light between clusters, parted into blocks that one of three forms can hold.
 *
 * Between points in front of each other the kernel of H is k(x, y) = cos cos' / (pi r^2). Two clusters far from each
 * other see it smooth: interpolated in k x k nodes of either box it is k^4 values, of the least order that keeps the
 * wanted error. Where something may stand between, sampled segments say how much of the light passes on average, once
 * the clusters are so small that no more is to be known; where they are large, or too close, the pair is parted. Leaves
 * that are still too close exchange element by element. */
#ifndef CLT_SIM_BLOCKS_H
#define CLT_SIM_BLOCKS_H

#include <stddef.h>

#include "sim/cluster.h"
#include "sim/interpolation.h"

/* How a block holds its exchange: order 1 to CLT_ORDER_MAX of interpolation, or element by element. */
enum { CLT_BLOCK_NEAR = 0 };

typedef struct clt_block {
  int a, b;                    /* clusters of two surfaces */
  int order;                   /* CLT_BLOCK_NEAR or of interpolation */
  float value;                 /* of order 1: the kernel's mean over both clusters, with what stands between */
  int first_blocker, blockers; /* of a near block: what may stand between; blockers -1: any surface */
} clt_block;

/* Wanted errors. Those of light are relative to what an element sends or, below a thousandth of it, to that. */
typedef struct clt_accuracy {
  double kernel; /* of an interpolated block, where smaller blocks would be better */
  double rest;   /* the form factor of leaves that may stay interpolated or averaged all the same */
} clt_accuracy;

typedef struct clt_blocks {
  size_t count, room;
  clt_block *block;
  size_t blocker_count, blocker_room;
  int *blocker; /* surfaces */
} clt_blocks;

/* Parts what the surfaces exchange; the same for any number of threads. blocks was zeroed by the caller and is finished
 * by it in either case. */
clt_status clt_blocks_init(clt_blocks *blocks, const clt_parts *parts, const clt_clusters *clusters,
                           const clt_accuracy *accuracy, clt_error *error);
void clt_blocks_finish(clt_blocks *blocks);

/* Parts near blocks until their clusters are leaves; clusters is the tree that the blocks' numbers now belong to. */
clt_status clt_blocks_part_near(clt_blocks *blocks, const clt_clusters *clusters, clt_error *error);

/* k of two points on planes with these normals, 1/m^2; 0 where one lies behind the other's plane. */
double clt_blocks_kernel(clt_vector x, clt_vector normal_x, clt_vector y, clt_vector normal_y);

#endif
