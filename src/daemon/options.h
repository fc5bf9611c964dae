/* The command line of counterlightd. */
#ifndef CLT_DAEMON_OPTIONS_H
#define CLT_DAEMON_OPTIONS_H

#include <stdbool.h>

#include "daemon/config.h"

typedef struct daemon_options {
  const char *config;
  const char *transport; /* to try, as the daemon itself asks for; NULL: not asked */
  daemon_overrides overrides;
  bool check, states, help, version;
} daemon_options;

/* False where the arguments are wrong (getopt has said how). */
bool daemon_options_read(int count, char **arguments, daemon_options *options);
void daemon_options_help(void);

#endif
