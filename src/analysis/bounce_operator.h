/* What the forward methods share of the bounce operator. */
#ifndef CLT_ANALYSIS_BOUNCE_OPERATOR_H
#define CLT_ANALYSIS_BOUNCE_OPERATOR_H

#include "counterlight/forward.h"

/* An upper bound of ||A|| in a weighted maximum norm, as clt_forward_result has it. u and scratch: count values each.
 */
clt_status clt_bounce_norm(const clt_bounce_operator *bounce, double *u, double *scratch, double *norm,
                           clt_error *error);
/* CLT_BAD_INPUT where A has made a value that is not finite. */
clt_status clt_bounce_check(const double *values, size_t count, clt_error *error);
/* CLT_BAD_INPUT where a value of `direct` is not finite. */
clt_status clt_forward_check(const clt_bounce_operator *bounce, const double *direct, clt_error *error);

#endif
