/* What the fixed-point methods share: following the residual, keeping the best iterate, noticing divergence. */
#ifndef CLT_SOLVE_ITERATE_H
#define CLT_SOLVE_ITERATE_H

#include "solve/method.h"

typedef struct clt_watch {
  clt_system *system; /* its light keeps the best iterate */
  clt_run *run;
  const double *l; /* the iterate, cols values */
  bool certified;  /* theory says that the method converges: a growth for a while is the transient of a non-normal R */
  double start, norm, least;
  double real;              /* the last residual norm that was no recurrence's */
  int growing, since_least; /* iterations in a row */
  clt_outcome outcome;      /* once clt_watch_goes_on has said no */
} clt_watch;

/* Starts from l = system->light of residual norm `norm`, which opens the curve. */
clt_watch clt_watch_open(clt_system *system, clt_run *run, const double *l, double norm, bool certified);
/* Takes the residual norm of what an iteration has made of l, and keeps l if it is the best so far. */
void clt_watch_count(clt_watch *watch, double norm);
/* False when the work is done, the limit or the deadline has come, rounding holds the residual up, or it diverges. */
bool clt_watch_goes_on(clt_watch *watch);
/* At the end of a method that knows its residual by recurrence only: takes the real residual norm of l. True where the
 * target is not reached, but the residual has halved since the last time, so that going on from here helps. */
bool clt_watch_resumes(clt_watch *watch, double norm);

/* l <- l + omega (b - S l) until the target is reached; uses the first CLT_RICHARDSON_VECTORS vectors. */
enum { CLT_RICHARDSON_VECTORS = 2 };
clt_outcome clt_richardson(clt_system *system, clt_run *run, double omega, bool certified);

/* CLT_BAD_INPUT where radius_low shows that the sum of (-R)^k diverges. */
clt_status clt_check_series(const char *method, const clt_channel_certificate *channel, clt_error *error);

/* m = rho / (1 + rho): the spectral radius of A where rho(R) = rho. */
static inline double clt_albedo_of_radius(double radius) {
  return radius / (1 + radius);
}

#endif
