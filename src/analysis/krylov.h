/* GMRES for an operator of this room. */
#ifndef CLT_ANALYSIS_KRYLOV_H
#define CLT_ANALYSIS_KRYLOV_H

#include <stddef.h>

enum { CLT_KRYLOV_STEPS = 40, CLT_KRYLOV_VECTORS = CLT_KRYLOV_STEPS + 2 };

typedef struct clt_krylov {
  void (*apply)(void *context, const double *in, double *out); /* out = M in; they do not overlap */
  void *context;
  size_t count;
  double *basis; /* CLT_KRYLOV_VECTORS * count values */
} clt_krylov;

/* Improves v until ||b - M v|| <= tolerance ||b||, restarting every CLT_KRYLOV_STEPS products, or until a restart gains
 * less than a tenth. Returns ||b - M v|| / ||b|| (0 for b = 0, where v becomes 0). Saad & Schultz 1986. */
double clt_krylov_solve(const clt_krylov *krylov, const double *b, double tolerance, double *v);

#endif
