#include "daemon/rpc.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static rpc_code refuse(rpc_code code, char *message, size_t size, const char *why) {
  snprintf(message, size, "%s", why);
  return code;
}

/* An id is a text, a number or null; anything else is no request. */
static bool take_id(rpc_request *request) {
  json_t *id = json_object_get(request->document, "id");
  bool legal = id == NULL || json_is_string(id) || json_is_number(id) || json_is_null(id);
  request->id = legal ? id : NULL;
  return legal;
}

rpc_code rpc_parse(const char *line, size_t length, rpc_request *request, char *message, size_t size) {
  *request = (rpc_request){0};
  json_error_t problem;
  request->document = json_loadb(line, length, JSON_REJECT_DUPLICATES | JSON_DECODE_ANY, &problem);
  if (request->document == NULL) {
    snprintf(message, size, "not one JSON document in a line: %s (column %d)", problem.text, problem.column);
    return RPC_PARSE_ERROR;
  }
  if (!json_is_object(request->document)) {
    return refuse(RPC_INVALID_REQUEST, message, size, "a request is one JSON object a line; batches are not taken");
  }
  if (!take_id(request)) {
    return refuse(RPC_INVALID_REQUEST, message, size, "\"id\" must be a text, a number or null");
  }
  const char *version = json_string_value(json_object_get(request->document, "jsonrpc"));
  if (version == NULL || strcmp(version, "2.0") != 0) {
    return refuse(RPC_INVALID_REQUEST, message, size, "\"jsonrpc\" must be \"2.0\"");
  }
  const char *method = json_string_value(json_object_get(request->document, "method"));
  if (method == NULL) {
    return refuse(RPC_INVALID_REQUEST, message, size, "\"method\" must be a text");
  }
  json_t *params = json_object_get(request->document, "params");
  if (json_is_array(params) && json_array_size(params) == 0) {
    params = NULL;
  }
  if (params != NULL && !json_is_object(params)) {
    return refuse(RPC_INVALID_PARAMS, message, size, "\"params\" must be an object");
  }
  request->method = method;
  request->params = params;
  return RPC_FINE;
}

void rpc_finish(rpc_request *request) {
  json_decref(request->document);
  *request = (rpc_request){0};
}

static json_t *envelope(json_t *id) {
  json_t *document = json_pack("{s:s}", "jsonrpc", "2.0");
  json_object_set_new(document, "id", id != NULL ? json_incref(id) : json_null());
  return document;
}

json_t *rpc_result(json_t *id, json_t *result) {
  json_t *document = envelope(id);
  json_object_set_new(document, "result", result);
  return document;
}

json_t *rpc_error(json_t *id, rpc_code code, const char *message) {
  json_t *document = envelope(id);
  /* Text from a client's line may be no UTF-8, of which json_pack would make nothing. */
  json_t *text = json_string(message);
  json_object_set_new(document, "error",
                      json_pack("{s:i, s:o}", "code", (int)code, "message",
                                text != NULL ? text : json_string("the message is no UTF-8")));
  return document;
}

json_t *rpc_notification(const char *method, json_t *params) {
  return json_pack("{s:s, s:s, s:o}", "jsonrpc", "2.0", "method", method, "params", params);
}
