/* Where the daemon and its client meet, and where the daemon keeps its state, while nobody names other places. */
#ifndef CLT_BASE_PLACES_H
#define CLT_BASE_PLACES_H

#include "counterlight/status.h"

/* The control socket that this user's daemon makes. root: /run/counterlight/control.sock; another user:
 * $XDG_RUNTIME_DIR/counterlight/control.sock, or control.sock in the state directory without that. Under systemd
 * ($RUNTIME_DIRECTORY): control.sock there. out has room for CLT_PATH_MAX. */
clt_status clt_place_own_socket(char *out, clt_error *error);
/* The control socket that a client of this user talks to: $COUNTERLIGHT_SOCKET, else that of this user's own daemon
 * where it exists, else /run/counterlight/control.sock. */
clt_status clt_place_socket(char *out, clt_error *error);
/* The state directory. root: /var/lib/counterlight; another user: $XDG_STATE_HOME/counterlight or
 * ~/.local/state/counterlight. Under systemd: $STATE_DIRECTORY. */
clt_status clt_place_state(char *out, clt_error *error);
/* Makes a folder and those above it that are missing, with the mode less the umask. An existing one stays as it is. */
clt_status clt_place_make_folder(const char *path, unsigned mode, clt_error *error);

#endif
