/* A connection to the daemon's control socket (docs/control-socket.md). */
#ifndef CLT_CLI_LINK_H
#define CLT_CLI_LINK_H

#include <jansson.h>
#include <stdio.h>

#include "counterlight/status.h"

typedef struct cli_link {
  int descriptor;
  FILE *input;
  char *line; /* the last one read */
  size_t room;
  char path[CLT_PATH_MAX];
} cli_link;

/* Connects to path, NULL meaning the usual one (base/places.h). CLT_FAILED where no daemon listens there. */
clt_status cli_link_open(const char *path, cli_link *connection, clt_error *error);
void cli_link_close(cli_link *connection); /* accepts a closed one */

/* Asks and waits for the reply; notifications that come before it are dropped. params (NULL: none) is taken over;
 * descriptor is passed along where it is not negative. *result is the caller's. A refusal is CLT_BAD_INPUT where the
 * request was wrong, else CLT_FAILED, with the daemon's message. */
clt_status cli_link_call(cli_link *connection, const char *method, json_t *params, int descriptor, json_t **result,
                         clt_error *error);
/* Waits for the next notification, which is the caller's. */
clt_status cli_link_next(cli_link *connection, json_t **notification, clt_error *error);

#endif
