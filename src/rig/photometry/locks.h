/* Whether the camera's automatic controls are really off: the same picture must look the same at all times, whatever
 * was shown before, and light must follow the exposure time. */
#ifndef CLT_RIG_PHOTOMETRY_LOCKS_H
#define CLT_RIG_PHOTOMETRY_LOCKS_H

#include "rig/finding.h"
#include "rig/photometry/field.h"

/* Movements are largest over smallest, less 1, after means over three frames. */
typedef struct clt_locks {
  double gain;      /* of the brightness, after a change of picture: what comes back each time it is shown */
  double drift;     /* of the brightness, that does not come back: a lamp or camera that warms up */
  double colour;    /* of the ratio of red to blue */
  double sharpness; /* of the light's variation between neighbouring pixels */
  double obedience; /* least growth of the signal by a doubled exposure time */
  double seconds;   /* watched */
} clt_locks;

/* Watches a chequered picture for watch_s, shown once after the dark and once after a red panel, and its brightness at
 * exposures of base_s and shorter; what moves too much becomes a finding. */
clt_status clt_locks_check(clt_field_bench *bench, double base_s, double watch_s, clt_locks *out,
                           clt_findings *findings, clt_error *error);

/* Fields that it takes with a camera of 30 frames a second, about; 0 where it is not watched. */
int clt_locks_fields(double watch_s);

#endif
