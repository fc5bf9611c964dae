/* The operator A = I - F T^-1 from inside, as the files of this room share it. */
#ifndef CLT_ANALYSIS_INTERREFLECTION_H
#define CLT_ANALYSIS_INTERREFLECTION_H

#include "counterlight/analysis.h"

struct clt_interreflection {
  const clt_transport *transport;
  const clt_certificate *certificate;
  clt_interreflection_info info;
  double tolerance;
  clt_solver *solver;   /* of info.method */
  clt_solver *fallback; /* "gmres", made when pcg first stops short */
  double *first_bounce; /* F: channels x cells, 0 at dark cells */
  double *drive, *seen; /* y = T^-1 light and T y: channels x cells */
};

/* Values of a channel set: channels * cells. */
size_t clt_interreflection_values(const clt_interreflection *interreflection);
/* CLT_BAD_INPUT where one of the values is not finite; `what` names them. */
clt_status clt_interreflection_check(const clt_interreflection *interreflection, const double *values, const char *what,
                                     clt_error *error);
/* interreflection->drive = y = T^-1 light over lit cells (0 at dark ones), ->seen = T y. residual (may be NULL) as in
 * clt_interreflection_apply. CLT_FAILED where the solve leaves more than a hundredth of the light. */
clt_status clt_interreflection_solve(clt_interreflection *interreflection, const double *light, double *residual,
                                     clt_error *error);

/* F_i = 1 / (T^-1)_ii of a channel's lit cells. */
clt_status clt_exact_first_bounce(const clt_transport *transport, int channel, const unsigned char *lit,
                                  double *first_bounce, clt_error *error);
/* Fills spread, reciprocity, inexact and why of the info. */
void clt_judge_exactness(clt_interreflection *interreflection);

#endif
