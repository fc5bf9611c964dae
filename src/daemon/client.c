#include "daemon/client.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/memory.h"

enum { DESCRIPTORS_READ = 8 };

client *client_create(int descriptor, const peer *who) {
  client *connection = clt_alloc(1, sizeof *connection);
  if (connection == NULL) {
    close(descriptor);
    return NULL;
  }
  connection->descriptor = descriptor;
  connection->passed = -1;
  connection->who = *who;
  return connection;
}

void client_destroy(client *connection) {
  if (connection == NULL) {
    return;
  }
  sd_event_source_disable_unref(connection->source);
  if (connection->passed >= 0) {
    close(connection->passed);
  }
  close(connection->descriptor);
  json_decref(connection->progress);
  json_decref(connection->deferred.id);
  free(connection->output);
  free(connection);
}

/* Keeps the last descriptor of a message and closes the others. */
static void keep_passed(client *connection, struct msghdr *message) {
  for (struct cmsghdr *part = CMSG_FIRSTHDR(message); part != NULL; part = CMSG_NXTHDR(message, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_RIGHTS) {
      continue;
    }
    size_t count = (part->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (size_t i = 0; i < count; i++) {
      if (connection->passed >= 0) {
        close(connection->passed);
      }
      memcpy(&connection->passed, CMSG_DATA(part) + i * sizeof(int), sizeof(int));
    }
  }
}

bool client_receive(client *connection) {
  union {
    struct cmsghdr header;
    char bytes[CMSG_SPACE(DESCRIPTORS_READ * sizeof(int))];
  } control;
  struct iovec part;
  part.iov_base = lines_space(&connection->input, &part.iov_len);
  if (part.iov_len == 0) {
    return true;
  }
  struct msghdr message = {
      .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
  ssize_t count = recvmsg(connection->descriptor, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  if (count < 0) {
    return errno == EAGAIN || errno == EINTR;
  }
  keep_passed(connection, &message);
  lines_add(&connection->input, (size_t)count);
  return count > 0;
}

static bool make_room(client *connection, size_t length) {
  if (connection->sent > 0) {
    memmove(connection->output, connection->output + connection->sent, connection->used - connection->sent);
    connection->used -= connection->sent;
    connection->sent = 0;
  }
  if (connection->used + length <= connection->room) {
    return true;
  }
  size_t room = 2 * (connection->used + length);
  char *larger = connection->used + length <= CLIENT_OUTPUT_MOST ? realloc(connection->output, room) : NULL;
  if (larger == NULL) {
    return false;
  }
  connection->output = larger;
  connection->room = room;
  return true;
}

static void append(client *connection, const char *bytes, size_t length) {
  if (connection->choked || (connection->used + length > connection->room && !make_room(connection, length))) {
    connection->choked = true;
    return;
  }
  memcpy(connection->output + connection->used, bytes, length);
  connection->used += length;
}

void client_send(client *connection, json_t *document) {
  char *text = document != NULL ? json_dumps(document, JSON_COMPACT) : NULL;
  json_decref(document);
  if (text == NULL) {
    connection->choked = true;
    return;
  }
  append(connection, text, strlen(text));
  append(connection, "\n", 1);
  free(text);
}

bool client_has_output(const client *connection) {
  return connection->sent < connection->used;
}

static void write_out(client *connection) {
  while (client_has_output(connection)) {
    ssize_t count = send(connection->descriptor, connection->output + connection->sent,
                         connection->used - connection->sent, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count < 0) {
      connection->gone = connection->gone || (errno != EAGAIN && errno != EINTR);
      return;
    }
    connection->sent += (size_t)count;
  }
}

void client_flush(client *connection) {
  write_out(connection);
  if (connection->progress != NULL && !client_has_output(connection) && !connection->choked) {
    json_t *progress = connection->progress;
    connection->progress = NULL;
    client_send(connection, progress);
    write_out(connection);
  }
}

bool client_is_over(const client *connection) {
  bool done = connection->closing && !client_has_output(connection) && connection->deferred.kind == 0;
  return connection->choked || connection->gone || done;
}

uint32_t client_events(const client *connection) {
  bool reads = !connection->closing && connection->deferred.kind == 0;
  return (reads ? EPOLLIN : 0u) | (client_has_output(connection) ? EPOLLOUT : 0u);
}

int client_take_passed(client *connection) {
  int passed = connection->passed;
  connection->passed = -1;
  return passed;
}
