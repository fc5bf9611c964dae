/* Masked parts of a pixel map in words: where, how large, and why. */
#ifndef CLT_RIG_GEOMETRY_REGIONS_H
#define CLT_RIG_GEOMETRY_REGIONS_H

#include "rig/geometry/decode.h"

enum { CLT_REGIONS_MAX = 24, CLT_REGION_TEXT = 200 };

/* A connected set (of 4 neighbours) of pixels of one fate. */
typedef struct clt_region {
  clt_pixel_fate fate;
  long pixels;
  int left, top, right, bottom; /* camera pixels, right and bottom excluded */
  char text[CLT_REGION_TEXT];   /* "12034 pixels around (1200, 300): unlit: ..." */
} clt_region;

typedef struct clt_regions {
  int count; /* the largest, in descending size */
  clt_region region[CLT_REGIONS_MAX];
  long others; /* smaller regions of at least the wanted size that found no place in the list */
} clt_regions;

/* Lists the regions of at least `least` pixels. detail as clt_decode leaves it. */
clt_status clt_regions_find(const clt_pixel_map *map, const uint8_t *detail, long least, clt_regions *regions,
                            clt_error *error);

#endif
