/* Moving pictures: one bounded compensation per frame, within the time that a frame has.
 *
 * A live solver is made once for a transport. It holds the transport in "hierarchy" storage (made where it is held
 * otherwise), what is known of its inverse, and all its workspace: a frame allocates nothing. Frames begin from what
 * the last one ended with. Vectors are float, channel after channel, cells in row-major order.
 *
 * Frames share their work among OpenMP's threads and call BLAS in each of them: a program that shows moving pictures
 * gives BLAS one thread of its own (openblas_set_num_threads(1)), or the two fight for the processors and a frame takes
 * up to four times as long. */
#ifndef COUNTERLIGHT_LIVE_H
#define COUNTERLIGHT_LIVE_H

#include <stdbool.h>

#include "counterlight/solve.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_live clt_live;

typedef struct clt_live_options {
  double target_error; /* stop where the drive is this near to the best in 0..1: relative RMS of the appearance, above 0
                          and below 1; 0 means 0.001 */
  double budget_ms;    /* wall time of a frame, >= 0, after which the best drive so far is returned; 0: no limit */
} clt_live_options;

typedef enum clt_live_stage {
  CLT_LIVE_PREPARE,  /* the target's own part: black subtracted, dark cells left out */
  CLT_LIVE_SOLVE,    /* steps */
  CLT_LIVE_ESTIMATE, /* the residual of the drive that is returned */
  CLT_LIVE_STAGES
} clt_live_stage;

/* Errors are relative RMS over lit cells of every channel, ||y - target|| / ||target||, in linear light; of a target
 * that is black everywhere, relative to white. */
typedef struct clt_live_result {
  double error;    /* estimate of the appearance error: `residual`, and what the operator itself may be off by */
  double residual; /* of the drive that is returned, by the transport as stored */
  double clipped_fraction; /* lit cells whose drive is at 0 or 1 */
  int steps;
  bool converged;             /* false where the budget came first, or steps ceased to gain */
  double ms[CLT_LIVE_STAGES]; /* wall time of each stage */
  double total_ms;
} clt_live_result;

/* T in the storage by which moving pictures go, which a solver makes for itself where it is not given it: *out, or NULL
 * where the transport serves as it is. Seconds of work, but from blocks. CLT_FAILED where memory is short. */
CLT_PUBLIC clt_status clt_live_convert(const clt_transport *transport, clt_transport **out, clt_error *error);

/* Makes a solver for a transport with rows = cols. transport and certificate outlive it. CLT_BAD_INPUT for options out
 * of range and for a transport that observes other cells than it drives. */
CLT_PUBLIC clt_status clt_live_create(const clt_transport *transport, const clt_certificate *certificate,
                                      const clt_live_options *options, clt_live **out, clt_error *error);
CLT_PUBLIC void clt_live_destroy(clt_live *live); /* accepts NULL */

/* The drive in 0..1 (channels * cols values; 0 at dark cells) that makes `target` (channels * cols radiances, black
 * included) appear. Starts from the drive of the call before it; the same target gives a drive that differs from the
 * one before by less than the steps that `target_error` leaves out, and none where it was reached. target and drive do
 * not overlap. One call at a time. CLT_BAD_INPUT for a target that is not finite: then drive is the last one. */
CLT_PUBLIC clt_status clt_live_solve(clt_live *live, const float *target, float *drive, clt_live_result *result,
                                     clt_error *error);
/* Forgets the last drive: the next frame starts from nothing. */
CLT_PUBLIC void clt_live_reset(clt_live *live);
/* Another budget from the next frame on, ms; 0: no limit. */
CLT_PUBLIC void clt_live_set_budget(clt_live *live, double budget_ms);

#ifdef __cplusplus
}
#endif
#endif
