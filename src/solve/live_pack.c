/* What passes over a hierarchy read, laid out as they read it: leaf by leaf, strip by strip, row by row. Planes of a
 * power of two cells, one beside the other, would share a few cache lines, and rows of a picture break off where a leaf
 * ends. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "solve/live_far.h"

enum { LANES = CLT_LIVE_LANES, MOST = INT16_MAX, HALF = 1 << 16 };

/* A strip of a row of an item: where its cells begin in a plane, and how many there are. */
typedef struct strip {
  size_t cell;
  int32_t count;
} strip;

static int32_t strips_of(const clt_leaf *leaf) {
  return clt_live_across(leaf) * leaf->height;
}

static const clt_leaf *leaf_of(const clt_far *far, const clt_live_item *item) {
  return &far->hierarchy->leaf[item->leaf];
}

static strip strip_of(const clt_far *far, const clt_leaf *leaf, int32_t number) {
  const clt_live_spot spot = clt_live_spot_of(leaf, number);
  const int32_t left = leaf->width - spot.across;
  return (strip){(size_t)(leaf->y + spot.row) * (size_t)far->width + (size_t)(leaf->x + spot.across),
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

/* Two whole numbers of 16 bits in a word: passes find each of them as that many times HALF. */
static int32_t pair_of(int32_t upper, int32_t lower) {
  return upper * HALF + (lower & (HALF - 1));
}

static int32_t whole(float value, float unit) {
  return unit > 0 ? (int32_t)lrintf(value / (unit * HALF)) : 0;
}

static float unit_for(float most) {
  return most / MOST / HALF;
}

static clt_status fail(const clt_far *far, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "no memory for moving pictures of %zu cells", far->cells);
}

/* The unit of a plane over an item's lit cells. */
static float unit_of(const clt_far *far, const clt_live_item *item, const float *diagonal, const float *plane) {
  const clt_leaf *leaf = leaf_of(far, item);
  float most = 0;
  for (int32_t k = 0; k < leaf->width * leaf->height; k++) {
    const size_t cell = (size_t)(leaf->y + k / leaf->width) * (size_t)far->width + (size_t)(leaf->x + k % leaf->width);
    most = diagonal[cell] > 0 ? fmaxf(most, fabsf(plane[cell])) : most;
  }
  return unit_for(most);
}

static void pack_strips(clt_far *far, clt_live_item *item, const float *diagonal, const float *black) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const size_t base = (size_t)item->channel * far->cells;
  const clt_leaf *leaf = leaf_of(far, item);
  const float *gather = own->gather + base, *scale = own->scale + base;
  item->unit[CLT_LIVE_GATHER] = unit_of(far, item, diagonal, gather);
  item->unit[CLT_LIVE_BLACK] = unit_of(far, item, diagonal, black);
  for (int32_t number = 0; number < strips_of(leaf); number++) {
    const strip at = strip_of(far, leaf, number);
    const size_t place = item->first + (size_t)number;
    clt_live_strip *to = &far->strip[place];
    for (size_t l = 0; l < (size_t)at.count; l++) {
      const size_t cell = at.cell + l;
      if (diagonal[cell] > 0) {
        to->own[l] = own->own[base + cell];
        to->pair[l] =
            pair_of(whole(gather[cell], item->unit[CLT_LIVE_GATHER]), whole(black[cell], item->unit[CLT_LIVE_BLACK]));
        if (far->scale != NULL) {
          far->scale[place * LANES + l] = scale[cell];
        }
      }
    }
  }
}

/* Which directions the lit cells of a strip have near light from. */
static unsigned directions_of(const clt_far *far, strip at, const float *diagonal) {
  const clt_hierarchy_storage *own = far->hierarchy;
  unsigned all = 0;
  for (size_t i = at.cell; i < at.cell + (size_t)at.count; i++) {
    for (int64_t e = own->start[i]; diagonal[i] > 0 && e < own->start[i + 1]; e++) {
      all |= 1u << direction_of(far, i, (size_t)own->cell[e]);
    }
  }
  return all;
}

static int32_t count_ones(unsigned bits) {
  int32_t count = 0;
  for (; bits != 0; bits &= bits - 1) {
    count++;
  }
  return count;
}

/* What spills over to a strip of a row: lanes of flood, and of each direction that it has near light from. */
typedef struct spill_lanes {
  float of[(1 + CLT_LIVE_AROUND) * LANES];
  int32_t count; /* of lanes */
} spill_lanes;

static spill_lanes spill_of(const clt_far *far, const clt_live_item *item, int32_t number, const float *diagonal) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const float *flood = own->flood + (size_t)item->channel * far->cells;
  const float *value = own->value + (size_t)item->channel * (size_t)own->start[far->cells];
  const strip at = strip_of(far, leaf_of(far, item), number);
  const unsigned around = far->around != NULL ? far->around[item->first + (size_t)number] : 0;
  spill_lanes spill = {.count = LANES * (1 + count_ones(around))};
  for (int32_t l = 0; l < at.count; l++) {
    const size_t i = at.cell + (size_t)l;
    spill.of[l] = diagonal[i] > 0 ? flood[i] : 0;
    for (int64_t e = own->start[i]; far->around != NULL && diagonal[i] > 0 && e < own->start[i + 1]; e++) {
      const unsigned direction = 1u << direction_of(far, i, (size_t)own->cell[e]);
      spill.of[(1 + count_ones(around & (direction - 1))) * LANES + l] += value[e];
    }
  }
  return spill;
}

static void measure_spill(const clt_far *far, clt_live_item *item, const float *diagonal) {
  float flood = 0, near = 0;
  for (int32_t number = 0; number < strips_of(leaf_of(far, item)); number++) {
    const spill_lanes spill = spill_of(far, item, number, diagonal);
    for (int32_t k = 0; k < spill.count; k++) {
      float *most = k < LANES ? &flood : &near;
      *most = fmaxf(*most, fabsf(spill.of[k]));
    }
  }
  item->unit[CLT_LIVE_FLOOD] = unit_for(flood);
  item->unit[CLT_LIVE_NEAR] = unit_for(near);
}

static void pack_spill(clt_far *far, clt_live_item *item, const float *diagonal) {
  int32_t *to = far->spill + item->block * LANES;
  measure_spill(far, item, diagonal);
  for (int32_t number = 0; number < strips_of(leaf_of(far, item)); number++) {
    const spill_lanes spill = spill_of(far, item, number, diagonal);
    for (int32_t k = 0; k < spill.count; k += 2 * LANES) {
      const float unit = item->unit[k < LANES ? CLT_LIVE_FLOOD : CLT_LIVE_NEAR];
      for (int32_t l = k; l < k + LANES; l++) {
        const bool paired = l + LANES < spill.count;
        *to++ = pair_of(whole(spill.of[l], unit), paired ? whole(spill.of[l + LANES], item->unit[CLT_LIVE_NEAR]) : 0);
      }
    }
  }
}

/* Finds where every item's strips and blocks begin, and how many there are. */
static void find_places(clt_far *far, const float *diagonal) {
  size_t strips = 0, blocks = 0;
  for (size_t k = 0; k < far->items; k++) {
    clt_live_item *item = &far->item[k];
    const clt_leaf *leaf = leaf_of(far, item);
    item->first = strips;
    item->block = blocks;
    for (int32_t number = 0; number < strips_of(leaf); number++, strips++) {
      unsigned around = 0;
      if (far->around != NULL) {
        around = directions_of(far, strip_of(far, leaf, number), diagonal + (size_t)item->channel * far->cells);
        far->around[strips] = (unsigned char)around;
      }
      blocks += (size_t)(2 + count_ones(around)) / 2;
    }
  }
  far->blocks = blocks;
}

/* Whether D is something else than `own` at any lit cell of an item. */
static bool is_damped(const clt_far *far, const clt_live_item *item, const float *diagonal) {
  const clt_leaf *leaf = leaf_of(far, item);
  const float *own = far->hierarchy->own + (size_t)item->channel * far->cells;
  for (int32_t number = 0; number < strips_of(leaf); number++) {
    const strip at = strip_of(far, leaf, number);
    for (size_t i = at.cell; i < at.cell + (size_t)at.count; i++) {
      if (diagonal[i] > 0 && diagonal[i] != own[i]) {
        return true;
      }
    }
  }
  return false;
}

static void pack_diagonal(clt_far *far, const clt_live_item *item, const float *diagonal) {
  const clt_leaf *leaf = leaf_of(far, item);
  for (int32_t number = 0; number < strips_of(leaf); number++) {
    const strip at = strip_of(far, leaf, number);
    memcpy(far->diagonal + (item->first + (size_t)number) * LANES, diagonal + at.cell,
           (size_t)at.count * sizeof *diagonal);
  }
}

static bool is_scaled(const clt_far *far) {
  for (size_t at = 0; at < (size_t)far->channels * far->cells; at++) {
    if (far->hierarchy->scale[at] != 1) {
      return true;
    }
  }
  return false;
}

static bool any_is_damped(clt_far *far, const float *diagonal) {
  bool any = false;
  for (size_t k = 0; k < far->items; k++) {
    clt_live_item *item = &far->item[k];
    item->damped = is_damped(far, item, diagonal + (size_t)item->channel * far->cells);
    any = any || item->damped;
  }
  return any;
}

/* Drives do not begin at the same place of a page, where rows of all of them would share a few cache lines. */
static void place_drives(clt_far *far, size_t margin, size_t drive) {
  for (size_t k = 0; k < 3; k++) {
    far->drive[k] = far->vectors + k * drive + margin;
  }
  far->shown = far->vectors + 3 * drive;
}

static clt_status reserve(clt_far *far, const float *diagonal, clt_error *error) {
  enum { PAGE = 1024, APART = 304 /* values */ };
  const size_t values = (size_t)far->channels * far->cells, lanes = far->strips * LANES;
  const size_t margin = ((size_t)far->width + 1 + LANES + PAGE - 1) / PAGE * PAGE;
  const size_t drive = (values + 2 * margin + PAGE - 1) / PAGE * PAGE + APART;
  const bool scaled = is_scaled(far), damped = any_is_damped(far, diagonal);
  far->strip = clt_alloc(far->strips, sizeof *far->strip);
  far->spill = clt_alloc(far->blocks, LANES * sizeof *far->spill);
  far->vectors = clt_alloc(lanes + 3 * drive, sizeof *far->vectors);
  far->scale = scaled ? clt_alloc(lanes, sizeof *far->scale) : NULL;
  far->diagonal = damped ? clt_alloc(lanes, sizeof *far->diagonal) : NULL;
  if (far->strip == NULL || far->spill == NULL || far->vectors == NULL || (scaled && far->scale == NULL) ||
      (damped && far->diagonal == NULL)) {
    return fail(far, error);
  }
  place_drives(far, margin, drive);
  return CLT_OK;
}

static size_t count_strips(const clt_far *far) {
  size_t strips = 0;
  for (size_t k = 0; k < far->items; k++) {
    strips += (size_t)strips_of(leaf_of(far, &far->item[k]));
  }
  return strips;
}

static void tabulate_places(clt_far *far) {
  for (int32_t side = 1; side <= CLT_LEAF_SIDE_MAX; side++) {
    for (int32_t k = 0; k < CLT_LEAF_SIDE_MAX; k++) {
      far->place[CLT_LEAF_SIDE_MAX * side + k] = (float)clt_leaf_place(k, side);
    }
  }
}

clt_status clt_live_pack(clt_far *far, const float *diagonal, const float *const *black, clt_error *error) {
  const bool near = joins_neighbours(far);
  tabulate_places(far);
  far->strips = count_strips(far);
  far->around = near ? clt_alloc(far->strips, 1) : NULL;
  if (near && far->around == NULL) {
    return fail(far, error);
  }
  find_places(far, diagonal);
  const clt_status status = reserve(far, diagonal, error);
  for (size_t k = 0; status == CLT_OK && k < far->items; k++) {
    clt_live_item *item = &far->item[k];
    const float *lit = diagonal + (size_t)item->channel * far->cells;
    pack_strips(far, item, lit, black[item->channel]);
    pack_spill(far, item, lit);
    if (item->damped) {
      pack_diagonal(far, item, lit);
    }
  }
  return status;
}

void clt_live_unpack(clt_far *far) {
  free(far->strip);
  free(far->scale);
  free(far->diagonal);
  free(far->vectors);
  free(far->around);
  free(far->spill);
}
