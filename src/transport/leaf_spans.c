/* The order in which products walk over the cells of a hierarchy. */
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/hierarchy.h"

/* Leaves of a grid of `width` cells a row, and which of them each cell lies in. */
typedef struct map {
  const clt_leaf *leaf;
  size_t leaves, width, cells;
  int32_t *leaf_at;
  int32_t *part_at; /* of each leaf, the part of it that a slice met; -1 before it met one */
} map;

static void paint(map *of) {
  for (size_t k = 0; k < of->leaves; k++) {
    const clt_leaf leaf = of->leaf[k];
    for (int32_t row = leaf.y; row < leaf.y + leaf.height; row++) {
      for (int32_t column = leaf.x; column < leaf.x + leaf.width; column++) {
        of->leaf_at[(size_t)row * of->width + (size_t)column] = (int32_t)k;
      }
    }
  }
}

/* How many cells from j on, before `end`, lie in its row and its leaf. */
static size_t length_at(const map *of, size_t j, size_t end) {
  const size_t row_end = (j / of->width + 1) * of->width, last = row_end < end ? row_end : end;
  size_t next = j + 1;
  while (next < last && of->leaf_at[next] == of->leaf_at[j]) {
    next++;
  }
  return next - j;
}

static clt_span span_at(const map *of, size_t j, size_t count) {
  const clt_leaf leaf = of->leaf[of->leaf_at[j]];
  const int32_t column = (int32_t)(j % of->width), row = (int32_t)(j / of->width);
  return (clt_span){.first = (int32_t)j,
                    .part = of->part_at[of->leaf_at[j]],
                    .count = (uint16_t)count,
                    .u = (uint16_t)(CLT_LEAF_SIDE_MAX * leaf.width + column - leaf.x),
                    .v = (uint16_t)(CLT_LEAF_SIDE_MAX * leaf.height + row - leaf.y)};
}

/* Walks over the slices in their order: counts spans and parts, and writes them down where there is room for them. */
static void walk(map *of, clt_leaf_spans *out) {
  for (size_t slice = 0; slice < CLT_SLICES; slice++) {
    const size_t end = clt_slice_first(of->cells, slice + 1);
    size_t spans = out->first_span[slice], parts = 0;
    memset(of->part_at, 0xff, of->leaves * sizeof *of->part_at);
    for (size_t j = clt_slice_first(of->cells, slice); j < end; spans++) {
      const int32_t leaf = of->leaf_at[j];
      const size_t count = length_at(of, j, end);
      if (of->part_at[leaf] < 0) {
        of->part_at[leaf] = (int32_t)parts++;
        if (out->leaf != NULL) {
          out->leaf[out->first_part[slice] + parts - 1] = leaf;
        }
      }
      if (out->span != NULL) {
        out->span[spans] = span_at(of, j, count);
      }
      j += count;
    }
    out->first_span[slice + 1] = spans;
    out->first_part[slice + 1] = out->first_part[slice] + parts;
  }
}

static bool make(map *of, clt_leaf_spans *out) {
  of->leaf_at = clt_alloc(of->cells, sizeof *of->leaf_at);
  of->part_at = clt_alloc(of->leaves, sizeof *of->part_at);
  if (of->leaf_at == NULL || of->part_at == NULL) {
    return false;
  }
  paint(of);
  walk(of, out);
  out->span = clt_alloc(out->first_span[CLT_SLICES], sizeof *out->span);
  out->leaf = clt_alloc(out->first_part[CLT_SLICES], sizeof *out->leaf);
  if (out->span == NULL || out->leaf == NULL) {
    return false;
  }
  walk(of, out);
  return true;
}

clt_status clt_leaf_spans_make(const clt_leaf *leaf, size_t leaves, int width, int height, clt_leaf_spans *spans,
                               clt_error *error) {
  map of = {.leaf = leaf, .leaves = leaves, .width = (size_t)width, .cells = (size_t)width * (size_t)height};
  const bool made = make(&of, spans);
  free(of.leaf_at);
  free(of.part_at);
  for (int32_t side = 1; side <= CLT_LEAF_SIDE_MAX; side++) {
    for (int32_t k = 0; k < side; k++) {
      spans->place[CLT_LEAF_SIDE_MAX * side + k] = clt_leaf_place(k, side);
    }
  }
  return made ? CLT_OK : clt_fail(error, CLT_FAILED, "no memory for the order of %zu leaves", leaves);
}

void clt_leaf_spans_finish(clt_leaf_spans *spans) {
  free(spans->span);
  free(spans->leaf);
}
