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

/* Vectors pass by pointers: how they pass by value depends on the processor. */
INLINE void take(lanes *to, const float *from) {
  memcpy(to, from, sizeof *to);
}

INLINE void take_plane(lanes *to, const float *constant, clt_live_plane plane) {
  memcpy(to, constant + (size_t)plane * LANES, sizeof *to);
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

/* A strip of an item on its way down the rows. */
typedef struct strip {
  int32_t count;          /* of its lanes that are cells */
  size_t cell, at, place; /* in a plane of a channel and of all channels, and among strips of rows */
  size_t width;           /* of the grid: from row to row */
  lanes u;
} strip;

INLINE void begin_strip(const clt_far *far, const clt_live_item *item, const clt_leaf *leaf, int32_t across, strip *s) {
  const int32_t left = leaf->width - across;
  s->count = left < LANES ? left : LANES;
  s->width = (size_t)far->width;
  s->cell = (size_t)leaf->y * s->width + (size_t)(leaf->x + across);
  s->at = (size_t)item->channel * far->cells + s->cell;
  s->place = item->first + (size_t)(across / LANES * leaf->height);
  for (int32_t l = 0; l < LANES; l++) {
    s->u[l] = (float)clt_leaf_place(across + l, leaf->width);
  }
}

INLINE void next_row(strip *s) {
  s->cell += s->width;
  s->at += s->width;
  s->place++;
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

INLINE void fold(const columns *sums, const lanes *u, float out[CLT_LEAF_TERMS]) {
  const lanes across = sums->even * *u, both = sums->tilted * *u;
  for (int l = 0; l < LANES; l++) {
    out[0] += sums->even[l];
    out[1] += across[l];
    out[2] += sums->tilted[l];
    out[3] += both[l];
  }
}

INLINE double fold_plain(const lanes *sums) {
  double sum = 0;
  for (int l = 0; l < LANES; l++) {
    sum += (double)(*sums)[l];
  }
  return sum;
}

/* near = O x over a strip of a row; *spill moves on. */
INLINE void add_spill(const clt_far *far, const strip *s, const float **spill, lanes *near) {
  const ptrdiff_t line = (ptrdiff_t)s->width;
  const ptrdiff_t offset[CLT_LIVE_AROUND] = {-line - 1, -line, -line + 1, -1, 1, line - 1, line, line + 1};
  const float *x = far->drive[far->now] + s->at;
  for (unsigned around = far->around[s->place]; around != 0; around &= around - 1) {
    lanes share, light;
    take(&share, *spill);
    take(&light, x + offset[__builtin_ctz(around)]);
    *near += share * light;
    *spill += LANES;
  }
}

/* The same where near light comes from anywhere. */
INLINE void add_near(const clt_far *far, const clt_live_item *item, const strip *s, const lanes *inverse, lanes *near) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const float *x = far->drive[far->now] + (size_t)item->channel * far->cells;
  const float *value = own->value + (size_t)item->channel * (size_t)own->start[far->cells];
  for (int32_t l = 0; l < s->count; l++) {
    float sum = 0;
    for (int64_t e = own->start[s->cell + (size_t)l]; e < own->start[s->cell + (size_t)l + 1]; e++) {
      sum += value[e] * x[own->cell[e]];
    }
    (*near)[l] = (*inverse)[l] > 0 ? sum : 0;
  }
}

/* The drive to which a cell would go from r, and where it is held at a bound. */
INLINE void want(const clt_far *far, const float *constant, const lanes *x, const lanes *r, const lanes *pull,
                 lanes *wish, marks *held) {
  const lanes none = {0}, one = none + 1;
  lanes inverse, gather;
  take_plane(&inverse, constant, CLT_LIVE_INVERSE);
  take_plane(&gather, constant, CLT_LIVE_GATHER);
  *wish = *x + inverse * (*r + gather * inverse * *pull);
  const int32_t bounded = far->open ? 0 : -1;
  *held = ((*wish <= none) | (*wish >= one)) & (inverse > none) & bounded;
}

/* What is added up over a strip. */
typedef struct look_sums {
  columns give, take, whole, held;
  lanes residual, gap, size;
} look_sums;

/* From r on: what a cell does and how far the bounds let it go. */
INLINE void judge(const clt_far *far, const clt_live_item *item, const strip *s, const float *constant, float v,
                  const lanes *x, const lanes *r, look_sums *sums) {
  const lanes none = {0}, one = none + 1;
  lanes own, scale, gather, pull, wish;
  marks held;
  take_plane(&own, constant, CLT_LIVE_OWN);
  take_plane(&scale, constant, CLT_LIVE_SCALE);
  take_plane(&gather, constant, CLT_LIVE_GATHER);
  spread(&pull, item->pull, v, &s->u);
  want(far, constant, x, r, &pull, &wish, &held);
  lanes within = wish;
  clip(&within);
  const lanes bounded = own * (within - *x), step = far->open ? wish - *x : within - *x;
  const lanes give = gather * step, whole = scale * *r, rest = scale * (*r - own * step);
  const lanes holds = (lanes)((marks)one & held);
  add(&sums->give, &give, v);
  add(&sums->take, &rest, v);
  add(&sums->whole, &whole, v);
  add(&sums->held, &holds, v);
  sums->residual += *r * *r;
  sums->gap += bounded * bounded;
}

/* The target's part of a strip of a row: r from the light that is known. */
INLINE void aim_row(const clt_far *far, const clt_live_item *item, const strip *s, float v, look_sums *sums) {
  const float *constant = far->constant + s->place * CLT_LIVE_PLANES * LANES;
  const lanes none = {0};
  lanes target, black, light, inverse, x;
  take_part(&target, far->target + s->at, s->count);
  take_part(&black, far->black[item->channel] + s->cell, s->count);
  take(&light, far->shown + s->place * LANES);
  take(&x, far->drive[far->now] + s->at);
  take_plane(&inverse, constant, CLT_LIVE_INVERSE);
  const lanes wanted = (lanes)((marks)(target - black) & (inverse > none)), r = wanted - light;
  memcpy(far->wanted + s->place * LANES, &wanted, sizeof wanted);
  sums->size += wanted * wanted;
  judge(far, item, s, constant, v, &x, &r, sums);
}

/* The light of the drive over a strip of a row, and r from it; the far light is bilinear along it. */
INLINE void look_row(const clt_far *far, const clt_live_item *item, const strip *s, float v, const float **spill,
                     look_sums *sums) {
  const float *constant = far->constant + s->place * CLT_LIVE_PLANES * LANES;
  lanes own, inverse, scale, flood, x, wanted, light, near = {0};
  take_plane(&own, constant, CLT_LIVE_OWN);
  take_plane(&inverse, constant, CLT_LIVE_INVERSE);
  take_plane(&scale, constant, CLT_LIVE_SCALE);
  take_plane(&flood, constant, CLT_LIVE_FLOOD);
  take(&x, far->drive[far->now] + s->at);
  take(&wanted, far->wanted + s->place * LANES);
  if (far->spill != NULL) {
    add_spill(far, s, spill, &near);
  } else {
    add_near(far, item, s, &inverse, &near);
  }
  spread(&light, item->far, v, &s->u);
  light = own * x + near + scale * light + flood * far->mean[item->channel];
  memcpy(far->shown + s->place * LANES, &light, sizeof light);
  const lanes r = wanted - light;
  sums->size += light * light;
  judge(far, item, s, constant, v, &x, &r, sums);
}

INLINE void clear(clt_live_item *item) {
  static const float NONE[CLT_LEAF_TERMS] = {0};
  memcpy(item->give, NONE, sizeof NONE);
  memcpy(item->take, NONE, sizeof NONE);
  memcpy(item->whole, NONE, sizeof NONE);
  memcpy(item->held, NONE, sizeof NONE);
  item->residual = item->gap = 0;
}

/* The item that a thread most likely takes after this one. */
INLINE const clt_live_item *next_item(const clt_far *far, const clt_live_item *item) {
  return item + 1 < far->item + far->items ? item + 1 : item;
}

/* Asks memory for a plane's rows over an item to come, which lie too far apart to be foreseen; into the second cache,
 * for in the first they would push each other out. */
INLINE void foresee(const clt_far *far, const clt_live_item *item, const float *plane) {
  enum { LINE = 16, SECOND = 2 };
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const float *row = plane + (size_t)leaf.y * (size_t)far->width + (size_t)leaf.x;
  for (int32_t k = 0; k < leaf.height; k++, row += far->width) {
    for (int32_t across = 0; across < leaf.width; across += LINE) {
      __builtin_prefetch(row + across, 0, SECOND);
    }
  }
}

INLINE void pass(const clt_far *far, clt_live_item *item, bool aims) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const float *spill = far->spill != NULL ? far->spill + item->block * LANES : NULL;
  const clt_live_item *next = next_item(far, item);
  double size = 0;
  clear(item);
  foresee(far, next, far->drive[far->now] + (size_t)next->channel * far->cells);
  if (aims) {
    foresee(far, next, far->target + (size_t)next->channel * far->cells);
    foresee(far, next, far->black[next->channel]);
  }
  for (int32_t across = 0; across < leaf.width; across += LANES) {
    look_sums sums = {0};
    strip s;
    begin_strip(far, item, &leaf, across, &s);
    for (int32_t row = 0; row < leaf.height; row++, next_row(&s)) {
      const float v = (float)clt_leaf_place(row, leaf.height);
      if (aims) {
        aim_row(far, item, &s, v, &sums);
      } else {
        look_row(far, item, &s, v, &spill, &sums);
      }
    }
    fold(&sums.give, &s.u, item->give);
    fold(&sums.take, &s.u, item->take);
    fold(&sums.whole, &s.u, item->whole);
    fold(&sums.held, &s.u, item->held);
    item->residual += fold_plain(&sums.residual);
    item->gap += fold_plain(&sums.gap);
    size += fold_plain(&sums.size);
  }
  *(aims ? &item->wanted : &item->seen) = size;
}

INLINE void move_row(const clt_far *far, const clt_live_item *item, const strip *s, float v, float *next,
                     columns *given, lanes *light) {
  const float *constant = far->constant + s->place * CLT_LIVE_PLANES * LANES;
  lanes inverse, scale, gather, x, wanted, shown, turn, pull;
  take_plane(&inverse, constant, CLT_LIVE_INVERSE);
  take_plane(&scale, constant, CLT_LIVE_SCALE);
  take_plane(&gather, constant, CLT_LIVE_GATHER);
  take(&x, far->drive[far->now] + s->at);
  take(&wanted, far->wanted + s->place * LANES);
  take(&shown, far->shown + s->place * LANES);
  spread(&turn, item->turn, v, &s->u);
  spread(&pull, item->pull, v, &s->u);
  const lanes none = {0}, r = wanted - shown;
  lanes to = x + inverse * (r - scale * turn + gather * inverse * pull);
  clip(&to);
  put_part(next + s->at, &to, s->count);
  const lanes gives = gather * to;
  add(given, &gives, v);
  *light += (lanes)((marks)to & (inverse > none));
}

INLINE void move(const clt_far *far, clt_live_item *item, float *next) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  const clt_live_item *behind = next_item(far, item);
  memset(item->given, 0, sizeof item->given);
  item->light = 0;
  foresee(far, behind, far->drive[far->now] + (size_t)behind->channel * far->cells);
  foresee(far, behind, next + (size_t)behind->channel * far->cells);
  for (int32_t across = 0; across < leaf.width; across += LANES) {
    columns given = {0};
    lanes light = {0};
    strip s;
    begin_strip(far, item, &leaf, across, &s);
    for (int32_t row = 0; row < leaf.height; row++, next_row(&s)) {
      move_row(far, item, &s, (float)clt_leaf_place(row, leaf.height), next, &given, &light);
    }
    fold(&given, &s.u, item->given);
    item->light += fold_plain(&light);
  }
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
INLINE void weigh_row(const clt_far *far, const clt_live_item *item, const strip *s, float v, powers sums[3]) {
  const float *constant = far->constant + s->place * CLT_LIVE_PLANES * LANES;
  lanes inverse, scale, gather, x, wanted, shown, pull, wish;
  marks held;
  take_plane(&inverse, constant, CLT_LIVE_INVERSE);
  take_plane(&scale, constant, CLT_LIVE_SCALE);
  take_plane(&gather, constant, CLT_LIVE_GATHER);
  take(&x, far->drive[far->now] + s->at);
  take(&wanted, far->wanted + s->place * LANES);
  take(&shown, far->shown + s->place * LANES);
  spread(&pull, item->pull, v, &s->u);
  const lanes r = wanted - shown;
  want(far, constant, &x, &r, &pull, &wish, &held);
  const lanes free = (lanes)((marks)(gather * inverse) & ~held), bound = (lanes)((marks)scale & held);
  const lanes both = free * scale, pulls = free * free, pushes = bound * bound;
  add_powers(&sums[0], &both, v);
  add_powers(&sums[1], &pulls, v);
  add_powers(&sums[2], &pushes, v);
}

INLINE void weigh(const clt_far *far, clt_live_item *item) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  memset(item->weight, 0, sizeof item->weight);
  for (int32_t across = 0; across < leaf.width; across += LANES) {
    powers sums[3] = {0};
    strip s;
    begin_strip(far, item, &leaf, across, &s);
    for (int32_t row = 0; row < leaf.height; row++, next_row(&s)) {
      weigh_row(far, item, &s, (float)clt_leaf_place(row, leaf.height), sums);
    }
    for (int k = 0; k < 3 * 3; k++) {
      const lanes *sum = &sums[k / 3].of[k % 3];
      float *moment = item->weight[k / 3] + 3 * (k % 3);
      for (int l = 0; l < LANES; l++) {
        moment[0] += (*sum)[l];
        moment[1] += (*sum)[l] * s.u[l];
        moment[2] += (*sum)[l] * s.u[l] * s.u[l];
      }
    }
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

const clt_live_kernels *const clt_live_variants[] = {&avx2, &portable, NULL};
#else
const clt_live_kernels *const clt_live_variants[] = {&portable, NULL};
#endif

CLT_CHOOSE(clt_live_choose, clt_live_kernels, clt_live_variants)
