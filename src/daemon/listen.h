/* The control socket's address: taken from systemd, or bound here. */
#ifndef CLT_DAEMON_LISTEN_H
#define CLT_DAEMON_LISTEN_H

#include <stdbool.h>

#include "counterlight/status.h"

typedef struct listener {
  int descriptor;          /* listening, non-blocking; -1 where closed */
  bool bound;              /* bound here: the file is ours to remove */
  char path[CLT_PATH_MAX]; /* empty where systemd handed it over */
} listener;

/* Takes the one socket that systemd passed (sd_listen_fds), else binds path with mode 0660 and the group (NULL or one
 * that does not exist: the daemon's own, with a warning). The file of a daemon that no longer runs is replaced;
 * CLT_FAILED where a live one listens there or the path cannot be bound; CLT_BAD_INPUT where it is too long. */
clt_status listener_open(const char *path, const char *group, listener *out, clt_error *error);
/* Closes and removes what was bound here; accepts a closed one. */
void listener_close(listener *listening);

#endif
