/* One connection of the control socket: its input cut into lines, its output buffered with a limit. */
#ifndef CLT_DAEMON_CLIENT_H
#define CLT_DAEMON_CLIENT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>
#include <systemd/sd-event.h>

#include "daemon/lines.h"
#include "daemon/peer.h"

enum { CLIENT_OUTPUT_MOST = 1024 * 1024 }; /* bytes that wait for a client to read; more, and it is dropped */

/* What a client waits for. */
typedef struct client_deferred {
  unsigned kind;   /* 0: nothing; else the owner's own code */
  uint64_t ticket; /* the owner's own number of the work */
  json_t *id;      /* of the request, NULL: none */
} client_deferred;

typedef struct client {
  int descriptor;
  int passed; /* a descriptor that came along and no request has taken yet; -1: none */
  peer who;
  bool subscribed;
  bool closing;     /* no more is read; closed once the output is out */
  bool choked;      /* the output limit was passed */
  bool gone;        /* the other end is closed */
  json_t *progress; /* the latest progress that did not fit yet, or NULL */
  client_deferred deferred;
  sd_event_source *source;
  void *owner;
  char *output; /* bytes[sent..used) wait */
  size_t sent, used, room;
  lines input;
  struct client *next;
} client;

/* Takes descriptor over; NULL (and closed) where memory is short. */
client *client_create(int descriptor, const peer *who);
void client_destroy(client *connection);

/* Reads what there is, once, with at most one passed descriptor. False at the end of the stream. */
bool client_receive(client *connection);
/* Queues a document as one line and frees it; marks the client choked where the limit is passed. */
void client_send(client *connection, json_t *document);
/* Writes what the socket takes now, then the latest progress where nothing else waits. */
void client_flush(client *connection);
/* The events that the client waits for (EPOLLIN, EPOLLOUT). */
uint32_t client_events(const client *connection);
bool client_has_output(const client *connection);
/* True where the client is to be destroyed: choked, gone, or closing with nothing left to send or to wait for. */
bool client_is_over(const client *connection);
/* The descriptor that came along, now the caller's; -1: none. */
int client_take_passed(client *connection);

#endif
