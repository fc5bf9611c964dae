/* Footprints: which camera pixels see which grid cell. */
#ifndef CLT_RIG_FOOTPRINT_H
#define CLT_RIG_FOOTPRINT_H

#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"
#include "rig/geometry/pixel_map.h"

/* Pixels of cell i (row-major grid order) are pixel[start[i]] .. pixel[start[i + 1] - 1], each y * camera width + x. A
 * cell that the camera does not see has none. Owned by the struct; a zeroed one is valid and empty. */
typedef struct clt_footprints {
  size_t cells;
  int64_t *start;
  int32_t *pixel;
  float *weight; /* parallel to pixel, > 0; NULL: all alike */
} clt_footprints;

/* What a pixel map tells of a cell. */
typedef enum clt_cell_fate {
  CLT_CELL_SEEN,
  CLT_CELL_UNSEEN, /* no decoded pixel: in shadow, or hidden from the camera */
  CLT_CELL_DOUBLE  /* seen at two places of the camera's picture: a mirror, or an edge in depth */
} clt_cell_fate;

typedef struct clt_footprint_report {
  long count[CLT_CELL_DOUBLE + 1]; /* cells of each fate */
  double pixels;                   /* of a cell that is seen, mean; several cells may share one */
} clt_footprint_report;

/* The footprints of a camera that sees the grid magnified by a whole factor k: k x k pixels a cell, row-major within
 * the cell. CLT_BAD_INPUT with both sizes where camera is not k times grid in both directions. */
clt_status clt_footprints_align(int grid_width, int grid_height, int camera_width, int camera_height,
                                clt_footprints *footprints, clt_error *error);

/* The footprints by a pixel map whose panel is a whole multiple of the grid. A pixel is taken as a square of pitch x
 * pitch panel pixels around its coordinate, and counts for each cell by the share of it that lies there, times its
 * confidence. fate[i] (cells values, or NULL) and report are filled. CLT_BAD_INPUT where the grid does not divide the
 * panel. */
clt_status clt_footprints_map(const clt_pixel_map *map, double pitch, int grid_width, int grid_height,
                              clt_footprints *footprints, uint8_t *fate, clt_footprint_report *report,
                              clt_error *error);
void clt_footprints_finish(clt_footprints *footprints);

#endif
