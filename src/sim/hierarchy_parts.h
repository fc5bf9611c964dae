/* A hierarchical matrix from inside: what building it leaves and its product reads. */
#ifndef CLT_SIM_HIERARCHY_PARTS_H
#define CLT_SIM_HIERARCHY_PARTS_H

#include <stdint.h>

#include "sim/blocks.h"
#include "sim/hierarchy.h"

/* A cluster's moments of all orders, the highest last. */
enum { CLT_MOMENTS = CLT_ORDER_MAX * (CLT_ORDER_MAX + 1) * (2 * CLT_ORDER_MAX + 1) / 6 };

/* Where those of an order begin: 1 + 4 + ... + (order - 1)^2. */
static inline int clt_moments_of(int order) {
  return (order - 1) * order * (2 * order - 1) / 6;
}

/* What a cluster takes from another one. */
typedef struct clt_link {
  uint32_t from, values; /* a cluster; where its block's values begin */
  uint8_t order;         /* CLT_BLOCK_NEAR or of interpolation */
  bool turned;           /* the block is stored for the other direction */
} clt_link;

/* The links of cluster c are link[start[c]] to link[start[c + 1] - 1]. */
typedef struct clt_links {
  size_t *start;
  clt_link *link;
} clt_links;

struct clt_hierarchy {
  clt_clusters clusters; /* without those that no block needs */
  int *parent;           /* of each cluster; -1: a root */
  uint8_t *orders;       /* of each cluster's far blocks: bit k for order k */
  int levels, *level;    /* the clusters of level l are number level[l] to level[l + 1] - 1 */
  int leaves, *leaf;
  float *basis;                                       /* V: CLT_NODES values of each element */
  float (*transfer)[2][CLT_ORDER_MAX][CLT_ORDER_MAX]; /* of each cluster, along its two axes: the polynomial of its
                                                         parent's node (second) at its own node (first) */
  float reduction[CLT_ORDER_MAX][CLT_ORDER_MAX][CLT_ORDER_MAX]; /* of each order below the highest: its polynomial
                                                                   (second) at a node of the highest (first) */
  clt_links far, near;
  size_t block_count[2]; /* far, near */
  size_t value_count;
  float *values; /* of the blocks, row by row: of cluster a's node or element each b's */
};

#endif
