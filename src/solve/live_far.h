/* The bounded problem of one frame where far light has low rank.
 *
 * Per channel T = D + O + U V' (transport/hierarchy.h): D the cells' own light, O what cells next door add, U = diag(k)
 * P A and V = diag(v) P B of rank R. Where the least of ||b - T x||^2 / 2 over 0 <= x <= 1 leaves a cell free, D r + V
 * U'r = 0 (O' r neglected there: it is a hundredth of D), so that with q = U'r
 *
 *   x = P01(x + D^-1 (r + D^-1 V q)),   r = b - T x,
 *
 * a fixed point in which cells are coupled by the 2R numbers z = V'x and q alone. Newton's method for these: with F the
 * cells that the projection leaves free, A those that it holds, dx_A known,
 *
 *   dx_F = D^-1 (r - U dz + D^-1 V q)_F
 *   [I + G   -H    ] [dz]   [ V_F' D^-1 r + V_A' dx_A ]     G = V_F' D^-1 U_F,   H = V_F' D^-2 V_F,
 *   [N       I + G'] [q ] = [ U_A' (r - D dx_A)       ]     N = U_A' U_A.
 *
 * G, H and N need of the cells only the moments of 1, u, v, u v over every leaf. This is the semismooth Newton method
 * (Qi & Sun 1993) for the box, at the price of two passes over the cells a step. */
#ifndef CLT_SOLVE_LIVE_FAR_H
#define CLT_SOLVE_LIVE_FAR_H

#include <stdbool.h>
#include <stddef.h>

#include "solve/live.h"
#include "transport/hierarchy.h"

enum {
  CLT_LIVE_AROUND = 8,
  CLT_LIVE_MOMENTS = 9
}; /* of a weight over a leaf: the sums with u^a v^b, a and b 0..2, at [3 b + a] */

/* One channel of one leaf. */
typedef struct clt_live_item {
  int channel;
  size_t leaf;
  float far[CLT_LEAF_TERMS], pull[CLT_LEAF_TERMS], turn[CLT_LEAF_TERMS]; /* A z, B q, A dz over the leaf */
  float free[CLT_LEAF_TERMS], held[CLT_LEAF_TERMS];   /* the leaf's part of the right sides above, before B' and A' */
  float whole[CLT_LEAF_TERMS], drift[CLT_LEAF_TERMS]; /* P' diag(k) r, and B (U'r - q) */
  float given[CLT_LEAF_TERMS];                        /* P' diag(v) x */
  float weight[3][CLT_LIVE_MOMENTS];                  /* of v k / D and (v / D)^2 where free, k^2 where held */
  float turnover;                                     /* sum of (v / D)^2 over lit cells */
  double residual, gap, seen, light;                  /* ||r||^2, ||D (P01(..) - x)||^2, ||b - r||^2, sum of x */
  long changed, held_cells;                           /* cells that are held otherwise than in the factor; held ones */
} clt_live_item;

typedef struct clt_far clt_far;
/* How rows of cells are passed over: portable C, and instructions that this processor may have. */
typedef struct clt_live_kernels {
  const char *needs; /* NULL: nothing */
  bool (*runs_here)(void);
  /* r = b - T x and what the Newton step needs of it, over one item. */
  void (*look)(const clt_far *far, clt_live_item *item);
  /* next = P01(x + D^-1 (r - k P turn + v P pull / D)). */
  void (*move)(const clt_far *far, clt_live_item *item, float *next);
  /* The moments of the three weights, by what is held. */
  void (*weigh)(const clt_far *far, clt_live_item *item);
} clt_live_kernels;

struct clt_far {
  const clt_hierarchy_storage *hierarchy;
  const clt_live_kernels *kernels;
  int width;
  size_t cells, items, rank;
  clt_live_item *item; /* channel by channel, leaf by leaf */
  float *plane;        /* the planes below, channels x cells each */
  float *wanted, *residual, *inverse, *drive[3];
  /* near light by the directions of the eight cells around a cell, in reading order: [row of cells, channel by channel]
   * [direction][column]; NULL where some near entries join cells that are no neighbours. Drives have room for a row and
   * a cell before and behind them. */
  float *spill;
  unsigned char *held, *factored; /* 1 where the projection holds a cell: now, and in the factor */
  bool open;                      /* no cell is taken to be held: a step from nothing goes for the unbounded drive */
  int now, best;                  /* of drive */
  float mean[CLT_CHANNELS_MAX];   /* of the drive */
  size_t lit[CLT_CHANNELS_MAX];
  bool ready[CLT_CHANNELS_MAX];  /* the factor */
  float *z, *q, *right, *factor; /* per channel: z and q (R), right sides and answers (2R), the factor of 2R x 2R */
  int *pivots;
  float *tall; /* 4L x R: room for the products that make a factor */
};

extern const clt_live_kernels *const clt_live_variants[];
const clt_live_kernels *clt_live_choose(void);

clt_status clt_live_spread_near(clt_far *far, size_t channels, clt_error *error);

/* Room for the small systems of every channel. */
clt_status clt_newton_reserve(clt_far *far, int channels, clt_error *error);
void clt_newton_release(clt_far *far);
/* Takes the factor of a channel from the moments of its items; false where it is singular. */
bool clt_newton_factor(clt_far *far, int channel);
/* Solves for dz and q of a channel, into its items' turn and pull. */
void clt_newton_step(clt_far *far, int channel);
/* By how much ||D (P01(..) - x)||^2 may change where q becomes U'r, from r as it was looked at. */
double clt_newton_drift(clt_far *far, int channel);
/* z from what the items give, into their far. */
void clt_newton_gather(clt_far *far, int channel);

#endif
