/* A transport with its certificate, shared by the threads: nobody changes it once it is made. */
#ifndef CLT_DAEMON_MODEL_H
#define CLT_DAEMON_MODEL_H

#include <stdatomic.h>

#include "counterlight/solve.h"
#include "counterlight/transport.h"

typedef struct daemon_model {
  clt_transport *transport;
  clt_transport *moving; /* what moving pictures go by (clt_live_convert); NULL: the transport, or it is not made yet */
  clt_certificate *certificate;
  atomic_uint holders;
} daemon_model;

/* Certifies the transport and takes it over; on failure it stays the caller's. Where content moves, what that takes is
 * made as well. The maker is the first holder. */
clt_status model_create(clt_transport *transport, bool moves, daemon_model **out, clt_error *error);
/* One holder more; gives the model back. Accepts NULL. */
daemon_model *model_hold(daemon_model *model);
/* One holder less; the last one frees it. Accepts NULL. */
void model_drop(daemon_model *model);

#endif
