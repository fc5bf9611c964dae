/* Which scheme an acquisition takes, and why. */
#ifndef CLT_ACQUIRE_CHOOSE_H
#define CLT_ACQUIRE_CHOOSE_H

#include "acquire/session.h"

/* The scheme of session->options.scheme; "auto" or NULL: by grid, wanted error and seconds allowed. Where seconds
 * count, one black pattern is shown to learn how long one takes. session->plan becomes one sentence: what was chosen,
 * and why. CLT_BAD_INPUT for a scheme that does not exist; the message lists those that do. */
clt_status clt_choose_scheme(clt_session *session, const clt_scheme **out, clt_error *error);

#endif
