/* Trying something dangerous in a child process first. */
#ifndef CLT_TRANSPORT_REHEARSAL_H
#define CLT_TRANSPORT_REHEARSAL_H

#include "counterlight/status.h"

/* Runs act(context) in a copy of this process and reports how it ended there, message included; what it did to memory
 * is lost. CLT_BAD_INPUT, with a message that begins with `what`, where it crashed or took more than `seconds` (>= 1)
 * of processor time. CLT_OK where no child can be had: then there is no reason to expect harm. act runs with one thread
 * only, so it must not use OpenMP; it must not change files. */
clt_status clt_rehearse(clt_status (*act)(void *context, clt_error *error), void *context, const char *what,
                        unsigned seconds, clt_error *error);

#endif
