/* The block tree of a hierarchy: where far light may be told from four numbers a leaf. */
#ifndef CLT_TRANSPORT_HIERARCHY_TREE_H
#define CLT_TRANSPORT_HIERARCHY_TREE_H

#include "transport/hierarchy.h"

/* Light over the cells of a grid, in `count` planes of width x height values, and how it may be cut. */
typedef struct clt_planes {
  int width, height;
  size_t count;
  const float *values;
  const double *size;   /* per plane: what a light of 1 is */
  const int32_t *label; /* no leaf has cells of two labels */
  double tolerance;     /* rms of a cell's light over all planes together, that a leaf may leave out */
} clt_planes;

/* The coefficients of 1, u, v, u v that come nearest to the values of a plane over a leaf, by least squares; returns
 * the squared distance that is left. */
double clt_leaf_fit(const clt_planes *planes, size_t plane, const clt_leaf *leaf, double fit[CLT_LEAF_TERMS]);

/* Cuts the grid in halves until every leaf has one label, at most CLT_LEAF_SIDE_MAX cells a side, and light that a cut
 * would not tell better than noise does. *leaf is allocated, *count leaves. */
clt_status clt_leaves_grow(const clt_planes *planes, clt_leaf **leaf, size_t *count, clt_error *error);

/* Lowers the rank of left right' by what changes a product by less than tolerance[channel] times the drive's norm. */
clt_status clt_leaves_compress(clt_hierarchy_storage *own, size_t channels, const double *tolerance, clt_error *error);

#endif
