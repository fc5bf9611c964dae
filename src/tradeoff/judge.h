/* The problem that every point of a tradeoff solves, and the parts of a drive's error. */
#ifndef CLT_TRADEOFF_JUDGE_H
#define CLT_TRADEOFF_JUDGE_H

#include "counterlight/tradeoff.h"

typedef struct clt_judge {
  const clt_transport *transport; /* as given: what is seen */
  const clt_certificate *certificate;
  clt_transport_info info;
  size_t values;         /* channels * cols */
  double *wanted;        /* b */
  double *best_seen;     /* T x* of the best drive x* in 0..1 */
  double size;           /* of the target over lit cells, or of white where that is black; > 0 */
  double limit;          /* ||T x* - b|| / size */
  double *seen, *stored; /* T x' and T~ x of the drive in hand */
  double *shown, *part;  /* x', and scratch */
} clt_judge;

/* Takes the target and finds x*, for which it may take deadline_s. CLT_BAD_INPUT as clt_tradeoff_measure; ended by
 * clt_judge_finish in either case. */
clt_status clt_judge_init(clt_judge *judge, const clt_transport *transport, const clt_certificate *certificate,
                          const clt_image *picture, const clt_white *white, double deadline_s, clt_error *error);
void clt_judge_finish(clt_judge *judge);

/* Fills the errors of a point from the drive that a solve with `stored` answered; `keeps` where its method kept 0..1.
 */
void clt_judge_drive(clt_judge *judge, const clt_transport *stored, const double *drive, bool keeps,
                     clt_tradeoff_point *point);

#endif
