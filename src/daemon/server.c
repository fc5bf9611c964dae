#include "daemon/server.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"
#include "base/memory.h"

struct server {
  sd_event *loop;
  sd_event_source *source;
  gid_t group;
  server_handler handler;
  void *context;
  client *clients;
  int count;
  bool complained; /* of a client that was refused, since the last one that was not */
};

static void drop(server *service, client *gone) {
  if (gone->choked) {
    clt_log(CLT_LOG_WARNING, "control socket: client pid %ld dropped: it does not read its answers",
            (long)gone->who.pid);
  }
  client **link = &service->clients;
  while (*link != gone) {
    link = &(*link)->next;
  }
  *link = gone->next;
  service->count--;
  client_destroy(gone);
}

/* Writes what goes out now and waits for what is next. A client whose time is over is hung up on, so that its own event
 * drops it: this may run below that client's own request. */
static void settle(client *connection) {
  client_flush(connection);
  if (client_is_over(connection)) {
    shutdown(connection->descriptor, SHUT_RDWR);
  }
  sd_event_source_set_io_events(connection->source, client_events(connection));
}

static void answer_line(server *service, client *from, const char *line, size_t length) {
  rpc_request request;
  char message[CLT_MESSAGE_MAX];
  rpc_code code = rpc_parse(line, length, &request, message, sizeof message);
  if (code == RPC_FINE) {
    service->handler(service->context, from, &request);
  } else {
    client_send(from, rpc_error(request.id, code, message));
  }
  rpc_finish(&request);
}

/* Answers the whole lines that have come, up to one whose reply is deferred. */
static void answer_lines(server *service, client *from) {
  const char *line;
  size_t length;
  lines_outcome outcome = LINES_NONE;
  while (!from->closing && !from->choked && from->deferred.kind == 0 &&
         (outcome = lines_next(&from->input, &line, &length)) == LINES_READY) {
    answer_line(service, from, line, length);
  }
  if (outcome == LINES_TOO_LONG) {
    client_send(from, rpc_error(NULL, RPC_INVALID_REQUEST, "a line is longer than 65536 bytes; closing"));
    from->closing = true;
  }
}

static int on_client(sd_event_source *source, int descriptor, uint32_t events, void *userdata) {
  (void)source, (void)descriptor;
  client *connection = userdata;
  server *service = connection->owner;
  if ((client_events(connection) & EPOLLIN) == 0) {
    connection->gone = connection->gone || (events & (EPOLLHUP | EPOLLERR)) != 0;
  } else if ((events & (EPOLLIN | EPOLLHUP | EPOLLERR)) != 0) {
    bool open = client_receive(connection);
    answer_lines(service, connection);
    connection->closing = connection->closing || !open;
  }
  settle(connection);
  if (client_is_over(connection)) {
    drop(service, connection);
  }
  return 0;
}

/* Tells a client why it is not served. A crowd of them is logged once. */
static void turn_away(server *service, client *unwanted, const char *why) {
  if (!service->complained) {
    clt_log(CLT_LOG_WARNING, "control socket: pid %ld uid %ld refused: %s", (long)unwanted->who.pid,
            (long)unwanted->who.uid, why);
  }
  service->complained = true;
  client_send(unwanted, rpc_error(NULL, RPC_FAILED, why));
  client_flush(unwanted);
  client_destroy(unwanted);
}

static void admit(server *service, int descriptor) {
  peer who;
  if (!peer_read(descriptor, service->group, &who)) {
    close(descriptor);
    return;
  }
  client *added = client_create(descriptor, &who);
  if (added == NULL) {
    return;
  }
  if (!peer_allowed(&who)) {
    turn_away(service, added, "not allowed: neither root nor the daemon's user nor of its group");
    return;
  }
  if (service->count >= SERVER_CLIENTS_MOST ||
      sd_event_add_io(service->loop, &added->source, descriptor, EPOLLIN, on_client, added) < 0) {
    turn_away(service, added, "too many clients; close another one");
    return;
  }
  service->complained = false;
  added->owner = service;
  added->next = service->clients;
  service->clients = added;
  service->count++;
}

static int on_connect(sd_event_source *source, int descriptor, uint32_t events, void *userdata) {
  (void)source, (void)events;
  int accepted = accept4(descriptor, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (accepted >= 0) {
    admit(userdata, accepted);
  } else if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) {
    clt_log(CLT_LOG_WARNING, "control socket: cannot accept: %s", strerror(errno));
  }
  return 0;
}

clt_status server_create(sd_event *loop, int descriptor, gid_t group, server_handler handler, void *context,
                         server **out, clt_error *error) {
  server *service = clt_alloc(1, sizeof *service);
  if (service == NULL) {
    return clt_fail(error, CLT_FAILED, "the control socket: out of memory");
  }
  *service = (server){.loop = loop, .group = group, .handler = handler, .context = context};
  int outcome = sd_event_add_io(loop, &service->source, descriptor, EPOLLIN, on_connect, service);
  if (outcome < 0) {
    free(service);
    return clt_fail(error, CLT_FAILED, "the control socket cannot be watched: %s", strerror(-outcome));
  }
  *out = service;
  return CLT_OK;
}

void server_destroy(server *service) {
  if (service == NULL) {
    return;
  }
  while (service->clients != NULL) {
    drop(service, service->clients);
  }
  sd_event_source_disable_unref(service->source);
  free(service);
}

void server_reply(client *to, const rpc_request *request, json_t *result) {
  if (request->id == NULL) {
    json_decref(result);
    return;
  }
  client_send(to, rpc_result(request->id, result));
}

void server_refuse(client *to, const rpc_request *request, rpc_code code, const char *message) {
  if (request->id != NULL) {
    client_send(to, rpc_error(request->id, code, message));
  }
}

void server_defer(client *to, const rpc_request *request, unsigned kind, uint64_t ticket) {
  to->deferred = (client_deferred){kind, ticket, json_incref(request->id)};
}

static void complete_client(client *to, json_t *result, const clt_error *error) {
  json_t *id = to->deferred.id;
  to->deferred = (client_deferred){0};
  if (id != NULL) {
    rpc_code code = error->status == CLT_BAD_INPUT ? RPC_INVALID_PARAMS : RPC_FAILED;
    client_send(to, result != NULL ? rpc_result(id, json_incref(result)) : rpc_error(id, code, error->message));
  }
  json_decref(id);
}

void server_complete(server *service, unsigned kind, uint64_t ticket, json_t *result, const clt_error *error) {
  for (client *to = service->clients; to != NULL; to = to->next) {
    if (to->deferred.kind == kind && to->deferred.ticket == ticket) {
      complete_client(to, result, error);
      answer_lines(service, to);
      settle(to);
    }
  }
}

void server_notify(server *service, const char *method, json_t *params) {
  json_t *document = rpc_notification(method, params);
  for (client *to = service->clients; to != NULL; to = to->next) {
    if (to->subscribed && !to->closing) {
      json_decref(to->progress);
      to->progress = NULL;
      client_send(to, json_incref(document));
      settle(to);
    }
  }
  json_decref(document);
}

void server_notify_latest(server *service, const char *method, json_t *params) {
  json_t *document = rpc_notification(method, params);
  for (client *to = service->clients; to != NULL; to = to->next) {
    if (to->subscribed && !to->closing) {
      json_decref(to->progress);
      to->progress = json_incref(document);
      settle(to);
    }
  }
  json_decref(document);
}

void server_flush(server *service) {
  for (client *to = service->clients; to != NULL; to = to->next) {
    client_flush(to);
  }
}
