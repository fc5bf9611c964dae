/* What passes over a hierarchy read, laid out as they read it: leaf by leaf, strip by strip, row by row. Planes of a
 * power of two cells, one beside the other, would share a few cache lines, and rows of a picture break off where a leaf
 * ends. */
#include <stdlib.h>

#include "base/memory.h"
#include "solve/live_far.h"

enum { LANES = CLT_LIVE_LANES };

/* A strip of a row of an item: where its cells begin in a plane, and how many there are. */
typedef struct strip {
  size_t cell;
  int32_t count;
} strip;

static int32_t strips_of(const clt_leaf *leaf) {
  return (leaf->width + LANES - 1) / LANES;
}

static strip strip_of(const clt_far *far, const clt_leaf *leaf, int32_t number) {
  const int32_t across = number / leaf->height * LANES, row = number % leaf->height;
  const int32_t left = leaf->width - across;
  return (strip){(size_t)(leaf->y + row) * (size_t)far->width + (size_t)(leaf->x + across),
                 left < LANES ? left : LANES};
}

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

static void pack_constants(clt_far *far, const clt_live_item *item, const float *inverse) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const clt_leaf *leaf = &own->leaf[item->leaf];
  const size_t base = (size_t)item->channel * far->cells;
  for (int32_t number = 0; number < strips_of(leaf) * leaf->height; number++) {
    const strip at = strip_of(far, leaf, number);
    float *to = far->constant + (item->first + (size_t)number) * CLT_LIVE_PLANES * LANES;
    for (size_t l = 0; l < (size_t)at.count; l++) {
      const size_t cell = base + at.cell + l;
      if (inverse[cell] > 0) {
        to[CLT_LIVE_OWN * LANES + l] = own->own[cell];
        to[CLT_LIVE_INVERSE * LANES + l] = inverse[cell];
        to[CLT_LIVE_SCALE * LANES + l] = own->scale[cell];
        to[CLT_LIVE_GATHER * LANES + l] = own->gather[cell];
        to[CLT_LIVE_FLOOD * LANES + l] = own->flood[cell];
      }
    }
  }
}

/* Which directions the lit cells of a strip have near light from. */
static unsigned directions_of(const clt_far *far, strip at, const float *inverse) {
  const clt_hierarchy_storage *own = far->hierarchy;
  unsigned all = 0;
  for (size_t i = at.cell; i < at.cell + (size_t)at.count; i++) {
    for (int64_t e = own->start[i]; inverse[i] > 0 && e < own->start[i + 1]; e++) {
      all |= 1u << direction_of(far, i, (size_t)own->cell[e]);
    }
  }
  return all;
}

static size_t count_ones(unsigned bits) {
  size_t count = 0;
  for (; bits != 0; bits &= bits - 1) {
    count++;
  }
  return count;
}

static void pack_near(clt_far *far, const clt_live_item *item, const float *inverse) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const clt_leaf *leaf = &own->leaf[item->leaf];
  const float *value = own->value + (size_t)item->channel * (size_t)own->start[far->cells];
  const float *lit = inverse + (size_t)item->channel * far->cells;
  float *to = far->spill + item->block * LANES;
  for (int32_t number = 0; number < strips_of(leaf) * leaf->height; number++) {
    const strip at = strip_of(far, leaf, number);
    const unsigned around = far->around[item->first + (size_t)number];
    for (size_t l = 0; l < (size_t)at.count; l++) {
      const size_t i = at.cell + l;
      for (int64_t e = own->start[i]; lit[i] > 0 && e < own->start[i + 1]; e++) {
        const unsigned direction = 1u << direction_of(far, i, (size_t)own->cell[e]);
        to[count_ones(around & (direction - 1)) * LANES + l] += value[e];
      }
    }
    to += count_ones(around) * LANES;
  }
}

/* Finds where every item's strips and blocks of near light begin, and how many blocks there are. */
static void find_places(clt_far *far, const float *inverse, bool near) {
  size_t strips = 0, blocks = 0;
  for (size_t k = 0; k < far->items; k++) {
    clt_live_item *item = &far->item[k];
    const clt_leaf *leaf = &far->hierarchy->leaf[item->leaf];
    item->first = strips;
    item->block = blocks;
    for (int32_t number = 0; near && number < strips_of(leaf) * leaf->height; number++) {
      const unsigned around =
          directions_of(far, strip_of(far, leaf, number), inverse + (size_t)item->channel * far->cells);
      far->around[strips + (size_t)number] = (unsigned char)around;
      blocks += count_ones(around);
    }
    strips += (size_t)(strips_of(leaf) * leaf->height);
  }
  far->blocks = blocks;
}

static size_t count_strips(const clt_far *far) {
  size_t strips = 0;
  for (size_t k = 0; k < far->items; k++) {
    const clt_leaf *leaf = &far->hierarchy->leaf[far->item[k].leaf];
    strips += (size_t)(strips_of(leaf) * leaf->height);
  }
  return strips;
}

static clt_status fail(const clt_far *far, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "no memory for moving pictures of %zu cells", far->cells);
}

static clt_status reserve(clt_far *far, clt_error *error) {
  const size_t values = (size_t)far->channels * far->cells, lanes = far->strips * LANES;
  const size_t margin = (size_t)far->width + 1 + LANES, drive = values + 2 * margin;
  far->constant = clt_alloc(lanes, CLT_LIVE_PLANES * sizeof *far->constant);
  far->vectors = clt_alloc(2 * lanes + 3 * drive, sizeof *far->vectors);
  if (far->constant == NULL || far->vectors == NULL) {
    return fail(far, error);
  }
  far->wanted = far->vectors;
  far->shown = far->vectors + lanes;
  for (size_t k = 0; k < 3; k++) {
    far->drive[k] = far->vectors + 2 * lanes + k * drive + margin;
  }
  return CLT_OK;
}

clt_status clt_live_pack(clt_far *far, const float *inverse, clt_error *error) {
  const bool near = joins_neighbours(far);
  far->strips = count_strips(far);
  clt_status status = reserve(far, error);
  if (status != CLT_OK) {
    return status;
  }
  far->around = near ? clt_alloc(far->strips, 1) : NULL;
  if (near && far->around == NULL) {
    return fail(far, error);
  }
  find_places(far, inverse, near);
  far->spill = near ? clt_alloc(far->blocks + 1, LANES * sizeof *far->spill) : NULL;
  if (near && far->spill == NULL) {
    return fail(far, error);
  }
  for (size_t k = 0; k < far->items; k++) {
    pack_constants(far, &far->item[k], inverse);
    if (near) {
      pack_near(far, &far->item[k], inverse);
    }
  }
  return CLT_OK;
}
