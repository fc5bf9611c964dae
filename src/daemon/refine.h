/* Correcting a picture that is up by photographs of it. */
#ifndef CLT_DAEMON_REFINE_H
#define CLT_DAEMON_REFINE_H

#include "daemon/letters.h"

enum { REFINE_STEPS_MOST = 16 };

/* Photographs the picture and corrects its drive by F^-1 (target - photograph), step by step, until the error is no
 * more than noise, stops falling, or REFINE_STEPS_MOST photographs were taken. The drive of the least error is left in
 * picture->drive, with its photograph in seen and deviation, which the caller initialised: never worse than before.
 * go_on (with context) is asked before every step; CLT_CANCELLED where it says no. */
clt_status refine_picture(clt_rig *rig, const daemon_model *model, daemon_picture *picture, clt_image *seen,
                          clt_image *deviation, bool (*go_on)(void *context), void *context, refinement *out,
                          clt_error *error);

#endif
