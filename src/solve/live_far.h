/* The bounded problem of one frame where far light has low rank.
 *
 * Per channel T = D + O + U V' (transport/hierarchy.h): D the cells' own light, O what cells next door add, U = diag(k)
 * P A and V = diag(v) P B of rank R. Where the least of ||b - T x||^2 / 2 over 0 <= x <= 1 leaves a cell free, D r + V
 * U'r = 0 (O' r neglected there: it is a hundredth of D), so that with q = U'r
 *
 *   x = P01(x + D^-1 (r + D^-1 V q)),   r = b - T x,
 *
 * a fixed point in which cells are coupled by the 2R numbers z = V'x and q alone. Newton's method for these: with F the
 * cells that the projection leaves free, A those that it holds, and s the step to the right side, by which x changes
 * where z and q do not, dx_A = s_A and dx_F = s_F + D^-1 (D^-1 V dq - U dz)_F, so that
 *
 *   [I + G   -H    ] [dz]   [ V's             ]     G = V_F' D^-1 U_F,   H = V_F' D^-2 V_F,
 *   [N       I + G'] [dq] = [ U'(r - D s) - q ]     N = U_A' U_A.
 *
 * G, H and N need of the cells only the moments of 1, u, v, u v over every leaf. This is the semismooth Newton method
 * (Qi & Sun 1993) for the box, at the price of two passes over the cells a step. Right sides are exact; the matrix
 * leaves out what far light of small singular values couples (dz = 0, dq = the right side there), which costs a step
 * that part of its gain. Where no cell is held, q = 0.
 *
 * Passes take strips of eight cells down a leaf. What they read of a cell lies in the order in which they read it, so
 * that memory is one stream; only drives lie as pictures do, because cells see their neighbours'. */
#ifndef CLT_SOLVE_LIVE_FAR_H
#define CLT_SOLVE_LIVE_FAR_H

#include <stdbool.h>
#include <stddef.h>

#include "base/turns.h"
#include "solve/live.h"
#include "transport/hierarchy.h"

enum {
  CLT_LIVE_AROUND = 8,
  CLT_LIVE_LANES = 8,
  CLT_LIVE_ROWS = 8, /* that a strip goes down before the one beside it is taken */
  CLT_LIVE_CODES = CLT_LIVE_ROWS * CLT_LIVE_AROUND,
  CLT_LIVE_MOMENTS = 9
}; /* of a weight over a leaf: the sums with u^a v^b, a and b 0..2, at [3 b + a] */

/* What every pass reads of a strip of a row, a cache line; 0 behind a leaf's edge and at dark cells. Numbers of 16 bits
 * stand in twos in a word, where each is had by one operation and a conversion, as a multiple of a unit that an item
 * has for each kind: right to within 1.6e-5 of the largest of the item. */
typedef struct clt_live_strip {
  float own[CLT_LIVE_LANES];
  int32_t pair[CLT_LIVE_LANES]; /* gather, black */
} clt_live_strip;

typedef enum clt_live_unit { CLT_LIVE_GATHER, CLT_LIVE_BLACK, CLT_LIVE_SPILL, CLT_LIVE_UNITS } clt_live_unit;

/* One channel of one leaf. */
typedef struct clt_live_item {
  int channel;
  size_t leaf;
  size_t first, block, code; /* its first strip of a row, block of spill and code */
  bool damped;               /* D is not `own` at every lit cell */
  float unit[CLT_LIVE_UNITS];
  float far[CLT_LEAF_TERMS], pull[CLT_LEAF_TERMS], turn[CLT_LEAF_TERMS]; /* A z, B q, A dz over the leaf */
  float give[CLT_LEAF_TERMS], take[CLT_LEAF_TERMS];  /* the leaf's part of the right sides, before B' and A' */
  float whole[CLT_LEAF_TERMS];                       /* P' diag(k) r */
  float given[CLT_LEAF_TERMS];                       /* P' diag(v) x */
  float held[CLT_LEAF_TERMS], known[CLT_LEAF_TERMS]; /* sums of 1, u, v, u v over held cells: now, and in the factor */
  float weight[3][CLT_LIVE_MOMENTS];                 /* of v k / D and (v / D)^2 where free, k^2 where held */
  float counted[3][CLT_LIVE_MOMENTS];                /* of these: what the products of the factor know */
  double residual, gap, wanted, seen, light;         /* ||r||^2, ||D s||^2, ||b||^2, ||b - r||^2, the sum of x */
  double size; /* ||target||^2 over lit cells, not finite where any value is not */
} clt_live_item;

typedef struct clt_far clt_far;
/* How strips of cells are passed over: portable C, and instructions that this processor may have. */
typedef struct clt_live_kernels {
  const char *needs; /* NULL: nothing */
  bool (*runs_here)(void);
  /* Takes a new target over an item, with the light that the drive is known to give: how large it is, r, and what the
   * Newton step needs of r. */
  void (*aim)(const clt_far *far, clt_live_item *item);
  /* The same of r with the light of the drive as it is now. */
  void (*look)(const clt_far *far, clt_live_item *item);
  /* next = P01(x + D^-1 (r - k P turn + v P pull / D)). */
  void (*move)(const clt_far *far, clt_live_item *item, float *next);
  /* The moments of the three weights, by what is held. */
  void (*weigh)(const clt_far *far, clt_live_item *item);
} clt_live_kernels;

struct clt_far {
  const clt_hierarchy_storage *hierarchy;
  const clt_live_kernels *kernels;
  int width, channels;
  size_t cells, items, rank;
  int from, to;            /* the channels that passes and steps are over */
  bool apart;              /* a channel goes through its first step before the next begins */
  double share;            /* the gap of all channels to the first one's, as aimed at last: of squares */
  double last_s;           /* that the last frame took */
  bool shared;             /* passes are long enough for threads */
  clt_live_item *item;     /* channel by channel, leaf by leaf */
  size_t strips;           /* of rows, in all items */
  size_t blocks;           /* of spill, in all items */
  clt_live_strip *strip;   /* strips */
  float *scale;            /* strips x lanes; NULL where it is 1 everywhere */
  float *diagonal;         /* D, strips x lanes, filled where items are damped; NULL where none is */
  float *shown, *drive[3]; /* strips x lanes: the light T x of the last look; channels x cells */
  float *vectors;          /* that these lie in */
  float place[(CLT_LEAF_SIDE_MAX + 1) *
              CLT_LEAF_SIDE_MAX]; /* clt_leaf_place, of cell k at [CLT_LEAF_SIDE_MAX side + k] */
  /* Light that `look` alone needs, of each strip's rows that it goes down: flood, row by row, and near light that
   * spills over from the eight cells around a cell, both in pairs of lanes. `code` has how many pairs of near light
   * there are, and of each of both the row and the direction in reading order, CLT_LIVE_AROUND row + direction. Drives
   * have room for a row, a cell and a strip before and behind them. */
  int32_t *spill;
  unsigned char *code;
  size_t codes;                     /* in all items */
  ptrdiff_t offset[CLT_LIVE_CODES]; /* of each code, from the strip's first cell to the one that spills */
  bool scattered;                   /* some near entries join cells that are no neighbours: then spill is flood only */
  const float *target;              /* of the frame */
  bool open;                        /* no cell is taken to be held: a step from nothing goes for the unbounded drive */
  int now, best;                    /* of drive */
  float mean[CLT_CHANNELS_MAX];     /* of the drive */
  size_t lit[CLT_CHANNELS_MAX];
  size_t coupled[CLT_CHANNELS_MAX]; /* the first so many of the rank, which the factor couples */
  bool bound[CLT_CHANNELS_MAX];     /* some cells are held */
  bool pulled[CLT_CHANNELS_MAX];    /* they are, or q is not 0 yet */
  bool ready[CLT_CHANNELS_MAX];     /* the factor where cells are held */
  float *small;                     /* per channel: the seven below */
  float *z, *q, *right;             /* R (of U z: with the core of channels that share U), R, 2R (dz) */
  float *turned, *folded, *gram;    /* R (dz as z), R (room), R x R (V' D^-2 V over lit cells) */
  float *columns[CLT_CHANNELS_MAX]; /* of U and V that the factor couples, in floats: 2 x 4L x coupled */
  float *factor;                    /* per channel: two, of twice as many columns as the most that are coupled */
  size_t order;                     /* that many */
  int *pivots;                      /* of both factors: where no cell is held, and where some are */
  float *product;                   /* per channel: G, H and N as they were counted last */
  unsigned counts[CLT_CHANNELS_MAX];
  float *partial; /* channels x CLT_HIERARCHY_CHUNKS x 2R */
  float *tall;    /* room for bringing these up to date */
};

extern const clt_live_kernels *const clt_live_variants[];
const clt_live_kernels *clt_live_choose(void);

/* Lays out what passes read: `diagonal` is D, channels x cells, 0 at dark ones; black[channel] that of the transport.
 */
clt_status clt_live_pack(clt_far *far, const float *diagonal, const float *const *black, clt_error *error);
void clt_live_unpack(clt_far *far); /* accepts what was not, or only in part */

/* The strip of a row of a leaf that passes take as their number'th: down CLT_LIVE_ROWS rows, then beside it, so that
 * what lies as pictures do is in the first cache until its whole lines are used. */
typedef struct clt_live_spot {
  int32_t row, across;
} clt_live_spot;
static inline int32_t clt_live_across(const clt_leaf *leaf) {
  return (leaf->width + CLT_LIVE_LANES - 1) / CLT_LIVE_LANES;
}
static inline int32_t clt_live_rows_below(const clt_leaf *leaf, int32_t top) {
  return leaf->height - top < CLT_LIVE_ROWS ? leaf->height - top : CLT_LIVE_ROWS;
}
static inline clt_live_spot clt_live_spot_of(const clt_leaf *leaf, int32_t number) {
  const int32_t each = CLT_LIVE_ROWS * clt_live_across(leaf), top = number / each * CLT_LIVE_ROWS;
  const int32_t rows = clt_live_rows_below(leaf, top);
  return (clt_live_spot){top + number % each % rows, number % each / rows * CLT_LIVE_LANES};
}

/* Room for the small systems of every channel, and how much of the rank the factor couples. */
clt_status clt_newton_create(clt_far *far, clt_error *error);
void clt_newton_destroy(clt_far *far);
/* The rest is called by every thread of a team, which shares the work. */
/* dz and q of every channel from what the items give and take. */
void clt_newton_step(clt_far *far);
/* Into an item's turn and pull. One thread. */
void clt_newton_turn(const clt_far *far, clt_live_item *item);
/* z of every channel from what the items give; and from it an item's far (one thread). */
void clt_newton_gather(clt_far *far);
void clt_newton_light(const clt_far *far, clt_live_item *item);
/* drift[channel] = by how much ||D s||^2 may change where q becomes U'r, from r as it was looked at. */
void clt_newton_drift(clt_far *far, double drift[CLT_CHANNELS_MAX]);

/* The items of the channels that passes are over: the first, and how many. */
static inline clt_live_item *clt_live_first(const clt_far *far) {
  return far->item + (size_t)far->from * far->hierarchy->leaves;
}
static inline size_t clt_live_count(const clt_far *far) {
  return (size_t)(far->to - far->from) * far->hierarchy->leaves;
}

/* A pass: these in their turns, few at once. */
enum { CLT_LIVE_AT_ONCE = 8 };
static inline clt_turns clt_live_turns(const clt_far *far) {
  return clt_turns_of_few(clt_live_count(far), CLT_LIVE_AT_ONCE);
}
static inline bool clt_live_next(const clt_far *far, clt_turns *turns, clt_live_item **first, clt_live_item **end) {
  size_t from = 0, to = 0;
  const bool more = clt_turns_next_few(turns, clt_live_count(far), CLT_LIVE_AT_ONCE, &from, &to);
  *first = clt_live_first(far) + from;
  *end = clt_live_first(far) + to;
  return more;
}

#endif
