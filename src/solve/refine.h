/* Iterative refinement: what an approximate inverse leaves is improved against T itself. */
#ifndef CLT_SOLVE_REFINE_H
#define CLT_SOLVE_REFINE_H

#include "solve/method.h"

/* An approximate inverse X of S. */
typedef struct clt_inverse {
  void (*apply)(void *context, const double *r, double *d); /* d = X r; whole vectors, 0 at dark cells */
  /* NULL, or what ||b - S l|| is at most for the l = l_before + X r that ended with this X, where ||r|| = `norm`. */
  double (*bound)(void *context, const double *l, double norm);
  void *context;
} clt_inverse;

enum { CLT_REFINE_VECTORS = 4 };

/* l <- l + X r, r = b - S l, from system->light until ||r|| <= clt_run_target. A start of zero costs no product for its
 * residual, and a bound that is below the target none for the end: then the curve holds the bound. Needs the first
 * CLT_REFINE_VECTORS vectors; gives the best l that a product has seen, or the bounded one. */
clt_outcome clt_refine(const clt_inverse *inverse, clt_system *system, clt_run *run);

#endif
