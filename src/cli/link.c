#include "cli/link.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/places.h"

enum { INVALID_PARAMS = -32602 };

static clt_status connect_to(cli_link *connection, clt_error *error) {
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  const char *path = connection->path;
  if (strlen(path) >= sizeof address.sun_path) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: a socket's path has at most %zu characters", path,
                    sizeof address.sun_path - 1);
  }
  strcpy(address.sun_path, path);
  connection->descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connection->descriptor < 0 ||
      connect(connection->descriptor, (const struct sockaddr *)&address, sizeof address) != 0) {
    const char *remedy = errno == EACCES ? "join the group of the socket, or ask root"
                                         : "start counterlightd, or name its socket with --socket or "
                                           "COUNTERLIGHT_SOCKET";
    return clt_fail(error, CLT_FAILED, "no daemon answers at %s: %s; %s", path, strerror(errno), remedy);
  }
  connection->input = fdopen(connection->descriptor, "r");
  return connection->input != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "%s: %s", path, strerror(errno));
}

clt_status cli_link_open(const char *path, cli_link *connection, clt_error *error) {
  *connection = (cli_link){.descriptor = -1};
  clt_status status = CLT_OK;
  if (path == NULL) {
    status = clt_place_socket(connection->path, error);
  } else if (snprintf(connection->path, sizeof connection->path, "%s", path) >= CLT_PATH_MAX) {
    status = clt_fail(error, CLT_BAD_INPUT, "--socket: the path is too long");
  }
  status = status == CLT_OK ? connect_to(connection, error) : status;
  if (status != CLT_OK) {
    cli_link_close(connection);
  }
  return status;
}

void cli_link_close(cli_link *connection) {
  if (connection->input != NULL) {
    fclose(connection->input);
  } else if (connection->descriptor >= 0) {
    close(connection->descriptor);
  }
  free(connection->line);
  *connection = (cli_link){.descriptor = -1};
}

/* The descriptor travels with the first bytes; a stream socket that blocks takes the rest in order. */
static clt_status send_line(const cli_link *connection, const char *text, size_t length, int passed, clt_error *error) {
  union {
    struct cmsghdr header;
    char bytes[CMSG_SPACE(sizeof(int))];
  } control = {.bytes = {0}};
  struct iovec part = {.iov_base = (void *)(size_t)text, .iov_len = length};
  struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
  if (passed >= 0) {
    control.header =
        (struct cmsghdr){.cmsg_len = CMSG_LEN(sizeof(int)), .cmsg_level = SOL_SOCKET, .cmsg_type = SCM_RIGHTS};
    memcpy(CMSG_DATA(&control.header), &passed, sizeof passed);
    message.msg_control = control.bytes;
    message.msg_controllen = sizeof control.bytes;
  }
  while (part.iov_len > 0) {
    ssize_t count = sendmsg(connection->descriptor, &message, MSG_NOSIGNAL);
    if (count < 0 && errno != EINTR) {
      return clt_fail(error, CLT_FAILED, "%s: the daemon hung up: %s", connection->path, strerror(errno));
    }
    part.iov_base = (char *)part.iov_base + (count > 0 ? count : 0);
    part.iov_len -= count > 0 ? (size_t)count : 0;
    message.msg_control = count > 0 ? NULL : message.msg_control;
    message.msg_controllen = count > 0 ? 0 : message.msg_controllen;
  }
  return CLT_OK;
}

static clt_status send_request(const cli_link *connection, const char *method, json_t *params, int passed,
                               clt_error *error) {
  json_t *request = json_pack("{s:s, s:i, s:s, s:o*}", "jsonrpc", "2.0", "id", 1, "method", method, "params", params);
  char *text = request != NULL ? json_dumps(request, JSON_COMPACT) : NULL;
  json_decref(request);
  if (text == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "the request cannot be written as JSON: is a name no UTF-8?");
  }
  size_t length = strlen(text);
  text[length] = '\n';
  clt_status status = send_line(connection, text, length + 1, passed, error);
  free(text);
  return status;
}

static clt_status read_document(cli_link *connection, json_t **document, clt_error *error) {
  ssize_t length = getline(&connection->line, &connection->room, connection->input);
  if (length <= 0) {
    return clt_fail(error, CLT_FAILED, "%s: the daemon hung up; its log says why", connection->path);
  }
  *document = json_loadb(connection->line, (size_t)length, 0, NULL);
  return *document != NULL
             ? CLT_OK
             : clt_fail(error, CLT_FAILED, "%s: what answers there is no counterlightd", connection->path);
}

static clt_status refusal(const json_t *failure, clt_error *error) {
  json_int_t code = json_integer_value(json_object_get(failure, "code"));
  const char *message = json_string_value(json_object_get(failure, "message"));
  return clt_fail(error, code == INVALID_PARAMS ? CLT_BAD_INPUT : CLT_FAILED, "%s",
                  message != NULL ? message : "the daemon gave no reason");
}

clt_status cli_link_call(cli_link *connection, const char *method, json_t *params, int descriptor, json_t **result,
                         clt_error *error) {
  json_t *document = NULL;
  clt_status status = send_request(connection, method, params, descriptor, error);
  while (status == CLT_OK && (document == NULL || json_object_get(document, "id") == NULL)) {
    json_decref(document);
    document = NULL;
    status = read_document(connection, &document, error);
  }
  if (status == CLT_OK) {
    const json_t *failure = json_object_get(document, "error");
    *result = json_incref(json_object_get(document, "result"));
    status = failure != NULL ? refusal(failure, error) : CLT_OK;
  }
  json_decref(document);
  return status;
}

clt_status cli_link_next(cli_link *connection, json_t **notification, clt_error *error) {
  return read_document(connection, notification, error);
}
