#include "daemon/listen.h"

#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "daemon/peer.h"

enum { BACKLOG = 128 };

static clt_status take_passed(listener *out, int count, clt_error *error) {
  if (count != 1 || sd_is_socket_unix(SD_LISTEN_FDS_START, SOCK_STREAM, 1, NULL, 0) <= 0) {
    return clt_fail(error, CLT_FAILED,
                    "systemd passed %d sockets, or none that is a listening unix stream; the socket unit needs exactly "
                    "one ListenStream= path",
                    count);
  }
  out->descriptor = SD_LISTEN_FDS_START;
  fcntl(out->descriptor, F_SETFL, fcntl(out->descriptor, F_GETFL) | O_NONBLOCK);
  return CLT_OK;
}

/* True where something accepts connections at the address. */
static bool is_alive(const struct sockaddr_un *address) {
  int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  bool alive = probe >= 0 && (connect(probe, (const struct sockaddr *)address, sizeof *address) == 0 ||
                              errno == EAGAIN || errno == EACCES || errno == EPERM);
  if (probe >= 0) {
    close(probe);
  }
  return alive;
}

/* Removes the socket of a daemon that is gone. A file that is no socket is left alone. */
static clt_status clear_address(const struct sockaddr_un *address, clt_error *error) {
  struct stat found;
  if (lstat(address->sun_path, &found) != 0) {
    return CLT_OK;
  }
  if (!S_ISSOCK(found.st_mode)) {
    return clt_fail(error, CLT_FAILED, "%s: is there and is no socket; remove it or choose another path",
                    address->sun_path);
  }
  if (is_alive(address)) {
    return clt_fail(error, CLT_FAILED,
                    "%s: another counterlightd listens there; stop it first, or give this one another --socket and "
                    "--state",
                    address->sun_path);
  }
  clt_log(CLT_LOG_NOTICE, "%s: replacing the socket of a daemon that no longer runs", address->sun_path);
  unlink(address->sun_path);
  return CLT_OK;
}

static void give_to_group(const char *path, const char *group) {
  gid_t number = group != NULL && group[0] != '\0' ? peer_group(group) : (gid_t)-1;
  if (group != NULL && group[0] != '\0' && number == (gid_t)-1) {
    clt_log(CLT_LOG_WARNING, "group \"%s\" does not exist: only root and this user can use %s", group, path);
  } else if (number != (gid_t)-1 && chown(path, (uid_t)-1, number) != 0) {
    clt_log(CLT_LOG_WARNING, "%s cannot be given to group \"%s\": %s", path, group, strerror(errno));
  }
}

static clt_status bind_and_listen(const struct sockaddr_un *address, const char *group, listener *out,
                                  clt_error *error) {
  out->descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  mode_t before = umask(0117);
  bool bound = out->descriptor >= 0 && bind(out->descriptor, (const struct sockaddr *)address, sizeof *address) == 0;
  int cause = errno;
  umask(before);
  if (!bound) {
    return clt_fail(error, CLT_FAILED, "%s: the control socket cannot be bound: %s; choose another path (--socket)",
                    address->sun_path, strerror(cause));
  }
  out->bound = true;
  snprintf(out->path, sizeof out->path, "%s", address->sun_path);
  give_to_group(address->sun_path, group);
  if (listen(out->descriptor, BACKLOG) != 0) {
    return clt_fail(error, CLT_FAILED, "%s: the control socket cannot listen: %s", address->sun_path, strerror(errno));
  }
  return CLT_OK;
}

static clt_status bind_path(const char *path, const char *group, listener *out, clt_error *error) {
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  if (strlen(path) >= sizeof address.sun_path) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: a socket's path has at most %zu characters; choose a shorter one", path,
                    sizeof address.sun_path - 1);
  }
  strcpy(address.sun_path, path);
  clt_status status = clear_address(&address, error);
  return status == CLT_OK ? bind_and_listen(&address, group, out, error) : status;
}

clt_status listener_open(const char *path, const char *group, listener *out, clt_error *error) {
  *out = (listener){.descriptor = -1};
  int passed = sd_listen_fds(1);
  clt_status status = passed > 0 ? take_passed(out, passed, error) : bind_path(path, group, out, error);
  if (status != CLT_OK) {
    listener_close(out);
  }
  return status;
}

void listener_close(listener *listening) {
  if (listening->bound) {
    unlink(listening->path);
  }
  if (listening->descriptor >= 0) {
    close(listening->descriptor);
  }
  *listening = (listener){.descriptor = -1};
}
