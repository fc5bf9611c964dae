/* Bringing a transport up to date by a few photographs, where that explains what changed. */
#ifndef CLT_DAEMON_RENEW_H
#define CLT_DAEMON_RENEW_H

#include "daemon/letters.h"

/* Above this many cells T is not held dense, as rescaling its rows needs. */
enum { RENEW_CELLS_MOST = 4096, RENEW_CHECKS = 2 };

typedef struct renew_options {
  bool changed;                                              /* look for what changed; else black and gain alone */
  int repeats;                                               /* of black and flood, >= 1 */
  bool (*progress)(void *context, const clt_progress *made); /* as clt_acquire's */
  void *context;
} renew_options;

/* Photographs black, the flood and, with `changed`, RENEW_CHECKS random pictures. T is tried as it is, then with one
 * gain for each channel (g, the median over lit cells of flood / T 1: a lamp that aged), then with rows of their own
 * factor where flood / T 1 is further from g than six standard deviations (surfaces that were repainted, while the
 * light that they throw at others changes by less than the noise), each with the new black. The first whose check
 * pictures and flood fit by clt_loop_check is the answer: found->outcome, and *out, the caller's, NULL for RENEW_FITS.
 * Where none does, or T is too large, RENEW_MEASURE: T has to be measured. Without `changed` the gain is taken as it
 * is. */
clt_status renew_transport(clt_rig *rig, const daemon_model *model, const renew_options *options, clt_transport **out,
                           renewal *found, clt_error *error);

#endif
