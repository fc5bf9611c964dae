/* What a pass over an item has in hand: vectors of eight lanes, a strip on its way down, and what is known of its
 * cells. Vectors are those of the compiler: it breaks them up where the processor has shorter ones, and sums stay in
 * registers.
 */
#ifndef CLT_SOLVE_LIVE_LANES_H
#define CLT_SOLVE_LIVE_LANES_H

#include <string.h>

#include "solve/live_far.h"

#define INLINE static inline __attribute__((always_inline)) /* into each variant */

enum { LANES = CLT_LIVE_LANES };
typedef float lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef int32_t marks __attribute__((vector_size(LANES * sizeof(int32_t)))); /* all bits or none */
typedef uint32_t unsigned_marks __attribute__((vector_size(LANES * sizeof(int32_t))));

/* Vectors pass by pointers: how they pass by value depends on the processor. */
INLINE void take(lanes *to, const float *from) {
  memcpy(to, from, sizeof *to);
}

/* The halves of pairs. */
INLINE void take_upper(lanes *to, const marks *pair) {
  *to = __builtin_convertvector(*pair & ~0xffff, lanes);
}

INLINE void take_lower(lanes *to, const marks *pair) {
  *to = __builtin_convertvector((marks)((unsigned_marks)*pair << 16), lanes);
}

/* The first `count` lanes; 0 in the others. */
INLINE void take_part(lanes *to, const float *from, int32_t count) {
  if (count == LANES) {
    memcpy(to, from, sizeof *to);
    return;
  }
  float part[LANES] = {0};
  for (int32_t l = 0; l < count; l++) {
    part[l] = from[l];
  }
  memcpy(to, part, sizeof *to);
}

INLINE void put_part(float *to, const lanes *from, int32_t count) {
  if (count == LANES) {
    memcpy(to, from, sizeof *from);
    return;
  }
  float part[LANES];
  memcpy(part, from, sizeof part);
  for (int32_t l = 0; l < count; l++) {
    to[l] = part[l];
  }
}

/* Where a vector is one register (`whole`), a comparison of floats is one operation. Where it is several, compilers
 * take it apart lane by lane: then the bits are compared, whose order as whole numbers is that of floats from 0 on.
 * What comes out is the same. */
INLINE void mark_negative(marks *to, const unsigned_marks *bits) {
  *to = (marks)*bits >> 31;
}

/* Where a value of 0 or more is not 0. */
INLINE void mark_positive(marks *to, const lanes *value, bool whole) {
  const unsigned_marks below = 0 - (unsigned_marks)*value;
  if (whole) {
    *to = *value > (lanes){0};
  } else {
    mark_negative(to, &below);
  }
}

/* Where a value is 0 or less, or 1 or more. */
INLINE void mark_beyond(marks *to, const lanes *value, bool whole) {
  const lanes none = {0}, one = none + 1;
  const unsigned_marks bits = (unsigned_marks)*value, most = (unsigned_marks)one - 1;
  const unsigned_marks beyond = bits | (bits - 1) | (most - bits);
  if (whole) {
    *to = (*value <= none) | (*value >= one);
  } else {
    mark_negative(to, &beyond);
  }
}

INLINE void clip(lanes *value, bool whole) {
  const lanes none = {0}, one = none + 1;
  const unsigned_marks sign = (unsigned_marks)*value;
  marks low, high;
  if (whole) {
    low = *value <= none;
    high = *value > one;
  } else {
    mark_negative(&low, &sign);
    const unsigned_marks above = (unsigned_marks)one - (unsigned_marks)((marks)*value & ~low);
    mark_negative(&high, &above);
  }
  *value = (lanes)(((marks)*value & ~low & ~high) | ((marks)one & high));
}

/* A strip of an item on its way down some rows. */
typedef struct strip {
  int32_t row, end, count; /* of the leaf; and how many of its lanes are cells */
  size_t at, place;        /* in a plane of all channels, and among strips of rows */
  lanes u;
} strip;

/* Strips are taken in the order in which they are packed: the first of an item, and the one after each. */
INLINE void begin_strip(const clt_far *far, const clt_live_item *item, const clt_leaf *leaf, int32_t top,
                        int32_t across, strip *s) {
  const int32_t left = leaf->width - across;
  s->row = top;
  s->end = top + clt_live_rows_below(leaf, top);
  s->count = left < LANES ? left : LANES;
  s->at =
      (size_t)item->channel * far->cells + (size_t)(leaf->y + top) * (size_t)far->width + (size_t)(leaf->x + across);
  take(&s->u, far->place + CLT_LEAF_SIDE_MAX * leaf->width + across);
}

/* What a bilinear function is along a row. */
INLINE void spread(lanes *to, const float term[CLT_LEAF_TERMS], float v, const lanes *u) {
  *to = (term[0] + v * term[2]) + (term[1] + v * term[3]) * *u;
}

/* Sums of a value over the rows of a strip, by columns: with 1 and with v. */
typedef struct columns {
  lanes even, tilted;
} columns;

INLINE void add(columns *to, const lanes *value, float v) {
  to->even += *value;
  to->tilted += v * *value;
}

/* Sums over an item with 1, u, v and u v, lane by lane. */
typedef struct terms {
  lanes of[CLT_LEAF_TERMS];
} terms;

INLINE void add_columns(terms *to, const columns *sums, const lanes *u) {
  to->of[0] += sums->even;
  to->of[1] += sums->even * *u;
  to->of[2] += sums->tilted;
  to->of[3] += sums->tilted * *u;
}

INLINE float fold(const lanes *sums) {
  const lanes s = *sums;
  return ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
}

INLINE void fold_terms(const terms *sums, float unit, float out[CLT_LEAF_TERMS]) {
  for (int t = 0; t < CLT_LEAF_TERMS; t++) {
    out[t] = unit * fold(&sums->of[t]);
  }
}

INLINE double fold_plain(const lanes *sums) {
  double sum = 0;
  for (int l = 0; l < LANES; l++) {
    sum += (double)(*sums)[l];
  }
  return sum;
}

/* An item as a pass goes over it, in locals: what is written through pointers cannot be these. Gather, black, flood and
 * near light are multiples of units, which are put to what they are multiplied with, and to sums. */
typedef struct view {
  const clt_live_strip *strip;
  const float *scale, *diagonal, *x, *target; /* scale and diagonal may be NULL; the last two lie as pictures */
  float *shown;
  const int32_t *spill;
  const unsigned char *code;
  const float *places; /* of rows */
  size_t width;
  int32_t bounded;         /* marks that are set where bounds hold */
  float black, unit, mean; /* units of black and of spill; and the drive's mean */
  float far[CLT_LEAF_TERMS], pull[CLT_LEAF_TERMS], turn[CLT_LEAF_TERMS];
  bool pulled; /* pull is not 0 */
  bool whole;  /* vectors are one register each */
  const ptrdiff_t *offset;
  bool scattered;
} view;

INLINE void see(const clt_far *far, const clt_live_item *item, const clt_leaf *leaf, bool whole, view *w) {
  const float *pull = item->pull, gather = item->unit[CLT_LIVE_GATHER];
  *w = (view){.strip = far->strip,
              .scale = far->scale,
              .diagonal = item->damped ? far->diagonal : NULL,
              .x = far->drive[far->now],
              .target = far->target,
              .shown = far->shown,
              .spill = far->spill + item->block * LANES,
              .code = far->code + item->code,
              .places = far->place + CLT_LEAF_SIDE_MAX * leaf->height,
              .width = (size_t)far->width,
              .bounded = far->open ? 0 : -1,
              .black = item->unit[CLT_LIVE_BLACK],
              .unit = item->unit[CLT_LIVE_SPILL],
              .mean = far->mean[item->channel],
              .pulled = pull[0] != 0 || pull[1] != 0 || pull[2] != 0 || pull[3] != 0,
              .whole = whole,
              .offset = far->offset,
              .scattered = far->scattered};
  for (int t = 0; t < CLT_LEAF_TERMS; t++) {
    w->far[t] = item->far[t];
    w->turn[t] = item->turn[t];
    w->pull[t] = gather * pull[t];
  }
}

INLINE void next_row(const view *w, strip *s) {
  s->row++;
  s->at += w->width;
  s->place++;
}

/* Asks memory for what is read of a strip of a row that comes later, into the second cache: streams begin anew with
 * every page. */
enum { AHEAD = 32, SECOND = 2 };
INLINE void foresee_strip(const view *w, const strip *s) {
  __builtin_prefetch(w->strip + s->place + AHEAD, 0, SECOND);
  __builtin_prefetch(w->shown + (s->place + AHEAD) * LANES, 0, SECOND);
}

/* The next pair of spill, likewise. */
INLINE void take_pair(view *w, lanes *upper, lanes *lower) {
  marks pair;
  __builtin_prefetch(w->spill + 2 * AHEAD * LANES, 0, SECOND);
  memcpy(&pair, w->spill, sizeof pair);
  take_upper(upper, &pair);
  take_lower(lower, &pair);
  w->spill += LANES;
}

/* What spills over to the rows that a strip is about to go down, as a multiple of the unit: flood, and near light O x.
 */
INLINE void take_spill(view *w, const strip *s, lanes spill[CLT_LIVE_ROWS]) {
  const float *x = w->x + s->at;
  for (int32_t row = 0; row < s->end - s->row; row += 2) {
    take_pair(w, &spill[row], &spill[row + 1]);
    spill[row] *= w->mean;
    spill[row + 1] *= w->mean;
  }
  const unsigned char *code = w->code + 1, *end = code + 2 * *w->code;
  for (; code < end; code += 2) {
    lanes upper, lower, from, beside;
    take_pair(w, &upper, &lower);
    take(&from, x + w->offset[code[0]]);
    take(&beside, x + w->offset[code[1]]);
    spill[code[0] / CLT_LIVE_AROUND] += upper * from;
    spill[code[1] / CLT_LIVE_AROUND] += lower * beside;
  }
  w->code = end;
}

/* near = O x over a strip of a row where it comes from anywhere. */
INLINE void add_near(const clt_far *far, const clt_live_item *item, const strip *s, lanes *near) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const size_t base = (size_t)item->channel * far->cells;
  const float *x = far->drive[far->now] + base;
  const float *value = own->value + (size_t)item->channel * (size_t)own->start[far->cells];
  for (int32_t l = 0; l < s->count; l++) {
    const size_t cell = s->at - base + (size_t)l;
    float sum = 0;
    for (int64_t e = own->start[cell]; e < own->start[cell + 1]; e++) {
      sum += value[e] * x[own->cell[e]];
    }
    (*near)[l] = sum;
  }
}

/* What passes know of a strip of a row. */
typedef struct cells {
  lanes own, inverse, gather, black, scale, x; /* inverse: 1 / D */
  marks lit;
} cells;

INLINE void take_cells(const view *w, const strip *s, cells *c) {
  const lanes one = (lanes){0} + 1;
  const clt_live_strip *constant = &w->strip[s->place];
  marks pair;
  foresee_strip(w, s);
  memcpy(&pair, constant->pair, sizeof pair);
  take_upper(&c->gather, &pair);
  take_lower(&c->black, &pair);
  take(&c->own, constant->own);
  take(&c->x, w->x + s->at);
  lanes diagonal = c->own;
  if (w->diagonal != NULL) {
    take(&diagonal, w->diagonal + s->place * LANES);
  }
  mark_positive(&c->lit, &diagonal, w->whole);
  c->inverse = (lanes)((marks)(one / diagonal) & c->lit);
  c->scale = one;
  if (w->scale != NULL) {
    take(&c->scale, w->scale + s->place * LANES);
  }
}

/* The target, and b, which is 0 at dark cells. */
INLINE void want(const view *w, const strip *s, const cells *c, lanes *target, lanes *wanted) {
  take_part(target, w->target + s->at, s->count);
  *wanted = (lanes)((marks)(*target - w->black * c->black) & c->lit);
}

/* r of the light that is known. */
INLINE void leave(const view *w, const strip *s, const cells *c, lanes *target, lanes *wanted, lanes *r) {
  lanes light;
  take(&light, w->shown + s->place * LANES);
  want(w, s, c, target, wanted);
  *r = *wanted - light;
}

/* to = r + P pull / D, which is what a cell goes by. */
INLINE void add_pull(const view *w, const strip *s, const cells *c, float v, lanes *to) {
  if (w->pulled) {
    lanes pull;
    spread(&pull, w->pull, v, &s->u);
    *to += c->gather * c->inverse * pull;
  }
}

/* The drive to which a cell would go from r, and where it is held at a bound. */
INLINE void wish_for(const view *w, const strip *s, const cells *c, float v, const lanes *r, lanes *wish, marks *held) {
  lanes by = *r;
  add_pull(w, s, c, v, &by);
  *wish = c->x + c->inverse * by;
  mark_beyond(held, wish, w->whole);
  *held &= c->lit & w->bounded;
}

#endif
