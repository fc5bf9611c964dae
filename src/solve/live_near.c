/* What cells next door add, by directions: where every near entry joins a cell with one of its eight neighbours, the
 * entries of a row of cells stand as one row for each direction, which passes over rows read as they read everything
 * else. The rows of all directions follow each other: planes of a power of two cells would share a few cache lines. */
#include <stdlib.h>

#include "base/memory.h"
#include "solve/live_far.h"

/* The direction 0..7 from cell i to cell j in reading order, or -1 where they are no neighbours. */
static int direction_of(const clt_far *far, size_t i, size_t j) {
  const long width = far->width;
  const long across = (long)j % width - (long)i % width, down = (long)j / width - (long)i / width;
  const int place = (int)(3 * (down + 1) + across + 1), middle = CLT_LIVE_AROUND / 2;
  return labs(across) > 1 || labs(down) > 1 || place == middle ? -1 : place - (place > middle);
}

static bool joins_neighbours(const clt_far *far) {
  const clt_hierarchy_storage *own = far->hierarchy;
  for (size_t i = 0; i < far->cells; i++) {
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      if (direction_of(far, i, (size_t)own->cell[e]) < 0) {
        return false;
      }
    }
  }
  return true;
}

clt_status clt_live_spread_near(clt_far *far, size_t channels, clt_error *error) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const size_t width = (size_t)far->width;
  if (!joins_neighbours(far)) {
    return CLT_OK;
  }
  far->spill = clt_alloc(CLT_LIVE_AROUND * channels, far->cells * sizeof *far->spill);
  if (far->spill == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for the near light of %zu cells", far->cells);
  }
  for (size_t c = 0; c < channels; c++) {
    const float *value = own->value + c * (size_t)own->start[far->cells];
    for (size_t i = 0; i < far->cells; i++) {
      const size_t line = (c * far->cells + i) / width;
      for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
        const size_t direction = (size_t)direction_of(far, i, (size_t)own->cell[e]);
        far->spill[(line * CLT_LIVE_AROUND + direction) * width + i % width] += value[e];
      }
    }
  }
  return CLT_OK;
}
