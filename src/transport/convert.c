/* One storage into another, row by row. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/kind.h"

static const clt_kind *find_kind(const char *storage, clt_error *error) {
  char known[128] = "";
  for (size_t i = 0; clt_kinds[i] != NULL; i++) {
    if (clt_kinds[i]->put_row == NULL) {
      continue;
    }
    if (strcmp(clt_kinds[i]->name, storage) == 0) {
      return clt_kinds[i];
    }
    const size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s%s", used > 0 ? ", " : "", clt_kinds[i]->name);
  }
  clt_fail(error, CLT_BAD_INPUT, "a transport cannot be converted to \"%.40s\"; use one of: %s", storage, known);
  return NULL;
}

const char *clt_transport_storage_name(size_t index) {
  for (size_t i = 0; clt_kinds[i] != NULL; i++) {
    if (clt_kinds[i]->put_row != NULL && index-- == 0) {
      return clt_kinds[i]->name;
    }
  }
  return NULL;
}

static void copy_plane(const clt_transport *from, const float *values, float *out) {
  memcpy(out, values, (size_t)from->channels * from->rows * sizeof *out);
}

clt_status clt_transport_copy_planes(const clt_transport *from, clt_transport *to, clt_error *error) {
  clt_status status = clt_transport_keep_black(to, error);
  if (status == CLT_OK) {
    copy_plane(from, from->black, to->black);
  }
  if (status == CLT_OK && from->flood != NULL) {
    status = clt_transport_keep_flood(to, error);
    if (status == CLT_OK) {
      copy_plane(from, from->flood, to->flood);
    }
  }
  if (status == CLT_OK && from->sigma != NULL) {
    status = clt_transport_keep_sigma(to, error);
    if (status == CLT_OK) {
      copy_plane(from, from->sigma, to->sigma);
    }
  }
  return status;
}

static clt_status check_range(const clt_transport *to, int channel, size_t i, const double *row, clt_error *error) {
  for (size_t j = 0; j < to->cols; j++) {
    if (!(fabs(row[j]) <= to->kind->most)) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "entry [%d, %zu, %zu] of T is %.4g; %s storage holds finite numbers up to %.3g: measure in a "
                      "larger unit or use dense64",
                      channel, i, j, row[j], to->kind->name, to->kind->most);
    }
  }
  return CLT_OK;
}

static clt_status copy_rows(const clt_transport *from, clt_transport *to, clt_error *error) {
  double *row = clt_alloc(from->cols, sizeof *row);
  clt_status status =
      row != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "no memory for a row of %zu cells", from->cols);
  for (int c = 0; c < from->channels; c++) {
    for (size_t i = 0; i < from->rows && status == CLT_OK; i++) {
      status = clt_transport_row(from, c, i, row, error);
      status = status == CLT_OK ? check_range(to, c, i, row, error) : status;
      if (status == CLT_OK) {
        to->kind->put_row(to, c, i, row);
      }
    }
  }
  free(row);
  return status;
}

clt_status clt_transport_convert(const clt_transport *transport, const char *storage, clt_transport **out,
                                 clt_error *error) {
  *out = NULL;
  const clt_kind *kind = find_kind(storage, error);
  if (kind == NULL) {
    return CLT_BAD_INPUT;
  }
  clt_transport *made = NULL;
  clt_status status = clt_transport_begin(kind, transport->width, transport->height, transport->channels,
                                          "a converted transport", &made, error);
  if (status != CLT_OK) {
    return status;
  }
  made->rows = transport->rows;
  made->provenance = transport->provenance;
  status = kind->reserve(made, error);
  if (status == CLT_OK) {
    status = clt_transport_copy_planes(transport, made, error);
  }
  if (status == CLT_OK) {
    status = copy_rows(transport, made, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(made);
    return status;
  }
  *out = made;
  return CLT_OK;
}
