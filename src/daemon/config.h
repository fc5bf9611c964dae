/* The daemon's configuration: the station's sections and the section "daemon" of one file (docs/configuration.md). */
#ifndef CLT_DAEMON_CONFIG_H
#define CLT_DAEMON_CONFIG_H

#include <stdbool.h>

#include "counterlight/live.h"
#include "counterlight/solve.h"
#include "counterlight/station.h"

/* What follows where a photograph shows that T no longer fits the room. */
typedef enum misfit_policy { MISFIT_REACQUIRE, MISFIT_REFINE, MISFIT_REPORT } misfit_policy;

typedef struct daemon_config {
  clt_station_config station;
  char path[CLT_PATH_MAX];    /* of the file itself */
  char socket[CLT_PATH_MAX];  /* control socket */
  char state[CLT_PATH_MAX];   /* state directory */
  char group[64];             /* that may use the socket; empty: none */
  char content[CLT_PATH_MAX]; /* the picture to show, or the film (image/film.h) */
  clt_live_options live;      /* of a film's frames */
  bool reach;                 /* they are scaled and lifted so that every cell can be reached */
  double picture_s;           /* that each picture of a folder is shown */
  bool reuse;                 /* at start a stored transport is used (else a new one is measured) */
  double verify_s;            /* time between verifications, s; 0: none */
  double reacquire_error;     /* a verified error above which the transport is measured again; 0: never */
  misfit_policy on_misfit;
  double drift_limit; /* of error and brightness in an hour, above which a warning is given; 0: never */
  double retry_least_s, retry_most_s;
  char method[24]; /* of the solve */
  clt_solve_options solve;
  clt_white white;
} daemon_config;

/* What the command line says in place of the file; NULL: the file decides. */
typedef struct daemon_overrides {
  const char *socket, *state;
} daemon_overrides;

/* Reads the file. CLT_BAD_INPUT with file, line, key and the legal range. solve.method points into config: a copy is
 * made by daemon_config_copy. */
clt_status daemon_config_read(const char *path, const daemon_overrides *overrides, daemon_config *config,
                              clt_error *error);
/* Reads what the configuration names: the scene must open, the content must be a picture. */
clt_status daemon_config_check(const daemon_config *config, clt_error *error);
void daemon_config_copy(const daemon_config *from, daemon_config *to);

/* The first setting that differs and holds only from the next start on ("socket", "devices", ...), or NULL. */
const char *daemon_config_needs_restart(const daemon_config *running, const daemon_config *wanted);

#endif
