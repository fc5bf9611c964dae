/* Loads a transport and prints what it is as JSON, or the error; for test_h5py.py. Exit: 0 loaded, 1 CLT_FAILED,
 * 2 CLT_BAD_INPUT. With a second argument it also saves it there, with a third one converted to that storage. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "counterlight/transport.h"

static json_t *plane(const float *values, size_t rows) {
  if (values == NULL) {
    return json_null();
  }
  json_t *list = json_array();
  for (size_t i = 0; i < rows; i++) {
    json_array_append_new(list, isfinite(values[i]) ? json_real((double)values[i]) : json_string("infinite"));
  }
  return list;
}

/* T applied to x_j = 1 + j and T' applied to y_i = 1 + i, so that every entry and its place count. */
static void add_products(json_t *root, const clt_transport *transport, int channel) {
  clt_transport_info info = clt_transport_describe(transport);
  double *x = calloc(info.cols + info.rows, sizeof *x), *y = calloc(info.cols + info.rows, sizeof *y);
  json_t *forward = json_array(), *backward = json_array();
  for (size_t k = 0; k < info.cols + info.rows; k++) {
    x[k] = 1 + (double)k;
  }
  clt_transport_apply(transport, channel, x, y);
  for (size_t i = 0; i < info.rows; i++) {
    json_array_append_new(forward, json_real(y[i]));
  }
  clt_transport_apply_transposed(transport, channel, x, y);
  for (size_t j = 0; j < info.cols; j++) {
    json_array_append_new(backward, json_real(y[j]));
  }
  json_array_append_new(json_object_get(root, "forward"), forward);
  json_array_append_new(json_object_get(root, "backward"), backward);
  free(x);
  free(y);
}

static json_t *describe(const clt_transport *transport) {
  clt_transport_info info = clt_transport_describe(transport);
  const clt_provenance *origin = clt_transport_origin(transport);
  json_t *root =
      json_pack("{si si si si ss s[] s[] s[] s[] s[] ss ss ss sI si si sf sf}", "width", info.width, "height",
                info.height, "channels", info.channels, "rows", (int)info.rows, "storage", info.storage, "black",
                "flood", "sigma", "forward", "backward", "scheme", origin->scheme, "source", origin->source, "response",
                origin->response, "acquired", (json_int_t)origin->acquired, "patterns", origin->patterns, "frames",
                origin->frames, "seconds", origin->seconds, "error", origin->error);
  for (int c = 0; c < info.channels; c++) {
    json_array_append_new(json_object_get(root, "black"), plane(clt_transport_black(transport, c), info.rows));
    json_array_append_new(json_object_get(root, "flood"), plane(clt_transport_flood(transport, c), info.rows));
    json_array_append_new(json_object_get(root, "sigma"), plane(clt_transport_sigma(transport, c), info.rows));
    add_products(root, transport, c);
  }
  return root;
}

int main(int count, char **arguments) {
  clt_error error = {CLT_OK, ""};
  clt_transport *transport = NULL;
  clt_status status =
      count < 2 ? clt_fail(&error, CLT_BAD_INPUT, "give a file") : clt_transport_load(arguments[1], &transport, &error);
  if (status == CLT_OK && count > 3) {
    clt_transport *converted = NULL;
    status = clt_transport_convert(transport, arguments[3], &converted, &error);
    clt_transport_destroy(transport);
    transport = converted;
  }
  if (status == CLT_OK && count > 2) {
    status = clt_transport_save(transport, arguments[2], &error);
  }
  json_t *root = status == CLT_OK ? describe(transport) : json_pack("{ss}", "message", error.message);
  json_dumpf(root, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
  json_decref(root);
  clt_transport_destroy(transport);
  return (int)status;
}
