/* Where on the panel the light comes from that each camera pixel sees. */
#ifndef CLT_RIG_GEOMETRY_PIXEL_MAP_H
#define CLT_RIG_GEOMETRY_PIXEL_MAP_H

#include <stdint.h>

#include "counterlight/image.h"
#include "counterlight/status.h"

/* What became of a camera pixel. */
typedef enum clt_pixel_fate {
  CLT_PIXEL_DECODED,
  CLT_PIXEL_UNLIT,     /* too little of the projector's light for this camera's noise */
  CLT_PIXEL_SATURATED, /* a sample at the camera's full scale */
  CLT_PIXEL_AMBIGUOUS, /* a stripe that the noise drowns, or stripes too fine to be placed well */
  CLT_PIXEL_OUTSIDE,   /* a code beyond the panel */
  CLT_PIXEL_ISOLATED,  /* at odds with its neighbours, or without enough of them */
  CLT_PIXEL_DOUBLE,    /* stripes of two places at once: an edge in depth, a mirror, light from other surfaces */
  CLT_PIXEL_FATES
} clt_pixel_fate;

/* A map owns its four arrays, each [y * width + x]. A zeroed one is valid and empty. */
typedef struct clt_pixel_map {
  int width, height; /* camera */
  int panel_width, panel_height;
  float *x, *y; /* panel coordinates of each camera pixel's centre, panel pixels: pixel k spans [k, k+1); NaN where not
                   decoded */
  float *confidence; /* 0..1: 1 / (1 + (s / 0.25)^2) with s the standard deviation of x and y together; 0 where not
                        decoded */
  uint8_t *fate;     /* clt_pixel_fate */
} clt_pixel_map;

/* Allocates a map whose pixels are all unlit. */
clt_status clt_pixel_map_init(clt_pixel_map *map, int width, int height, int panel_width, int panel_height,
                              clt_error *error);
void clt_pixel_map_finish(clt_pixel_map *map); /* accepts an empty one */
/* Gives a pixel a fate other than decoded. */
void clt_pixel_map_mask(clt_pixel_map *map, size_t pixel, clt_pixel_fate fate);
/* "decoded", "unlit", ... */
const char *clt_pixel_fate_name(clt_pixel_fate fate);
/* Confidence of coordinates whose variances (panel pixels, squared) sum to variance. */
float clt_pixel_confidence(double variance);

/* x, y and confidence as an image of three channels. out is initialised here. */
clt_status clt_pixel_map_image(const clt_pixel_map *map, clt_image *out, clt_error *error);
/* A picture to look at: decoded pixels coloured by their place on the panel (red grows to the right, green downwards, a
 * dark line every sixteenth of the panel), masked ones by their fate: unlit black, saturated white, ambiguous blue,
 * outside magenta, isolated yellow, double cyan. out is initialised here. */
clt_status clt_pixel_map_coverage(const clt_pixel_map *map, clt_image *out, clt_error *error);

#endif
