/* The control socket's server: accepts clients, hands their requests to one handler, writes replies and notifications.
 * Runs on the control loop only; nothing here blocks. */
#ifndef CLT_DAEMON_SERVER_H
#define CLT_DAEMON_SERVER_H

#include <jansson.h>
#include <stdint.h>
#include <systemd/sd-event.h>

#include "counterlight/status.h"
#include "daemon/client.h"
#include "daemon/rpc.h"

enum { SERVER_CLIENTS_MOST = 64 };

typedef struct server server;

/* Answers a request by one of the calls below; params is an object or NULL. */
typedef void (*server_handler)(void *context, client *from, const rpc_request *request);

/* Serves on a listening, non-blocking descriptor, which stays the caller's. group: see peer.h. */
clt_status server_create(sd_event *loop, int descriptor, gid_t group, server_handler handler, void *context,
                         server **out, clt_error *error);
void server_destroy(server *service); /* drops every client; accepts NULL */

/* Replies; result is taken over. Nothing is sent where the request has no id. */
void server_reply(client *to, const rpc_request *request, json_t *result);
void server_refuse(client *to, const rpc_request *request, rpc_code code, const char *message);
/* The reply comes later, by server_complete with the same kind (not 0) and ticket; until then the client's further
 * requests wait. */
void server_defer(client *to, const rpc_request *request, unsigned kind, uint64_t ticket);
/* Replies to every client that waits for it: result (borrowed), or where that is NULL the error's message. */
void server_complete(server *service, unsigned kind, uint64_t ticket, json_t *result, const clt_error *error);

/* Sends a notification to every subscriber. params is taken over. */
void server_notify(server *service, const char *method, json_t *params);
/* The same for news that only matter while they are the latest: what a slow subscriber has not got is replaced. */
void server_notify_latest(server *service, const char *method, json_t *params);
/* Tries to write what waits, for the end of the daemon. */
void server_flush(server *service);

#endif
