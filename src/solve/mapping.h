/* What a moving target is mapped to so that a drive in 0..1 reaches it: white (scale picture + offset), changing
 * smoothly in time. */
#ifndef CLT_SOLVE_MAPPING_H
#define CLT_SOLVE_MAPPING_H

#include <stdbool.h>

#include "counterlight/solve.h"
#include "counterlight/transport.h"

typedef struct clt_mapping clt_mapping;

/* white: channels values. */
clt_status clt_mapping_create(const clt_transport *transport, const clt_certificate *certificate, const double *white,
                              double smooth_s, clt_mapping **out, clt_error *error);
void clt_mapping_destroy(clt_mapping *mapping); /* accepts NULL */

/* Takes the next picture (channels * cells means, linear), `seconds` after the one before. True while scale and offset
 * are on their way. */
bool clt_mapping_follow(clt_mapping *mapping, const float *picture, double seconds, bool cut);
double clt_mapping_scale(const clt_mapping *mapping);
double clt_mapping_offset(const clt_mapping *mapping);

#endif
