#include "acquire/blocks.h"

clt_block clt_block_of(const clt_pyramid *pyramid, int level, int32_t node) {
  int32_t number = node - pyramid->first[level];
  int side = 1 << level;
  int x = number % pyramid->width[level] * side, y = number / pyramid->width[level] * side;
  int right = pyramid->width[0] - x, below = pyramid->height[0] - y;
  return (clt_block){.x = x, .y = y, .width = right < side ? right : side, .height = below < side ? below : side};
}

int clt_block_cells(const clt_pyramid *pyramid, int level, int32_t node) {
  clt_block block = clt_block_of(pyramid, level, node);
  return block.width * block.height;
}

int clt_block_children(const clt_pyramid *pyramid, int level, int32_t node, int32_t children[4]) {
  int32_t number = node - pyramid->first[level];
  int left = 2 * (number % pyramid->width[level]), top = 2 * (number / pyramid->width[level]);
  int below = level - 1, count = 0;
  for (int q = 0; q < 4; q++) {
    int x = left + q % 2, y = top + q / 2;
    if (x < pyramid->width[below] && y < pyramid->height[below]) {
      children[count++] = pyramid->first[below] + y * pyramid->width[below] + x;
    }
  }
  return count;
}

void clt_block_fill(const clt_pyramid *pyramid, double *fill) {
  clt_pyramid_sum_up(pyramid, fill);
  for (int level = 1; level < pyramid->levels; level++) {
    for (int32_t node = pyramid->first[level]; node < pyramid->first[level + 1]; node++) {
      fill[node] /= clt_block_cells(pyramid, level, node);
    }
  }
}
