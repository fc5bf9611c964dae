/* What cells next door add, as planes: where every near entry joins a cell with one of its eight neighbours, entries of
 * one direction stand in a plane over the cells, which passes over rows read as they read everything else. */
#include <stdlib.h>

#include "base/memory.h"
#include "solve/live_far.h"

enum { AROUND = 9 };

/* The direction 0..8 from cell i to cell j, or -1 where they are no neighbours. */
static int direction_of(const clt_far *far, size_t i, size_t j) {
  const long width = far->width;
  const long across = (long)j % width - (long)i % width, down = (long)j / width - (long)i / width;
  return labs(across) <= 1 && labs(down) <= 1 ? (int)(3 * (down + 1) + across + 1) : -1;
}

/* Counts the entries of every direction; false where one has none. */
static bool count_directions(const clt_far *far, size_t count[AROUND]) {
  const clt_hierarchy_storage *own = far->hierarchy;
  for (size_t i = 0; i < far->cells; i++) {
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      const int direction = direction_of(far, i, (size_t)own->cell[e]);
      if (direction < 0) {
        return false;
      }
      count[direction]++;
    }
  }
  return true;
}

static void fill_planes(clt_far *far, size_t channels, const int plane_of[AROUND]) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const size_t values = channels * far->cells;
  for (size_t c = 0; c < channels; c++) {
    const float *value = own->value + c * (size_t)own->start[far->cells];
    for (size_t i = 0; i < far->cells; i++) {
      for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
        const int plane = plane_of[direction_of(far, i, (size_t)own->cell[e])];
        far->spill[(size_t)plane * values + c * far->cells + i] += value[e];
      }
    }
  }
}

clt_status clt_live_spread_near(clt_far *far, size_t channels, clt_error *error) {
  size_t count[AROUND] = {0};
  int plane_of[AROUND] = {0};
  if (!count_directions(far, count)) {
    return CLT_OK;
  }
  for (int k = 0; k < AROUND; k++) {
    plane_of[k] = far->directions;
    if (count[k] > 0) {
      far->shift[far->directions++] = (k / 3 - 1) * (ptrdiff_t)far->width + k % 3 - 1;
    }
  }
  far->spill = clt_alloc((size_t)far->directions * channels, far->cells * sizeof *far->spill);
  if (far->spill == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for the near light of %zu cells", far->cells);
  }
  fill_planes(far, channels, plane_of);
  return CLT_OK;
}
