#include "rig/geometry/regions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"

/* A flood over the map, and how often each axis and bit was the ambiguous one within it. */
typedef struct flood {
  const clt_pixel_map *map;
  const uint8_t *detail;
  uint8_t *seen;
  int32_t *stack;
  long bits[2 * CLT_GRAY_BITS_MAX];
} flood;

static void grow(clt_region *region, int x, int y) {
  region->pixels++;
  region->left = x < region->left ? x : region->left;
  region->right = x + 1 > region->right ? x + 1 : region->right;
  region->top = y < region->top ? y : region->top;
  region->bottom = y + 1 > region->bottom ? y + 1 : region->bottom;
}

static clt_region fill(flood *f, int start) {
  static const int steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  int width = f->map->width, height = f->map->height;
  clt_region region = {.fate = f->map->fate[start], .left = width, .top = height};
  size_t depth = 0;
  for (int b = 0; b < 2 * CLT_GRAY_BITS_MAX; b++) {
    f->bits[b] = 0;
  }
  f->seen[start] = 1;
  f->stack[depth++] = start;
  while (depth > 0) {
    int at = f->stack[--depth], x = at % width, y = at / width;
    grow(&region, x, y);
    f->bits[f->detail[at]]++;
    for (int k = 0; k < 4; k++) {
      int u = x + steps[k][0], v = y + steps[k][1], to = v * width + u;
      if (u >= 0 && v >= 0 && u < width && v < height && !f->seen[to] && f->map->fate[to] == region.fate) {
        f->seen[to] = 1;
        f->stack[depth++] = to;
      }
    }
  }
  return region;
}

/* "ambiguous": which stripes, and how wide. */
static void explain_bit(const flood *f, char *text, size_t size) {
  int worst = 0;
  for (int b = 1; b < 2 * CLT_GRAY_BITS_MAX; b++) {
    worst = f->bits[b] > f->bits[worst] ? b : worst;
  }
  snprintf(text, size, "ambiguous: the %s stripes of %d panel pixels (bit %d) do not stand out of the noise",
           worst < CLT_GRAY_BITS_MAX ? "columns'" : "rows'", 2 << worst % CLT_GRAY_BITS_MAX, worst % CLT_GRAY_BITS_MAX);
}

static void explain(const flood *f, clt_region *region) {
  static const char *const reasons[CLT_PIXEL_FATES] = {
      "decoded",
      "unlit: too little of the projector's light (shadow, a dark surface, or beyond the picture)",
      "saturated: a sample reached the camera's full scale; expose shorter",
      "",
      "outside: codes beyond the panel, as light by way of a mirror or noise makes them",
      "isolated: at odds with its neighbours, as at an edge in depth",
      "double: stripes of two places at once (an edge in depth, a mirror, or light from other surfaces)"};
  char reason[CLT_REGION_TEXT / 2 + 20];
  snprintf(reason, sizeof reason, "%s", reasons[region->fate]);
  if (region->fate == CLT_PIXEL_AMBIGUOUS) {
    explain_bit(f, reason, sizeof reason);
  }
  snprintf(region->text, sizeof region->text, "%ld pixels within (%d, %d)-(%d, %d): %s", region->pixels, region->left,
           region->top, region->right - 1, region->bottom - 1, reason);
}

/* Keeps the list in descending size. */
static void keep(clt_regions *regions, const clt_region *region) {
  int place = regions->count;
  while (place > 0 && regions->region[place - 1].pixels < region->pixels) {
    place--;
  }
  if (place == CLT_REGIONS_MAX) {
    regions->others++;
    return;
  }
  regions->others += regions->count == CLT_REGIONS_MAX;
  regions->count += regions->count < CLT_REGIONS_MAX;
  for (int k = regions->count - 1; k > place; k--) {
    regions->region[k] = regions->region[k - 1];
  }
  regions->region[place] = *region;
}

clt_status clt_regions_find(const clt_pixel_map *map, const uint8_t *detail, long least, clt_regions *regions,
                            clt_error *error) {
  size_t pixels = (size_t)map->width * (size_t)map->height;
  flood f = {.map = map,
             .detail = detail,
             .seen = clt_alloc(pixels, sizeof *f.seen),
             .stack = clt_alloc(pixels, sizeof *f.stack)};
  clt_status status = CLT_OK;
  *regions = (clt_regions){0};
  if (f.seen == NULL || f.stack == NULL) {
    status = clt_fail(error, CLT_FAILED, "out of memory for the regions of %zu pixels", pixels);
  }
  for (size_t i = 0; status == CLT_OK && i < pixels; i++) {
    if (map->fate[i] != CLT_PIXEL_DECODED && !f.seen[i]) {
      clt_region region = fill(&f, (int)i);
      if (region.pixels >= least) {
        explain(&f, &region);
        keep(regions, &region);
      }
    }
  }
  free(f.seen);
  free(f.stack);
  return status;
}
