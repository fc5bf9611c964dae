#include "transport/pyramid.h"

#include "counterlight/transport.h"

clt_pyramid clt_pyramid_of(int width, int height) {
  clt_pyramid pyramid = {0};
  for (;;) {
    int level = pyramid.levels++;
    pyramid.width[level] = width;
    pyramid.height[level] = height;
    pyramid.first[level + 1] = pyramid.first[level] + width * height;
    if (width == 1 && height == 1) {
      return pyramid;
    }
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  }
}

int clt_pyramid_level(const clt_pyramid *pyramid, int32_t node) {
  int level = 0;
  while (node >= pyramid->first[level + 1]) {
    level++;
  }
  return level;
}

int32_t clt_pyramid_above(const clt_pyramid *pyramid, int level, int32_t cell) {
  int column = cell % pyramid->width[0], row = cell / pyramid->width[0];
  return pyramid->first[level] + (row >> level) * pyramid->width[level] + (column >> level);
}

/* A block row of a level is made of, or gives to, one or two block rows of the level below. */
typedef struct block_row {
  double *parents;
  double *children[2]; /* the second is NULL at a clipped border */
  int width;           /* of the level below */
} block_row;

static block_row find_row(const clt_pyramid *pyramid, double *nodes, int level, int row) {
  const int below = level - 1, width = pyramid->width[below];
  double *children = nodes + pyramid->first[below] + (int32_t)(2 * row) * width;
  return (block_row){.parents = nodes + pyramid->first[level] + (int32_t)row * pyramid->width[level],
                     .children = {children, 2 * row + 1 < pyramid->height[below] ? children + width : NULL},
                     .width = width};
}

static void add_to_parents(const block_row *row) {
  for (int column = 0; column < row->width; column += 2) {
    double sum = 0;
    for (int k = 0; k < 2 && row->children[k] != NULL; k++) {
      sum += row->children[k][column];
      sum += column + 1 < row->width ? row->children[k][column + 1] : 0;
    }
    row->parents[column / 2] = sum;
  }
}

static void add_to_children(const block_row *row) {
  for (int k = 0; k < 2 && row->children[k] != NULL; k++) {
    for (int column = 0; column < row->width; column++) {
      row->children[k][column] += row->parents[column / 2];
    }
  }
}

enum { WORTH_SHARING = 32768 }; /* blocks of a level from which threads pay */

void clt_pyramid_sum_up(const clt_pyramid *pyramid, double *nodes) {
  for (int level = 1; level < pyramid->levels; level++) {
    const int height = pyramid->height[level];
#pragma omp parallel for schedule(static) if (height * pyramid->width[level] >= WORTH_SHARING)
    for (int y = 0; y < height; y++) {
      block_row row = find_row(pyramid, nodes, level, y);
      add_to_parents(&row);
    }
  }
}

void clt_pyramid_push_down(const clt_pyramid *pyramid, double *nodes) {
  for (int level = pyramid->levels - 1; level > 0; level--) {
    const int height = pyramid->height[level];
#pragma omp parallel for schedule(static) if (height * pyramid->width[level] >= WORTH_SHARING)
    for (int y = 0; y < height; y++) {
      block_row row = find_row(pyramid, nodes, level, y);
      add_to_children(&row);
    }
  }
}

int clt_tree_levels(int width, int height) {
  return clt_pyramid_of(width, height).levels;
}

int32_t clt_tree_node(int width, int height, int level, int bx, int by) {
  clt_pyramid pyramid = clt_pyramid_of(width, height);
  return pyramid.first[level] + by * pyramid.width[level] + bx;
}

int32_t clt_tree_nodes(int width, int height) {
  clt_pyramid pyramid = clt_pyramid_of(width, height);
  return pyramid.first[pyramid.levels];
}
