/* Growing the block tree.
 *
 * A leaf of n cells holds 4 numbers a plane. Cutting it in two fits 4 more: over noise of variance s^2 alone that takes
 * 4 s^2 a plane off the squared distance, s^2 estimated from what both halves leave. A cut is made where it takes more
 * than twice that, and more than the tolerance allows to leave. */
#include "transport/hierarchy_tree.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { SIDE_LEAST = 4 };
#define BEYOND_NOISE 2.0

/* The sum of the squares of u over a side; 0 for a side of one cell. */
static double tilt_norm(int32_t side) {
  double sum = 0;
  for (int32_t k = 0; k < side; k++) {
    sum += clt_leaf_place(k, side) * clt_leaf_place(k, side);
  }
  return sum;
}

/* The four functions are orthogonal over a leaf, so that each coefficient is a quotient. */
double clt_leaf_fit(const clt_planes *planes, size_t plane, const clt_leaf *leaf, double fit[CLT_LEAF_TERMS]) {
  const float *values = planes->values + plane * (size_t)planes->width * (size_t)planes->height;
  const double across = tilt_norm(leaf->width), down = tilt_norm(leaf->height);
  const double norm[CLT_LEAF_TERMS] = {(double)leaf->width * leaf->height, across * leaf->height, down * leaf->width,
                                       across * down};
  double squares = 0;
  memset(fit, 0, CLT_LEAF_TERMS * sizeof *fit);
  for (int32_t row = 0; row < leaf->height; row++) {
    const float *at = values + (size_t)(leaf->y + row) * (size_t)planes->width + (size_t)leaf->x;
    double even = 0, tilted = 0;
    for (int32_t k = 0; k < leaf->width; k++) {
      const double value = (double)at[k];
      even += value;
      tilted += value * clt_leaf_place(k, leaf->width);
      squares += value * value;
    }
    const double v = clt_leaf_place(row, leaf->height);
    fit[0] += even;
    fit[1] += tilted;
    fit[2] += v * even;
    fit[3] += v * tilted;
  }
  for (int t = 0; t < CLT_LEAF_TERMS; t++) {
    squares -= norm[t] > 0 ? fit[t] * fit[t] / norm[t] : 0;
    fit[t] = norm[t] > 0 ? fit[t] / norm[t] : 0;
  }
  return squares > 0 ? squares : 0;
}

/* What the leaf leaves of every plane, each in units of its size. */
static double left_by(const clt_planes *planes, const clt_leaf *leaf) {
  double sum = 0;
  for (size_t plane = 0; plane < planes->count; plane++) {
    double fit[CLT_LEAF_TERMS];
    sum += clt_leaf_fit(planes, plane, leaf, fit) / (planes->size[plane] * planes->size[plane]);
  }
  return sum;
}

static void cut(const clt_leaf *leaf, bool down, clt_leaf half[2]) {
  half[0] = half[1] = *leaf;
  if (down) {
    half[1].height = leaf->height / 2;
    half[0].height -= half[1].height;
    half[1].y += half[0].height;
  } else {
    half[1].width = leaf->width / 2;
    half[0].width -= half[1].width;
    half[1].x += half[0].width;
  }
}

static bool has_one_label(const clt_planes *planes, const clt_leaf *leaf) {
  const int32_t *label = planes->label + (size_t)leaf->y * (size_t)planes->width + (size_t)leaf->x;
  for (int32_t k = 0; k < leaf->width * leaf->height; k++) {
    if (label[(size_t)(k / leaf->width) * (size_t)planes->width + (size_t)(k % leaf->width)] != label[0]) {
      return false;
    }
  }
  return true;
}

/* What a cut takes off beyond what it takes off noise and what may be left. */
static double gain_of(const clt_planes *planes, const clt_leaf *leaf, bool down, double whole) {
  clt_leaf half[2];
  cut(leaf, down, half);
  const double cells = (double)leaf->width * leaf->height,
               halves = left_by(planes, &half[0]) + left_by(planes, &half[1]);
  const double noise = cells > 2 * CLT_LEAF_TERMS ? halves / (cells - 2 * CLT_LEAF_TERMS) : 0;
  return whole - halves - BEYOND_NOISE * CLT_LEAF_TERMS * noise - planes->tolerance * planes->tolerance * cells;
}

/* Whether to cut a leaf, and in which direction. */
static bool pays(const clt_planes *planes, const clt_leaf *leaf, bool *down) {
  *down = leaf->height > leaf->width;
  if (leaf->width > CLT_LEAF_SIDE_MAX || leaf->height > CLT_LEAF_SIDE_MAX || !has_one_label(planes, leaf)) {
    return true;
  }
  const bool wide = leaf->width >= 2 * SIDE_LEAST, high = leaf->height >= 2 * SIDE_LEAST;
  if (!wide && !high) {
    return false;
  }
  const double whole = left_by(planes, leaf);
  const double across = wide ? gain_of(planes, leaf, false, whole) : 0,
               along = high ? gain_of(planes, leaf, true, whole) : 0;
  *down = along > across;
  return across > 0 || along > 0;
}

clt_status clt_leaves_grow(const clt_planes *planes, clt_leaf **leaf, size_t *count, clt_error *error) {
  const size_t cells = (size_t)planes->width * (size_t)planes->height;
  clt_leaf *all = clt_alloc(cells, sizeof *all);
  if (all == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for the leaves of %zu cells", cells);
  }
  size_t done = 0, known = 1;
  all[0] = (clt_leaf){0, 0, planes->width, planes->height};
  while (done < known) {
    bool down;
    if (pays(planes, &all[done], &down)) {
      clt_leaf half[2];
      cut(&all[done], down, half);
      all[done] = half[0];
      all[known++] = half[1];
    } else {
      done++;
    }
  }
  *leaf = realloc(all, known * sizeof *all);
  *leaf = *leaf != NULL ? *leaf : all;
  *count = known;
  return CLT_OK;
}
