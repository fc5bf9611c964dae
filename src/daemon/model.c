#include "daemon/model.h"

#include <stdlib.h>

#include "base/memory.h"
#include "counterlight/live.h"

clt_status model_create(clt_transport *transport, bool moves, daemon_model **out, clt_error *error) {
  daemon_model *model = clt_alloc(1, sizeof *model);
  if (model == NULL) {
    return clt_fail(error, CLT_FAILED, "a transport cannot be kept: out of memory");
  }
  clt_status status = clt_certify(transport, &model->certificate, error);
  if (status != CLT_OK) {
    free(model);
    return status;
  }
  clt_error problem = {0}; /* the moving thread tries again, and tells it */
  if (moves) {
    clt_live_convert(transport, &model->moving, &problem);
  }
  model->transport = transport;
  atomic_init(&model->holders, 1);
  *out = model;
  return CLT_OK;
}

daemon_model *model_hold(daemon_model *model) {
  if (model != NULL) {
    atomic_fetch_add(&model->holders, 1);
  }
  return model;
}

void model_drop(daemon_model *model) {
  if (model != NULL && atomic_fetch_sub(&model->holders, 1) == 1) {
    clt_certificate_destroy(model->certificate);
    clt_transport_destroy(model->transport);
    clt_transport_destroy(model->moving);
    free(model);
  }
}
