/* Daubechies' wavelets of four taps (D4) on a grid of any size: square wavelets, the two axes split level by level.
 *
 * At a border the filters that would reach over it are replaced: what the inner filters leave of the space there is
 * split into two averages that hold what a constant and a linear function have in it, and details that both vanish in.
 * The constant and the linear function are followed down the levels, so that two moments vanish everywhere, for every
 * length, and the transform stays orthonormal (after Cohen, Daubechies & Vial 1993, found here by orthogonalisation).
 */
#ifndef CLT_SOLVE_DAUBECHIES_H
#define CLT_SOLVE_DAUBECHIES_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/status.h"

enum { CLT_D4_LEVELS_MAX = 15, CLT_D4_LEAST = 8 /* samples that are split */ };

/* One level of one axis: count samples to `lows` averages, followed by count - lows details. */
typedef struct clt_d4_level {
  size_t count, lows;
  size_t pairs;         /* positions of the inner filters, 0, 2, ..; the first and the last are part of the borders */
  double left[3][4];    /* two averages and a detail, of samples 0..3 */
  double right[4][5];   /* two averages and one or two details, of the samples from 2 (pairs - 1) */
  size_t right_samples; /* 4 or 5; as many details as that less 3 */
} clt_d4_level;

/* The levels of a width x height grid, row-major. Along an axis that is short the later ones are missing. */
typedef struct clt_d4 {
  size_t width, height, levels, across, down; /* levels along a row, along a column; the greater of them */
  clt_d4_level row[CLT_D4_LEVELS_MAX], column[CLT_D4_LEVELS_MAX];
} clt_d4;

void clt_d4_init(clt_d4 *d4, size_t width, size_t height);
/* width * height values to coefficients in place: the averages of the last level stand in the upper left corner, the
 * details of each level around those of the next. scratch has as many values. */
void clt_d4_forward(const clt_d4 *d4, double *values, double *scratch);
/* The inverse, which is the transpose. */
void clt_d4_inverse(const clt_d4 *d4, double *values, double *scratch);

#endif
