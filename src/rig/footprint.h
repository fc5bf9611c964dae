/* Footprints: which camera pixels see which grid cell. */
#ifndef CLT_RIG_FOOTPRINT_H
#define CLT_RIG_FOOTPRINT_H

#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"

/* Pixels of cell i (row-major grid order) are pixel[start[i]] .. pixel[start[i + 1] - 1], each y * camera width + x. A
 * cell that the camera does not see has none. Owned by the struct; a zeroed one is valid and empty. */
typedef struct clt_footprints {
  size_t cells;
  int64_t *start;
  int32_t *pixel;
} clt_footprints;

/* The footprints of a camera that sees the grid magnified by a whole factor k: k x k pixels a cell, row-major within
 * the cell. CLT_BAD_INPUT with both sizes where camera is not k times grid in both directions. */
clt_status clt_footprints_align(int grid_width, int grid_height, int camera_width, int camera_height,
                                clt_footprints *footprints, clt_error *error);
void clt_footprints_finish(clt_footprints *footprints);

#endif
