#include "rig/footprint.h"

#include <stdlib.h>

#include "base/memory.h"

clt_status clt_footprints_align(int grid_width, int grid_height, int camera_width, int camera_height,
                                clt_footprints *footprints, clt_error *error) {
  int k = camera_width / grid_width;
  if (k < 1 || camera_width != k * grid_width || camera_height != k * grid_height) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the camera's %d x %d pixels are not a whole multiple, the same in both directions, of the grid's "
                    "%d x %d cells; choose another grid",
                    camera_width, camera_height, grid_width, grid_height);
  }
  size_t cells = (size_t)grid_width * (size_t)grid_height, pixels = (size_t)k * (size_t)k;
  *footprints = (clt_footprints){.cells = cells,
                                 .start = clt_alloc(cells + 1, sizeof *footprints->start),
                                 .pixel = clt_alloc(cells * pixels, sizeof *footprints->pixel)};
  if (footprints->start == NULL || footprints->pixel == NULL) {
    clt_footprints_finish(footprints);
    return clt_fail(error, CLT_FAILED, "out of memory for the footprints of %zu cells", cells);
  }
  for (size_t i = 0; i < cells; i++) {
    int left = k * (int)(i % (size_t)grid_width), top = k * (int)(i / (size_t)grid_width);
    int32_t *pixel = footprints->pixel + i * pixels;
    for (int p = 0; p < k * k; p++) {
      pixel[p] = (top + p / k) * camera_width + left + p % k;
    }
    footprints->start[i + 1] = (int64_t)((i + 1) * pixels);
  }
  return CLT_OK;
}

void clt_footprints_finish(clt_footprints *footprints) {
  free(footprints->start);
  free(footprints->pixel);
  free(footprints->weight);
  *footprints = (clt_footprints){0};
}
