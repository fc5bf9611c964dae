/* One call of clt_solve: what it was asked, how far it is, and what it tells at the end. */
#ifndef CLT_SOLVE_JOB_H
#define CLT_SOLVE_JOB_H

#include "solve/method.h"

typedef struct clt_job {
  const clt_certificate *certificate;
  clt_transport_info info;
  clt_solve_options options;
  const clt_method *method; /* that runs first */
  bool automatic;
  int64_t start_ns;
  clt_system system;
  clt_run run[CLT_CHANNELS_MAX];
  double wanted_norm[CLT_CHANNELS_MAX], residual[CLT_CHANNELS_MAX];
  const clt_method *answer;               /* the furthest method that ran */
  const clt_method *broken, *replacement; /* the first that broke, and what took over in the end; NULL where none did */
  char why[CLT_NOTE_MAX];                 /* note of the broken one */
  bool stalled;                           /* a Krylov method of auto did not reach the tolerance */
  size_t outside, lit;                    /* cells that left 0..1 before the bounded solve */
} clt_job;

/* Fills the result from the job's runs. */
void clt_job_tell(const clt_job *job, bool converged, clt_solve_result *result);

#endif
