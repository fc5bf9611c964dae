/* JSON-RPC 2.0: one request, reply or notification a line. */
#ifndef CLT_DAEMON_RPC_H
#define CLT_DAEMON_RPC_H

#include <jansson.h>
#include <stddef.h>

/* The codes of the specification; RPC_FAILED is of the range that it leaves to servers. */
typedef enum rpc_code {
  RPC_FINE = 0,
  RPC_PARSE_ERROR = -32700,
  RPC_INVALID_REQUEST = -32600,
  RPC_UNKNOWN_METHOD = -32601,
  RPC_INVALID_PARAMS = -32602,
  RPC_FAILED = -32000
} rpc_code;

typedef struct rpc_request {
  json_t *document;   /* owns the others */
  const char *method; /* NULL where the line was no request */
  json_t *params;     /* an object, or NULL where there are none */
  json_t *id;         /* NULL for a notification: nobody waits for a reply */
} rpc_request;

/* Reads one line. RPC_FINE, or the code of the error with a message of at most `size` characters; the id is filled
 * where it could be read, so that the error can be addressed. Free with rpc_finish in every case. */
rpc_code rpc_parse(const char *line, size_t length, rpc_request *request, char *message, size_t size);
void rpc_finish(rpc_request *request);

/* New documents; result and params are taken over, id is borrowed (NULL: null). */
json_t *rpc_result(json_t *id, json_t *result);
json_t *rpc_error(json_t *id, rpc_code code, const char *message);
json_t *rpc_notification(const char *method, json_t *params);

#endif
