/* Monte Carlo estimates of S^-1 b over paths of cells (Bai et al. 2010, section 8), importance-sampled from the rows of
 * R by alias tables (Walker 1977). */
#ifndef CLT_SOLVE_PATHS_H
#define CLT_SOLVE_PATHS_H

#include <stdint.h>

#include "solve/matrix.h"

typedef struct clt_paths {
  size_t count;    /* cells */
  float *keep;     /* count x count: the share of a draw of column j that stays with j; its sign is that of R_ij */
  uint16_t *alias; /* the column that takes the rest, and 1 << 15 more where its entry is negative */
  double *weight;  /* |R_i| = sum_j |R_ij| */
  double ratio;    /* q of p(k) */
} clt_paths;

/* Tables of R = S - I; the matrix stays. A path's length has p(k) = q^(k-1) (1 - q), which is eq. 48 with q = m / (1 -
 * m), and q^2 the radius of diag(|R_i|) |R|, by which the terms' mean squares fall: in an even room that q is rho(R),
 * and with it the variance is finite and least. CLT_BAD_INPUT with the reason where q >= 1: then no length would do;
 * `remedy` ends the message. */
clt_status clt_paths_init(clt_paths *paths, const clt_matrix *matrix, const char *remedy, clt_error *error);
void clt_paths_finish(clt_paths *paths); /* accepts a zeroed one */

/* out_i = b_i + the mean over `samples` paths of (-1)^k |R_i0| .. |R_i(k-1)| b_ik / p(k) (eq. 47-50): unbiased for S^-1
 * b, the same for any number of threads. deviation_i (may be NULL): the standard error of out_i, as the samples show
 * it; infinite for a single one. count values each, that must not overlap. */
void clt_paths_estimate(const clt_paths *paths, const double *b, int samples, uint64_t key, double *out,
                        double *deviation);

/* out = the iterate l <- b - R l after `steps` steps from b, each with `samples` columns of every row drawn afresh: the
 * hybrid of eq. 43 with Monte Carlo, unbiased for that iterate. `last` has count values. */
void clt_paths_hybrid(const clt_paths *paths, const double *b, int samples, int steps, uint64_t key, double *last,
                      double *out);

#endif
