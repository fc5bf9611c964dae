/* The elements of a scene's surfaces, gathered into a tree of clusters for each surface.
 *
 * A cluster is a run of elements of one surface in the clusters' own order, and the least box around them in the plane
 * of the surface. Its two children are the elements on either side of the middle of its longer side. */
#ifndef CLT_SIM_CLUSTER_H
#define CLT_SIM_CLUSTER_H

#include "sim/exchange.h"

enum { CLT_CLUSTER_ELEMENTS = 32 }; /* a cluster of more has children, where its elements do not share one middle */

/* Where a surface lies: the points origin + a along[0] + b along[1], a and b in m. */
typedef struct clt_plane {
  clt_vector origin, along[2], normal; /* orthonormal */
} clt_plane;

typedef struct clt_cluster {
  int begin, end; /* its elements, in the clusters' order */
  int surface;
  int child;              /* the first of two, which follow each other; -1: none */
  double low[2], high[2]; /* its box, m */
  double area;            /* of its elements, m^2 */
} clt_cluster;

typedef struct clt_clusters {
  int count; /* parents come before children, and a level of the trees before the next */
  clt_cluster *cluster;
  int surfaces;
  clt_plane *plane; /* of each surface */
  int *root;        /* of each surface; -1: it has no elements */
  int elements;
  int *order; /* the element of the parts that stands at each place */
} clt_clusters;

/* clusters was zeroed by the caller and is finished by it in either case. */
clt_status clt_clusters_init(clt_clusters *clusters, const clt_parts *parts, clt_error *error);
void clt_clusters_finish(clt_clusters *clusters);

/* The point of a cluster's box at (at[0], at[1]), each -1..1 across it. */
clt_vector clt_cluster_point(const clt_clusters *clusters, int number, const double at[2]);
/* The four corners, counter-clockwise. */
void clt_cluster_corners(const clt_clusters *clusters, int number, clt_vector corners[4]);
/* The longer side of its box. */
double clt_cluster_side(const clt_cluster *cluster);

#endif
