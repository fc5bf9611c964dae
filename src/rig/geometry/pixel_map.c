#include "rig/geometry/pixel_map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { GRID_LINES = 16 };
#define CONFIDENT_SD 0.25 /* panel pixels, at which the confidence is a half */

clt_status clt_pixel_map_init(clt_pixel_map *map, int width, int height, int panel_width, int panel_height,
                              clt_error *error) {
  size_t pixels = (size_t)width * (size_t)height;
  *map = (clt_pixel_map){.width = width,
                         .height = height,
                         .panel_width = panel_width,
                         .panel_height = panel_height,
                         .x = clt_alloc(pixels, sizeof *map->x),
                         .y = clt_alloc(pixels, sizeof *map->y),
                         .confidence = clt_alloc(pixels, sizeof *map->confidence),
                         .fate = clt_alloc(pixels, sizeof *map->fate)};
  if (map->x == NULL || map->y == NULL || map->confidence == NULL || map->fate == NULL) {
    clt_pixel_map_finish(map);
    return clt_fail(error, CLT_FAILED, "out of memory for the map of %d x %d camera pixels", width, height);
  }
  for (size_t i = 0; i < pixels; i++) {
    clt_pixel_map_mask(map, i, CLT_PIXEL_UNLIT);
  }
  return CLT_OK;
}

void clt_pixel_map_finish(clt_pixel_map *map) {
  free(map->x);
  free(map->y);
  free(map->confidence);
  free(map->fate);
  *map = (clt_pixel_map){0};
}

void clt_pixel_map_mask(clt_pixel_map *map, size_t pixel, clt_pixel_fate fate) {
  map->x[pixel] = map->y[pixel] = NAN;
  map->confidence[pixel] = 0;
  map->fate[pixel] = (uint8_t)fate;
}

const char *clt_pixel_fate_name(clt_pixel_fate fate) {
  static const char *const names[] = {"decoded", "unlit", "saturated", "ambiguous", "outside", "isolated", "double"};
  return (unsigned)fate < CLT_PIXEL_FATES ? names[fate] : "unknown";
}

float clt_pixel_confidence(double variance) {
  return (float)(1 / (1 + variance / (CONFIDENT_SD * CONFIDENT_SD)));
}

clt_status clt_pixel_map_image(const clt_pixel_map *map, clt_image *out, clt_error *error) {
  clt_status status = clt_image_init(out, 3, map->height, map->width, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t pixels = (size_t)map->width * (size_t)map->height;
  memcpy(out->data, map->x, pixels * sizeof *map->x);
  memcpy(out->data + pixels, map->y, pixels * sizeof *map->y);
  memcpy(out->data + 2 * pixels, map->confidence, pixels * sizeof *map->confidence);
  return CLT_OK;
}

/* Linear light of a decoded pixel: the place on the panel, dimmed on the grid's lines. */
static void paint_place(const clt_pixel_map *map, size_t i, float colour[3]) {
  float across = map->x[i] / (float)map->panel_width, down = map->y[i] / (float)map->panel_height;
  bool line = fmodf(across * GRID_LINES, 1) < 0.06F || fmodf(down * GRID_LINES, 1) < 0.1F;
  float light = line ? 0.35F : 1;
  colour[0] = light * (0.05F + 0.8F * across);
  colour[1] = light * (0.05F + 0.8F * down);
  colour[2] = light * 0.25F * (1 - across);
}

clt_status clt_pixel_map_coverage(const clt_pixel_map *map, clt_image *out, clt_error *error) {
  static const float colours[CLT_PIXEL_FATES][3] = {{0, 0, 0}, {0, 0, 0},    {1, 1, 1},      {0.1F, 0.2F, 1},
                                                    {1, 0, 1}, {1, 0.9F, 0}, {0, 0.9F, 0.9F}};
  clt_status status = clt_image_init(out, 3, map->height, map->width, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t pixels = (size_t)map->width * (size_t)map->height;
  for (size_t i = 0; i < pixels; i++) {
    float colour[3];
    memcpy(colour, colours[map->fate[i]], sizeof colour);
    if (map->fate[i] == CLT_PIXEL_DECODED) {
      paint_place(map, i, colour);
    }
    for (size_t c = 0; c < 3; c++) {
      out->data[c * pixels + i] = colour[c];
    }
  }
  return CLT_OK;
}
