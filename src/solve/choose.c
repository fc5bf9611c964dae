/* Which method serves a transport, and which one takes over where it breaks. */
#include "solve/choose.h"

#include <stdio.h>
#include <string.h>

const clt_method *clt_method_linear(double reciprocity) {
  return reciprocity <= CLT_RECIPROCAL ? &clt_method_pcg : &clt_method_gmres;
}

const clt_method *clt_choose_first(const clt_certificate *certificate, const clt_transport_info *info) {
  return info->rows == info->cols ? clt_method_linear(clt_certificate_worst(certificate).reciprocity)
                                  : &clt_method_bounded;
}

const clt_method *clt_choose_last(const clt_system *system) {
  return system->square ? &clt_method_gmres : &clt_method_bounded;
}

const clt_method *clt_choose_next(const clt_method *broken, const clt_system *system) {
  const clt_method *linear = clt_method_linear(system->reciprocity);
  return broken == linear || !system->square ? clt_choose_last(system) : linear;
}

clt_status clt_choose_named(const char *name, const clt_method **out, clt_error *error) {
  *out = clt_method_find(name);
  if (*out != NULL) {
    return CLT_OK;
  }
  char known[CLT_MESSAGE_MAX / 2] = "auto";
  for (size_t i = 0; clt_methods[i] != NULL; i++) {
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, ", %s", clt_methods[i]->name);
  }
  return clt_fail(error, CLT_BAD_INPUT, "there is no method \"%.40s\"; use one of: %s", name, known);
}

clt_status clt_choose_check(const clt_method *method, const clt_certificate *certificate,
                            const clt_transport_info *info, clt_error *error) {
  if (!method->rectangular && info->rows != info->cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s needs as many observed cells as drive cells, but this transport has %zu rows and %zu columns; "
                    "use bounded",
                    method->name, info->rows, info->cols);
  }
  for (int c = 0; method->check != NULL && c < info->channels; c++) {
    clt_status status = method->check(clt_certificate_channel(certificate, c), error);
    if (status != CLT_OK) {
      return status;
    }
  }
  return CLT_OK;
}
