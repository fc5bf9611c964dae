/* What passes over a hierarchy read, laid out as they read it: leaf by leaf, strip by strip, row by row. Planes of a
 * power of two cells, one beside the other, would share a few cache lines, and rows of a picture break off where a leaf
 * ends. */
#include <float.h>
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

/* The unit by which the largest is MOST; 0 where it would lose digits, and what is so small is none. */
static float unit_for(float most) {
  const float unit = most / MOST / HALF;
  return unit >= FLT_MIN ? unit : 0;
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

/* What spills over to some rows of a strip. */
typedef struct spilled {
  int32_t rows, count;                /* count: of codes that occur */
  unsigned char code[CLT_LIVE_CODES]; /* direction by direction, so that a row is not added to twice at once */
  float flood[CLT_LIVE_ROWS][LANES], near[CLT_LIVE_CODES][LANES]; /* near light by code */
} spilled;

/* The rows of a strip that begin with the item's number'th strip of a row. */
static void find_spilled(const clt_far *far, const clt_live_item *item, int32_t number, const float *diagonal,
                         spilled *found) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const clt_leaf *leaf = leaf_of(far, item);
  const float *flood = own->flood + (size_t)item->channel * far->cells;
  const float *value = own->value + (size_t)item->channel * (size_t)own->start[far->cells];
  bool occurs[CLT_LIVE_CODES] = {false};
  *found = (spilled){.rows = clt_live_rows_below(leaf, clt_live_spot_of(leaf, number).row)};
  for (int32_t k = 0; k < found->rows * LANES; k++) {
    const strip at = strip_of(far, leaf, number + k / LANES);
    const size_t i = at.cell + (size_t)(k % LANES);
    if (k % LANES < at.count && diagonal[i] > 0) {
      found->flood[k / LANES][k % LANES] = flood[i];
      for (int64_t e = own->start[i]; !far->scattered && e < own->start[i + 1]; e++) {
        const int32_t code = k / LANES * CLT_LIVE_AROUND + direction_of(far, i, (size_t)own->cell[e]);
        found->near[code][k % LANES] += value[e];
        occurs[code] = true;
      }
    }
  }
  for (int32_t k = 0; k < CLT_LIVE_CODES; k++) {
    const int32_t code = k % CLT_LIVE_ROWS * CLT_LIVE_AROUND + k / CLT_LIVE_ROWS;
    if (occurs[code]) {
      found->code[found->count++] = (unsigned char)code;
    }
  }
}

static int32_t pairs_of(int32_t count) {
  return (count + 1) / 2;
}

/* Finds where an item's spill begins and its unit; from there on the next one's. */
static void measure_spill(clt_far *far, clt_live_item *item, const float *diagonal) {
  const clt_leaf *leaf = leaf_of(far, item);
  float most = 0;
  spilled found;
  item->block = far->blocks;
  item->code = far->codes;
  for (int32_t number = 0; number < strips_of(leaf); number += found.rows) {
    find_spilled(far, item, number, diagonal, &found);
    for (int32_t k = 0; k < LANES * (found.rows + found.count); k++) {
      const int32_t row = k / LANES, lane = k % LANES;
      most = fmaxf(most,
                   fabsf(row < found.rows ? found.flood[row][lane] : found.near[found.code[row - found.rows]][lane]));
    }
    far->blocks += (size_t)(pairs_of(found.rows) + pairs_of(found.count));
    far->codes += (size_t)(1 + 2 * pairs_of(found.count));
  }
  item->unit[CLT_LIVE_SPILL] = unit_for(most);
}

/* Lanes of two; lower may be NULL. */
static int32_t *put_pair(int32_t *to, float unit, const float *upper, const float *lower) {
  for (int32_t l = 0; l < LANES; l++) {
    *to++ = pair_of(whole(upper[l], unit), lower != NULL ? whole(lower[l], unit) : 0);
  }
  return to;
}

static void pack_spill(clt_far *far, const clt_live_item *item, const float *diagonal) {
  const clt_leaf *leaf = leaf_of(far, item);
  const float unit = item->unit[CLT_LIVE_SPILL];
  int32_t *to = far->spill + item->block * LANES;
  unsigned char *code = far->code + item->code;
  spilled found;
  for (int32_t number = 0; number < strips_of(leaf); number += found.rows) {
    find_spilled(far, item, number, diagonal, &found);
    for (int32_t row = 0; row < found.rows; row += 2) {
      to = put_pair(to, unit, found.flood[row], row + 1 < found.rows ? found.flood[row + 1] : NULL);
    }
    *code++ = (unsigned char)pairs_of(found.count);
    for (int32_t k = 0; k < found.count; k += 2, code += 2) {
      const bool paired = k + 1 < found.count;
      code[0] = found.code[k];
      code[1] = paired ? found.code[k + 1] : 0;
      to = put_pair(to, unit, found.near[code[0]], paired ? found.near[code[1]] : NULL);
    }
  }
}

static void find_places(clt_far *far, const float *diagonal) {
  for (size_t k = 0; k < far->items; k++) {
    clt_live_item *item = &far->item[k];
    item->first = far->strips;
    far->strips += (size_t)strips_of(leaf_of(far, item));
    measure_spill(far, item, diagonal + (size_t)item->channel * far->cells);
  }
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
  far->strip = clt_alloc_large(far->strips, sizeof *far->strip);
  far->spill = clt_alloc_large(far->blocks, LANES * sizeof *far->spill);
  far->code = clt_alloc(far->codes, 1);
  far->vectors = clt_alloc_large(lanes + 3 * drive, sizeof *far->vectors);
  far->scale = scaled ? clt_alloc_large(lanes, sizeof *far->scale) : NULL;
  far->diagonal = damped ? clt_alloc_large(lanes, sizeof *far->diagonal) : NULL;
  if (far->strip == NULL || far->spill == NULL || far->code == NULL || far->vectors == NULL ||
      (scaled && far->scale == NULL) || (damped && far->diagonal == NULL)) {
    return fail(far, error);
  }
  place_drives(far, margin, drive);
  return CLT_OK;
}

static void tabulate_places(clt_far *far) {
  for (int32_t side = 1; side <= CLT_LEAF_SIDE_MAX; side++) {
    for (int32_t k = 0; k < CLT_LEAF_SIDE_MAX; k++) {
      far->place[CLT_LEAF_SIDE_MAX * side + k] = (float)clt_leaf_place(k, side);
    }
  }
  for (int32_t code = 0; code < CLT_LIVE_CODES; code++) {
    const int32_t direction = code % CLT_LIVE_AROUND, place = direction + (direction >= CLT_LIVE_AROUND / 2);
    far->offset[code] = (ptrdiff_t)(code / CLT_LIVE_AROUND + place / 3 - 1) * far->width + place % 3 - 1;
  }
}

clt_status clt_live_pack(clt_far *far, const float *diagonal, const float *const *black, clt_error *error) {
  far->scattered = !joins_neighbours(far);
  far->strips = far->blocks = far->codes = 0;
  tabulate_places(far);
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
  free(far->code);
  free(far->spill);
}
