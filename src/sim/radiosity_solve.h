/* Solving the light equation on the symmetrised exchange, every channel in a lane. */
#ifndef CLT_SIM_RADIOSITY_SOLVE_H
#define CLT_SIM_RADIOSITY_SOLVE_H

#include "sim/hierarchy.h"

typedef struct clt_radiosity_system {
  const clt_hierarchy *hierarchy; /* H; outlives the system */
  size_t count;                   /* elements, in the hierarchy's order */
  clt_lanes *scale;               /* D = sqrt(albedo / area), filled by the caller; 0 in lanes without a channel */
  clt_lanes *source;              /* z, before a solution */
  clt_lanes *bounced;             /* (I - K)^-1 z - z, after it */
  clt_lanes *residual, *step, *image, *scaled, *work;
  int iterations; /* of the last solution */
} clt_radiosity_system;

/* False where memory is short; the system was zeroed by the caller and is finished by it in either case. */
bool clt_radiosity_system_init(clt_radiosity_system *system, const clt_hierarchy *hierarchy);
void clt_radiosity_system_finish(clt_radiosity_system *system);

/* Fills bounced, d, from source: (I - K) d = K z with K = D H D by conjugate gradients (Hestenes and Stiefel 1952),
 * until in each lane ||K z - (I - K) d|| <= tolerance ||z||. I - K is positive definite for every albedo below 1. The
 * same for any number of threads. */
void clt_radiosity_solve(clt_radiosity_system *system, double tolerance);

#endif
