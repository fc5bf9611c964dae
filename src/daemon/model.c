#include "daemon/model.h"

#include <stdlib.h>

#include "base/memory.h"

clt_status model_create(clt_transport *transport, daemon_model **out, clt_error *error) {
  daemon_model *model = clt_alloc(1, sizeof *model);
  if (model == NULL) {
    return clt_fail(error, CLT_FAILED, "a transport cannot be kept: out of memory");
  }
  clt_status status = clt_certify(transport, &model->certificate, error);
  if (status != CLT_OK) {
    free(model);
    return status;
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
    free(model);
  }
}
