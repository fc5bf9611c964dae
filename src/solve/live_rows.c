/* Passes over the cells of a leaf, strip by strip of eight cells, some rows down each. */
#include <math.h>
#include <string.h>

#include "base/variants.h"
#include "solve/live_lanes.h"

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
  clip(&within, w->whole);
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
  enum { LINE = 16 };
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

INLINE void pass(const clt_far *far, clt_live_item *item, bool aims, bool whole) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const clt_live_item *next = next_item(far, item);
  look_sums sums = {0};
  strip s = {.place = item->first};
  view w;
  see(far, item, &leaf, whole, &w);
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
  clip(&to, w->whole);
  put_part(next + s->at, &to, s->count);
  const lanes gives = c.gather * to;
  add(given, &gives, v);
  *light += (lanes)((marks)to & c.lit);
}

INLINE void move(const clt_far *far, clt_live_item *item, float *next, bool whole) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const clt_live_item *behind = next_item(far, item);
  terms given = {0};
  lanes light = {0};
  strip s = {.place = item->first};
  view w;
  see(far, item, &leaf, whole, &w);
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

INLINE void weigh(const clt_far *far, clt_live_item *item, bool whole) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const clt_live_item *next = next_item(far, item);
  const float gather = item->unit[CLT_LIVE_GATHER], unit[3] = {gather, gather * gather, 1};
  lanes moment[3][CLT_LIVE_MOMENTS] = {0};
  strip s = {.place = item->first};
  view w;
  see(far, item, &leaf, whole, &w);
  for (int32_t top = 0; top < leaf.height; top += CLT_LIVE_ROWS) {
    foresee(far, next, w.x, top, foreseen(&leaf, top));
    if (w.bounded) {
      foresee(far, next, w.target, top, foreseen(&leaf, top));
    }
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
#define VARIANT(name, whole, attributes)                                                                               \
  attributes static void aim_##name(const clt_far *far, clt_live_item *item) {                                         \
    pass(far, item, true, whole);                                                                                      \
  }                                                                                                                    \
  attributes static void look_##name(const clt_far *far, clt_live_item *item) {                                        \
    pass(far, item, false, whole);                                                                                     \
  }                                                                                                                    \
  attributes static void move_##name(const clt_far *far, clt_live_item *item, float *next) {                           \
    move(far, item, next, whole);                                                                                      \
  }                                                                                                                    \
  attributes static void weigh_##name(const clt_far *far, clt_live_item *item) {                                       \
    weigh(far, item, whole);                                                                                           \
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
VARIANT(portable, false, )

#if defined(__x86_64__)
/* Vectors of eight as they are; no fused operations, so that the bits of a drive do not depend on the processor. */
static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

#define NEEDS_avx2 "AVX2"
VARIANT(avx2, true, __attribute__((target("avx2"))))

static bool has_avx512(void) {
  return __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq");
}

#define NEEDS_avx512 "AVX-512"
VARIANT(avx512, true, __attribute__((target("avx512f,avx512vl,avx512dq"))))

const clt_live_kernels *const clt_live_variants[] = {&avx512, &avx2, &portable, NULL};
#else
const clt_live_kernels *const clt_live_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_live_choose, clt_live_kernels, clt_live_variants)
