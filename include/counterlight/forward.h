/* Forward transport l_out = S l_d = (I - A)^-1 l_d from the bounce operator A: the duals of three methods of inversion
 * (Bai et al. 2010, eq. 14, 41, 46; the inverse ones are series, jacobi and montecarlo of solve.h).
 *
 * T knows S = T F^-1 at once, so l_out = T x is one product. These serve where A is what is known (a simulated room),
 * where light is to be built bounce by bounce, and to check S and A against one another: with A = I - F T^-1 all three
 * lead back to T x. Light is radiance less black; vectors hold `count` doubles and do not overlap. */
#ifndef COUNTERLIGHT_FORWARD_H
#define COUNTERLIGHT_FORWARD_H

#include <stddef.h>
#include <stdint.h>

#include "counterlight/analysis.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A, as far as a method needs it. What it is made of must outlive it. */
typedef struct clt_bounce_operator {
  size_t count; /* values of a vector */
  /* next = A light; the two do not overlap */
  clt_status (*apply)(void *context, const double *light, double *next, clt_error *error);
  /* row_j = A_ij, count values; NULL where only products are known: then there is no Monte Carlo */
  clt_status (*row)(void *context, size_t i, double *row, clt_error *error);
  void *context;
} clt_bounce_operator;

/* A given entry by entry, count x count row-major. */
typedef struct clt_bounce_entries {
  size_t count;
  const double *entries;
} clt_bounce_entries;
CLT_PUBLIC clt_bounce_operator clt_bounce_operator_of_entries(const clt_bounce_entries *entries);

/* A = I - F T^-1 of a measured room, by a solve for each product: count = channels * cells, no rows. Cells that the
 * projector does not light receive light and send none (analysis.h). */
CLT_PUBLIC clt_bounce_operator clt_bounce_operator_of_transport(clt_interreflection *interreflection);
/* The entries of the same A for one channel, cells x cells row-major, by LAPACK's inverse of T over the lit cells.
 * CLT_BAD_INPUT for more than CLT_EXACT_CELLS_MAX lit cells and for a T that has no inverse. */
CLT_PUBLIC clt_status clt_interreflection_entries(clt_interreflection *interreflection, int channel, double *entries,
                                                  clt_error *error);

typedef struct clt_forward_result {
  int bounces; /* that the light holds */
  /* ||A|| <= norm in the norm max_i |l_i| / u_i of a u > 0 that some steps of power iteration from 1 have drawn towards
   * A's Perron vector (Collatz-Wielandt; rigorous for A >= 0). */
  double norm;
  double last;  /* ||A^n l_d|| / ||l_d||: what the last bounce added */
  double bound; /* norm^(n+1) / (1 - norm), eq. 38: what is left out, relative to l_d, is at most this in that norm */
} clt_forward_result;

/* light = l_d + A l_d + ... + A^n l_d, n = bounces in 0..1000000 (eq. 14): n products, and up to 8 for the norm.
 * CLT_BAD_INPUT where norm >= 1, or where a bounce grows all the same (an A with negative entries): light would not
 * settle; and for light that is not finite. result may be NULL. */
CLT_PUBLIC clt_status clt_forward_series(const clt_bounce_operator *bounce, const double *direct, int bounces,
                                         double *light, clt_forward_result *result, clt_error *error);

/* light <- l_d + A light from l_d on (eq. 41), until a step changes it by at most tolerance ||l_d||, tolerance in
 * 0..1; after n steps it is the series' sum. CLT_FAILED where it does not get there in 1000000 steps; otherwise as
 * clt_forward_series. */
CLT_PUBLIC clt_status clt_forward_iterate(const clt_bounce_operator *bounce, const double *direct, double tolerance,
                                          double *light, clt_forward_result *result, clt_error *error);

/* Paths of cells drawn by the rows of A, made ready once for many lights: alias tables of count x count entries. */
typedef struct clt_forward_paths clt_forward_paths;
/* CLT_BAD_INPUT for an A without rows, of more than 12288 values, or whose paths' mean squares do not fall. The
 * operator is not needed any longer then. */
CLT_PUBLIC clt_status clt_forward_paths_create(const clt_bounce_operator *bounce, clt_forward_paths **out,
                                               clt_error *error);
CLT_PUBLIC void clt_forward_paths_destroy(clt_forward_paths *paths); /* accepts NULL */
/* q of the law of path lengths p(k) = q^(k-1) (1 - q): A's norm in an even room, where eq. 38's terms fall like it. */
CLT_PUBLIC double clt_forward_paths_ratio(const clt_forward_paths *paths);

/* light_i = l_d(i) + the mean over `samples` (1..1000000) paths of |A_i0| ... |A_i(k-1)| l_d(i_k) / p(k), the dual of
 * eq. 50: unbiased for S l_d, its variance as 1 / samples, the same for a seed with any number of threads. deviation
 * (count values, or NULL) takes the standard error of each value, infinite for a single sample. */
CLT_PUBLIC clt_status clt_forward_paths_estimate(const clt_forward_paths *paths, const double *direct, int samples,
                                                 uint64_t seed, double *light, double *deviation, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
