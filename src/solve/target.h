/* What the target's makers share: checks of pictures, and the white of CLT_WHITE_FEASIBLE. */
#ifndef CLT_SOLVE_TARGET_H
#define CLT_SOLVE_TARGET_H

#include "counterlight/solve.h"

/* CLT_BAD_INPUT where the picture does not fit the transport (`what` names it: "picture", "drive"), or rows != cols. */
clt_status clt_check_picture(const clt_transport *transport, const clt_image *picture, const char *what,
                             clt_error *error);
/* Channel c of a picture. */
const float *clt_picture_channel(const clt_image *picture, int channel);

/* The largest factor s with 0 <= x <= 1 for the x of T x = s * white_c * picture - b0 at every lit cell. CLT_BAD_INPUT
 * where no s > 0 does. */
clt_status clt_white_feasible(const clt_transport *transport, const clt_certificate *certificate,
                              const clt_image *picture, const double *white, double *factor, clt_error *error);

#endif
