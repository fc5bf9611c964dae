/* Passes over the cells of a leaf, strip by strip of eight cells, down the rows. Vectors are those of the compiler: it
 * breaks them up where the processor has shorter ones, and their sums stay in registers. */
#include <math.h>
#include <string.h>

#include "base/variants.h"
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

INLINE void clip(lanes *value) {
  const lanes none = {0}, one = none + 1;
  *value = (lanes)((marks)*value & (*value > none));
  const marks below = *value < one;
  *value = (lanes)(((marks)*value & below) | ((marks)one & ~below));
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
  const ptrdiff_t *offset;
  bool scattered;
} view;

INLINE void see(const clt_far *far, const clt_live_item *item, const clt_leaf *leaf, view *w) {
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

/* What spills over to the rows that a strip is about to go down, as a multiple of the unit: flood, and near light O x.
 */
INLINE void take_spill(view *w, const strip *s, lanes spill[CLT_LIVE_ROWS]) {
  const float *x = w->x + s->at;
  for (int32_t row = 0; row < s->end - s->row; row += 2, w->spill += LANES) {
    marks pair;
    memcpy(&pair, w->spill, sizeof pair);
    take_upper(&spill[row], &pair);
    take_lower(&spill[row + 1], &pair);
    spill[row] *= w->mean;
    spill[row + 1] *= w->mean;
  }
  const unsigned char *code = w->code + 1, *end = code + 2 * *w->code;
  for (; code < end; code += 2, w->spill += LANES) {
    marks pair;
    lanes upper, lower, from, beside;
    memcpy(&pair, w->spill, sizeof pair);
    take_upper(&upper, &pair);
    take_lower(&lower, &pair);
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
  const lanes none = {0}, one = none + 1;
  const clt_live_strip *constant = &w->strip[s->place];
  marks pair;
  memcpy(&pair, constant->pair, sizeof pair);
  take_upper(&c->gather, &pair);
  take_lower(&c->black, &pair);
  take(&c->own, constant->own);
  take(&c->x, w->x + s->at);
  lanes diagonal = c->own;
  if (w->diagonal != NULL) {
    take(&diagonal, w->diagonal + s->place * LANES);
  }
  c->lit = diagonal > none;
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
  const lanes none = {0}, one = none + 1;
  lanes by = *r;
  add_pull(w, s, c, v, &by);
  *wish = c->x + c->inverse * by;
  *held = ((*wish <= none) | (*wish >= one)) & c->lit & w->bounded;
}

/* What is added up over some rows of a strip, and over an item. */
typedef struct look_columns {
  columns give, take, whole, held;
} look_columns;
typedef struct look_sums {
  terms give, take, whole, held;
  lanes residual, gap, size, seen;
} look_sums;

/* From r on: what a cell does and how far the bounds let it go. */
INLINE void judge(const view *w, const strip *s, const cells *c, float v, const lanes *r, look_columns *down,
                  look_sums *sums) {
  const lanes none = {0}, one = none + 1;
  lanes wish;
  marks held;
  wish_for(w, s, c, v, r, &wish, &held);
  lanes within = wish;
  clip(&within);
  const lanes bounded = c->own * (within - c->x), step = w->bounded ? within - c->x : wish - c->x;
  const lanes give = c->gather * step, whole = c->scale * *r, rest = c->scale * (*r - c->own * step);
  const lanes holds = (lanes)((marks)one & held);
  add(&down->give, &give, v);
  add(&down->take, &rest, v);
  add(&down->whole, &whole, v);
  add(&down->held, &holds, v);
  sums->residual += *r * *r;
  sums->gap += bounded * bounded;
}

/* The target's part of a strip of a row: r from the light that is known. */
INLINE void aim_row(const view *w, const strip *s, const cells *c, look_sums *sums, lanes *r) {
  lanes target, wanted;
  leave(w, s, c, &target, &wanted, r);
  sums->size += target * (lanes)((marks)target & c->lit); /* not a number where a dark cell's target is none */
  sums->seen += wanted * wanted;
}

/* The light of the drive over a strip of a row, and r from it; the far light is bilinear along it. */
INLINE void look_row(const clt_far *far, const clt_live_item *item, const view *w, const strip *s, const cells *c,
                     float v, const lanes *spill, look_sums *sums, lanes *r) {
  lanes target, wanted, light, near = {0};
  if (w->scattered) {
    add_near(far, item, s, &near);
  }
  spread(&light, w->far, v, &s->u);
  light = c->own * c->x + (near + w->unit * *spill) + c->scale * light;
  light = (lanes)((marks)light & c->lit);
  memcpy(w->shown + s->place * LANES, &light, sizeof light);
  want(w, s, c, &target, &wanted);
  *r = wanted - light;
  sums->seen += light * light;
}

/* The item that a thread most likely takes after this one. */
INLINE const clt_live_item *next_item(const clt_far *far, const clt_live_item *item) {
  return item + 1 < far->item + far->items ? item + 1 : item;
}

/* Asks memory for some of a plane's rows over an item to come, which lie too far apart to be foreseen; into the second
 * cache, for in the first they would push each other out. `plane` is of all channels. */
INLINE void foresee(const clt_far *far, const clt_live_item *item, const float *plane, int32_t row, int32_t end) {
  enum { LINE = 16, SECOND = 2 };
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const float *at = plane + (size_t)item->channel * far->cells + (size_t)(leaf.y + row) * (size_t)far->width;
  for (int32_t k = row; k < end && k < leaf.height; k++, at += far->width) {
    for (int32_t across = 0; across < leaf.width; across += LINE) {
      __builtin_prefetch(at + leaf.x + across, 0, SECOND);
    }
  }
}

/* The rows of the next item to ask for while this one's from `top` on are passed over. */
INLINE int32_t foreseen(const clt_leaf *leaf, int32_t top) {
  return top + CLT_LIVE_ROWS < leaf->height ? top + CLT_LIVE_ROWS : CLT_LEAF_SIDE_MAX;
}

INLINE void tell(const look_sums *sums, bool aims, clt_live_item *item) {
  fold_terms(&sums->give, item->unit[CLT_LIVE_GATHER], item->give);
  fold_terms(&sums->take, 1, item->take);
  fold_terms(&sums->whole, 1, item->whole);
  fold_terms(&sums->held, 1, item->held);
  item->residual = fold_plain(&sums->residual);
  item->gap = fold_plain(&sums->gap);
  *(aims ? &item->wanted : &item->seen) = fold_plain(&sums->seen);
  item->size = aims ? fold_plain(&sums->size) : item->size;
}

INLINE void pass(const clt_far *far, clt_live_item *item, bool aims) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const clt_live_item *next = next_item(far, item);
  look_sums sums = {0};
  strip s = {.place = item->first};
  view w;
  see(far, item, &leaf, &w);
  for (int32_t top = 0; top < leaf.height; top += CLT_LIVE_ROWS) {
    foresee(far, next, w.x, top, foreseen(&leaf, top));
    foresee(far, next, w.target, top, foreseen(&leaf, top));
    for (int32_t across = 0; across < leaf.width; across += LANES) {
      look_columns down = {0};
      lanes spill[CLT_LIVE_ROWS];
      begin_strip(far, item, &leaf, top, across, &s);
      if (!aims) {
        take_spill(&w, &s, spill);
      }
      for (; s.row < s.end; next_row(&w, &s)) {
        const float v = w.places[s.row];
        cells c;
        lanes r;
        take_cells(&w, &s, &c);
        if (aims) {
          aim_row(&w, &s, &c, &sums, &r);
        } else {
          look_row(far, item, &w, &s, &c, v, &spill[s.row - top], &sums, &r);
        }
        judge(&w, &s, &c, v, &r, &down, &sums);
      }
      add_columns(&sums.give, &down.give, &s.u);
      add_columns(&sums.take, &down.take, &s.u);
      add_columns(&sums.whole, &down.whole, &s.u);
      add_columns(&sums.held, &down.held, &s.u);
    }
  }
  tell(&sums, aims, item);
}

INLINE void move_row(const view *w, const strip *s, float v, float *next, columns *given, lanes *light) {
  lanes target, wanted, by, turn;
  cells c;
  take_cells(w, s, &c);
  leave(w, s, &c, &target, &wanted, &by);
  spread(&turn, w->turn, v, &s->u);
  by -= c.scale * turn;
  add_pull(w, s, &c, v, &by);
  lanes to = c.x + c.inverse * by;
  clip(&to);
  put_part(next + s->at, &to, s->count);
  const lanes gives = c.gather * to;
  add(given, &gives, v);
  *light += (lanes)((marks)to & c.lit);
}

INLINE void move(const clt_far *far, clt_live_item *item, float *next) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const clt_live_item *behind = next_item(far, item);
  terms given = {0};
  lanes light = {0};
  strip s = {.place = item->first};
  view w;
  see(far, item, &leaf, &w);
  for (int32_t top = 0; top < leaf.height; top += CLT_LIVE_ROWS) {
    foresee(far, behind, w.x, top, foreseen(&leaf, top));
    foresee(far, behind, w.target, top, foreseen(&leaf, top));
    foresee(far, behind, next, top, foreseen(&leaf, top));
    for (int32_t across = 0; across < leaf.width; across += LANES) {
      columns down = {0};
      for (begin_strip(far, item, &leaf, top, across, &s); s.row < s.end; next_row(&w, &s)) {
        move_row(&w, &s, w.places[s.row], next, &down, &light);
      }
      add_columns(&given, &down, &s.u);
    }
  }
  fold_terms(&given, item->unit[CLT_LIVE_GATHER], item->given);
  item->light = fold_plain(&light);
}

/* The sums of one weight with v^0, v^1 and v^2. */
typedef struct powers {
  lanes of[3];
} powers;

INLINE void add_powers(powers *to, const lanes *weight, float v) {
  to->of[0] += *weight;
  to->of[1] += v * *weight;
  to->of[2] += v * v * *weight;
}

/* One row of the weights v k / D and (v / D)^2 where cells are free, k^2 where they are held. */
INLINE void weigh_row(const view *w, const strip *s, float v, powers sums[3]) {
  lanes target, wanted, wish, r = {0};
  cells c;
  marks held;
  take_cells(w, s, &c);
  if (w->bounded) { /* else no cell is held, whatever is left, and there may be no target */
    leave(w, s, &c, &target, &wanted, &r);
  }
  wish_for(w, s, &c, v, &r, &wish, &held);
  const lanes free = (lanes)((marks)(c.gather * c.inverse) & ~held), bound = (lanes)((marks)c.scale & held);
  const lanes both = free * c.scale, pulled = free * free, pushed = bound * bound;
  add_powers(&sums[0], &both, v);
  add_powers(&sums[1], &pulled, v);
  add_powers(&sums[2], &pushed, v);
}

INLINE void weigh(const clt_far *far, clt_live_item *item) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const float gather = item->unit[CLT_LIVE_GATHER], unit[3] = {gather, gather * gather, 1};
  lanes moment[3][CLT_LIVE_MOMENTS] = {0};
  strip s = {.place = item->first};
  view w;
  see(far, item, &leaf, &w);
  for (int32_t top = 0; top < leaf.height; top += CLT_LIVE_ROWS) {
    for (int32_t across = 0; across < leaf.width; across += LANES) {
      powers sums[3] = {0};
      for (begin_strip(far, item, &leaf, top, across, &s); s.row < s.end; next_row(&w, &s)) {
        weigh_row(&w, &s, w.places[s.row], sums);
      }
      for (int k = 0; k < 3 * 3; k++) {
        const lanes *sum = &sums[k / 3].of[k % 3];
        lanes *to = moment[k / 3] + 3 * (k % 3);
        to[0] += *sum;
        to[1] += *sum * s.u;
        to[2] += *sum * s.u * s.u;
      }
    }
  }
  for (int k = 0; k < 3 * CLT_LIVE_MOMENTS; k++) {
    const int weight = k / CLT_LIVE_MOMENTS, m = k % CLT_LIVE_MOMENTS;
    item->weight[weight][m] = unit[weight] * fold(&moment[weight][m]);
  }
}

/* Every pass once for each kind of processor. */
#define VARIANT(name, attributes)                                                                                      \
  attributes static void aim_##name(const clt_far *far, clt_live_item *item) {                                         \
    pass(far, item, true);                                                                                             \
  }                                                                                                                    \
  attributes static void look_##name(const clt_far *far, clt_live_item *item) {                                        \
    pass(far, item, false);                                                                                            \
  }                                                                                                                    \
  attributes static void move_##name(const clt_far *far, clt_live_item *item, float *next) {                           \
    move(far, item, next);                                                                                             \
  }                                                                                                                    \
  attributes static void weigh_##name(const clt_far *far, clt_live_item *item) {                                       \
    weigh(far, item);                                                                                                  \
  }                                                                                                                    \
  static const clt_live_kernels name = {.needs = NEEDS_##name,                                                         \
                                        .runs_here = has_##name,                                                       \
                                        .aim = aim_##name,                                                             \
                                        .look = look_##name,                                                           \
                                        .move = move_##name,                                                           \
                                        .weigh = weigh_##name};

static bool has_portable(void) {
  return true;
}

#define NEEDS_portable NULL
VARIANT(portable, )

#if defined(__x86_64__)
/* Vectors of eight as they are; no fused operations, so that the bits of a drive do not depend on the processor. */
static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

#define NEEDS_avx2 "AVX2"
VARIANT(avx2, __attribute__((target("avx2"))))

static bool has_avx512(void) {
  return __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq");
}

#define NEEDS_avx512 "AVX-512"
VARIANT(avx512, __attribute__((target("avx512f,avx512vl,avx512dq,prefer-vector-width=256"))))

const clt_live_kernels *const clt_live_variants[] = {&avx512, &avx2, &portable, NULL};
#else
const clt_live_kernels *const clt_live_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_live_choose, clt_live_kernels, clt_live_variants)
