/* A solver, and one call of it: what it was asked, how far it is, and what it tells at the end. */
#ifndef CLT_SOLVE_JOB_H
#define CLT_SOLVE_JOB_H

#include "solve/choose.h"

/* What a method keeps of one channel, or of all together. */
typedef struct clt_preparation {
  struct clt_preparation *next;
  const clt_method *method;
  int channel;
  void *kept;
} clt_preparation;

struct clt_solver {
  const clt_transport *transport;
  const clt_certificate *certificate;
  clt_transport_info info;
  clt_solve_options options; /* with the defaults put in */
  const clt_method *method;  /* that runs first */
  bool automatic;
  clt_choice choice; /* of auto */
  int systems;       /* that a solve consists of: the channels, or 1 */
  clt_system system;
  clt_noise noise[CLT_CHANNELS_MAX]; /* of each system */
  clt_preparation *preparations;
  double prepare_s;
};

/* One solve. */
typedef struct clt_job {
  clt_solver *solver;
  const double *start; /* channels * cols values, or NULL */
  int64_t start_ns;
  double method_s;               /* in the methods so far */
  clt_run run[CLT_CHANNELS_MAX]; /* of each system, as are the norms */
  double wanted_norm[CLT_CHANNELS_MAX], residual[CLT_CHANNELS_MAX];
  long products[CLT_CHANNELS_MAX];
  const clt_method *answer;               /* the first method, or what took over from it in some system */
  const clt_method *broken, *replacement; /* the first that broke, and what took over in the end; NULL where none did */
  char why[CLT_NOTE_MAX];                 /* note of the broken one */
  bool stalled;                           /* a linear method of auto did not reach the tolerance */
  size_t outside, lit;                    /* cells that left 0..1 before the bounded solve */
} clt_job;

/* Checks the options and puts the defaults in. */
clt_status clt_solver_check_options(clt_solve_options *options, clt_error *error);
/* CLT_BAD_INPUT naming the first value that is not finite; `what` is what they are. */
clt_status clt_solver_check_finite(const double *values, size_t count, const char *what, clt_error *error);

/* Fills the result from the job's runs. */
void clt_job_tell(const clt_job *job, bool converged, clt_solve_result *result);

#endif
