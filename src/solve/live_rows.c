/* Passes over the cells of a leaf, row by row. Sums are kept for every column of the leaf and folded at its end, so
 * that the loops over a row are maps, which compilers turn into vector instructions. */
#include <math.h>
#include <string.h>

#include "solve/live_far.h"

#define INLINE static inline __attribute__((always_inline)) /* into each variant */

enum { SIDE = CLT_LEAF_SIDE_MAX };

/* Sums of a value over the rows of a leaf, by columns: with 1 and with v. */
typedef struct columns {
  float even[SIDE], tilted[SIDE];
} columns;

/* Where a row of an item's cells begins, in a plane of a channel and of all channels. */
typedef struct place {
  size_t cell, at;
} place;

INLINE place place_of(const clt_far *far, const clt_live_item *item, int32_t row) {
  const clt_leaf *leaf = &far->hierarchy->leaf[item->leaf];
  const size_t cell = (size_t)(leaf->y + row) * (size_t)far->width + (size_t)leaf->x;
  return (place){cell, (size_t)item->channel * far->cells + cell};
}

INLINE void fill_places(int32_t side, float *u) {
  for (int32_t k = 0; k < side; k++) {
    u[k] = (float)clt_leaf_place(k, side);
  }
}

INLINE void fold(const columns *sums, const float *u, int32_t width, float out[CLT_LEAF_TERMS]) {
  float folded[CLT_LEAF_TERMS] = {0};
  for (int32_t k = 0; k < width; k++) {
    folded[0] += sums->even[k];
    folded[1] += sums->even[k] * u[k];
    folded[2] += sums->tilted[k];
    folded[3] += sums->tilted[k] * u[k];
  }
  memcpy(out, folded, sizeof folded);
}

INLINE float clip(float value) {
  value = value > 0 ? value : 0;
  return value < 1 ? value : 1;
}

/* near = O x over a row, by its eight directions. */
INLINE void add_spill(const clt_far *far, place first, int32_t width, float *restrict near) {
  const size_t line = (size_t)far->width, begin = first.at / line * line;
  const float *restrict spill = far->spill + begin * CLT_LIVE_AROUND + (first.at - begin);
  const float *restrict x = far->drive[far->now] + first.at, *restrict up = x - line, *restrict down = x + line;
  for (int32_t k = 0; k < width; k++) {
    const float above =
        (spill[k] * up[k - 1] + spill[line + (size_t)k] * up[k]) + spill[2 * line + (size_t)k] * up[k + 1];
    const float beside = spill[3 * line + (size_t)k] * x[k - 1] + spill[4 * line + (size_t)k] * x[k + 1];
    const float below = (spill[5 * line + (size_t)k] * down[k - 1] + spill[6 * line + (size_t)k] * down[k]) +
                        spill[7 * line + (size_t)k] * down[k + 1];
    near[k] = (above + below) + beside;
  }
}

/* near = O x over a row. */
INLINE void add_near(const clt_far *far, const clt_live_item *item, place first, int32_t width, float *near) {
  const clt_hierarchy_storage *own = far->hierarchy;
  const float *x = far->drive[far->now] + (size_t)item->channel * far->cells;
  const float *value = own->value + (size_t)item->channel * (size_t)own->start[far->cells];
  int64_t e = own->start[first.cell];
  for (int32_t k = 0; k < width; k++) {
    float sum = 0;
    for (const int64_t end = own->start[first.cell + (size_t)k + 1]; e < end; e++) {
      sum += value[e] * x[own->cell[e]];
    }
    near[k] = sum;
  }
}

/* What is added up over an item: light that is given, and both right sides. */
typedef struct look_sums {
  columns free, held, whole;
  float residual[SIDE], gap[SIDE], seen[SIDE];
  float held_cells[SIDE];
  int changed[SIDE];
} look_sums;

/* One row: f and h are bilinear along it. */
INLINE void look_row(const clt_far *far, const clt_live_item *item, int32_t row, int32_t width, float v,
                     const float *restrict u, look_sums *restrict sums) {
  const place first = place_of(far, item, row);
  const clt_hierarchy_storage *hierarchy = far->hierarchy;
  const float *restrict wanted = far->wanted + first.at, *restrict x = far->drive[far->now] + first.at;
  const float *restrict own = hierarchy->own + first.at, *restrict inverse = far->inverse + first.at;
  const float *restrict scale = hierarchy->scale + first.at, *restrict gather = hierarchy->gather + first.at;
  const float *restrict flood = hierarchy->flood + first.at;
  const unsigned char *restrict factored = far->factored + first.at;
  unsigned char *restrict state = far->held + first.at;
  float *restrict residual = far->residual + first.at;
  const float f0 = item->far[0] + v * item->far[2], f1 = item->far[1] + v * item->far[3];
  const float h0 = item->pull[0] + v * item->pull[2], h1 = item->pull[1] + v * item->pull[3];
  const float mean = far->mean[item->channel];
  const float bounded = far->open ? 0.0f : 1.0f;
  float near[SIDE], lit[SIDE], want[SIDE], hold[SIDE];
  if (far->spill != NULL) {
    add_spill(far, first, width, near);
  } else {
    add_near(far, item, first, width, near);
  }
  /* loops apart: conditions that share one loop become branches, which no vector instruction takes */
  for (int32_t k = 0; k < width; k++) {
    lit[k] = inverse[k] > 0 ? 1.0f : 0.0f;
  }
  for (int32_t k = 0; k < width; k++) {
    const float light = own[k] * x[k] + near[k] + scale[k] * (f0 + f1 * u[k]) + flood[k] * mean;
    const float r = lit[k] * (wanted[k] - light);
    want[k] = x[k] + inverse[k] * (r + gather[k] * inverse[k] * (h0 + h1 * u[k]));
    residual[k] = r;
    sums->seen[k] += lit[k] * light * light;
  }
  for (int32_t k = 0; k < width; k++) {
    const float low = want[k] > 0 ? 0.0f : bounded, high = want[k] < 1 ? 0.0f : bounded;
    hold[k] = low + high;
  }
  for (int32_t k = 0; k < width; k++) {
    const float r = residual[k], step = clip(want[k]) - x[k];
    const float give = gather[k] * (hold[k] * step + (1 - hold[k]) * (r * inverse[k]));
    const float take = hold[k] * lit[k] * scale[k] * (r - own[k] * step);
    sums->held_cells[k] += hold[k] * lit[k];
    sums->free.even[k] += give;
    sums->free.tilted[k] += v * give;
    sums->held.even[k] += take;
    sums->held.tilted[k] += v * take;
    sums->whole.even[k] += scale[k] * r;
    sums->whole.tilted[k] += v * scale[k] * r;
    sums->residual[k] += r * r;
    sums->gap[k] += lit[k] * (own[k] * step) * (own[k] * step);
  }
  for (int32_t k = 0; k < width; k++) {
    const unsigned char holds = hold[k] > 0 ? 1 : 0;
    sums->changed[k] += holds ^ factored[k];
    state[k] = holds;
  }
}

INLINE void look(const clt_far *far, clt_live_item *item) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  look_sums sums = {0};
  float u[SIDE];
  fill_places(leaf.width, u);
  for (int32_t row = 0; row < leaf.height; row++) {
    look_row(far, item, row, leaf.width, (float)clt_leaf_place(row, leaf.height), u, &sums);
  }
  fold(&sums.free, u, leaf.width, item->free);
  fold(&sums.held, u, leaf.width, item->held);
  fold(&sums.whole, u, leaf.width, item->whole);
  item->residual = item->gap = item->seen = 0;
  item->changed = item->held_cells = 0;
  for (int32_t k = 0; k < leaf.width; k++) {
    item->residual += (double)sums.residual[k];
    item->gap += (double)sums.gap[k];
    item->seen += (double)sums.seen[k];
    item->changed += sums.changed[k];
    item->held_cells += (long)sums.held_cells[k];
  }
}

INLINE void move(const clt_far *far, clt_live_item *item, float *next) {
  const clt_hierarchy_storage *hierarchy = far->hierarchy;
  const clt_leaf leaf = hierarchy->leaf[item->leaf];
  columns given = {0};
  float u[SIDE], light[SIDE] = {0};
  fill_places(leaf.width, u);
  for (int32_t row = 0; row < leaf.height; row++) {
    const place first = place_of(far, item, row);
    const float *restrict x = far->drive[far->now] + first.at, *restrict inverse = far->inverse + first.at;
    const float *restrict scale = hierarchy->scale + first.at, *restrict gather = hierarchy->gather + first.at;
    const float *restrict residual = far->residual + first.at;
    float *restrict to = next + first.at;
    const float v = (float)clt_leaf_place(row, leaf.height);
    const float d0 = item->turn[0] + v * item->turn[2], d1 = item->turn[1] + v * item->turn[3];
    const float h0 = item->pull[0] + v * item->pull[2], h1 = item->pull[1] + v * item->pull[3];
    for (int32_t k = 0; k < leaf.width; k++) {
      const float pull = gather[k] * inverse[k] * (h0 + h1 * u[k]);
      to[k] = clip(x[k] + inverse[k] * (residual[k] - scale[k] * (d0 + d1 * u[k]) + pull));
      given.even[k] += gather[k] * to[k];
      given.tilted[k] += v * gather[k] * to[k];
      light[k] += to[k];
    }
  }
  fold(&given, u, leaf.width, item->given);
  item->light = 0;
  for (int32_t k = 0; k < leaf.width; k++) {
    item->light += (double)light[k];
  }
}

/* One row of the weights v k / D and (v / D)^2 where cells are free, k^2 where they are held. */
INLINE void weigh_row(const clt_far *far, const clt_live_item *item, int32_t row, int32_t width, float v,
                      float sums[3][3][SIDE]) {
  const place first = place_of(far, item, row);
  const float *restrict inverse = far->inverse + first.at;
  const float *restrict scale = far->hierarchy->scale + first.at;
  const float *restrict gather = far->hierarchy->gather + first.at;
  const unsigned char *restrict state = far->held + first.at;
  for (int32_t k = 0; k < width; k++) {
    const float free = state[k] ? 0.0f : gather[k] * inverse[k], lit = inverse[k] > 0 ? 1.0f : 0.0f;
    const float weight[3] = {free * scale[k], free * free, state[k] ? lit * scale[k] * scale[k] : 0.0f};
    for (int w = 0; w < 3; w++) {
      sums[w][0][k] += weight[w];
      sums[w][1][k] += v * weight[w];
      sums[w][2][k] += v * v * weight[w];
    }
  }
}

INLINE void weigh(const clt_far *far, clt_live_item *item) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  float sums[3][3][SIDE] = {{{0}}}, u[SIDE];
  fill_places(leaf.width, u);
  for (int32_t row = 0; row < leaf.height; row++) {
    weigh_row(far, item, row, leaf.width, (float)clt_leaf_place(row, leaf.height), sums);
  }
  memset(item->weight, 0, sizeof item->weight);
  for (int w = 0; w < 3; w++) {
    for (int b = 0; b < 3; b++) {
      float *moments = item->weight[w] + 3 * b;
      for (int32_t k = 0; k < leaf.width; k++) {
        moments[0] += sums[w][b][k];
        moments[1] += sums[w][b][k] * u[k];
        moments[2] += sums[w][b][k] * u[k] * u[k];
      }
    }
  }
}

static void look_portable(const clt_far *far, clt_live_item *item) {
  look(far, item);
}

static void move_portable(const clt_far *far, clt_live_item *item, float *next) {
  move(far, item, next);
}

static void weigh_portable(const clt_far *far, clt_live_item *item) {
  weigh(far, item);
}

static bool runs_everywhere(void) {
  return true;
}

static const clt_live_kernels portable = {
    .runs_here = runs_everywhere, .look = look_portable, .move = move_portable, .weigh = weigh_portable};

#if defined(__x86_64__)
/* The same loops with vectors of eight; no fused operations, so that the bits of a drive do not depend on the
 * processor.
 */
#define AVX2 __attribute__((target("avx2")))

AVX2 static void look_avx2(const clt_far *far, clt_live_item *item) {
  look(far, item);
}

AVX2 static void move_avx2(const clt_far *far, clt_live_item *item, float *next) {
  move(far, item, next);
}

AVX2 static void weigh_avx2(const clt_far *far, clt_live_item *item) {
  weigh(far, item);
}

static bool has_avx2(void) {
  return __builtin_cpu_supports("avx2");
}

static const clt_live_kernels avx2 = {
    .needs = "AVX2", .runs_here = has_avx2, .look = look_avx2, .move = move_avx2, .weigh = weigh_avx2};

const clt_live_kernels *const clt_live_variants[] = {&avx2, &portable, NULL};
#else
const clt_live_kernels *const clt_live_variants[] = {&portable, NULL};
#endif

const clt_live_kernels *clt_live_choose(void) {
  size_t k = 0;
  while (!clt_live_variants[k]->runs_here()) {
    k++;
  }
  return clt_live_variants[k];
}
