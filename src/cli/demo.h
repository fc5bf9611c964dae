/* The demo: the whole light path once, and what it gave. */
#ifndef CLT_CLI_DEMO_H
#define CLT_CLI_DEMO_H

#include <jansson.h>

#include "cli/picture.h"
#include "cli/progress.h"
#include "counterlight/solve.h"
#include "counterlight/station.h"
#include "counterlight/transport.h"

/* Wall time of each step, s. */
typedef struct demo_timings {
  double scene, acquire, certify, photograph, reference, total;
} demo_timings;

/* One method's way to the unbounded or bounded solution of the same target. */
enum { DEMO_RACE_MAX = 6 };
typedef struct demo_race {
  int count;
  clt_solve_result runs[DEMO_RACE_MAX];
} demo_race;

/* One drive as it looked to the rig. */
enum { DEMO_OBSERVATIONS = 8 };
typedef struct demo_sight {
  clt_image radiance;  /* the photograph, the mean of DEMO_OBSERVATIONS */
  double gain;         /* brightness factor that the error and the pictures are taken with */
  double error;        /* ||gain * radiance - target|| / ||target|| over lit cells */
  double exact_error;  /* the same for the scene's own noise-free radiance */
  clt_image error_map; /* one channel: rms over channels of |gain * radiance - target| / white */
} demo_sight;

typedef struct demo {
  char folder[CLT_PATH_MAX];    /* of the results, without a slash at its end */
  const char *scene;            /* its file */
  char own_scene[CLT_PATH_MAX]; /* where none is given */
  const char *target_path;      /* NULL: the picture that is drawn */
  clt_white white;
  clt_station_config config;
  clt_station station;
  cli_grid grid;
  clt_panel panel; /* of the projector */
  cli_progress progress;
  clt_image picture; /* the target, linear, white = 1 */
  clt_transport *transport;
  clt_certificate *certificate;
  clt_image target; /* the radiance wanted */
  clt_image drive;
  clt_compensation result; /* as predicted by the acquired transport */
  demo_sight before, after;
  demo_race race;     /* every method that serves here, for the report's curves */
  double error_limit; /* on the scene's exact transport */
  double map_top;     /* the top of the error maps' colour scale, in units of white */
  demo_timings timings;
} demo;

/* Every step from opening the scene to the error maps; writes nothing. folder, scene, target_path, white and config
 * are filled by the caller. */
clt_status demo_run(demo *d, clt_error *error);
/* Frees all of it; accepts one that stopped half way. */
void demo_finish(demo *d);

/* Solves once more with every method that takes this transport. */
clt_status demo_race_methods(demo *d, clt_error *error);

/* What summary.json and --json hold. */
json_t *demo_summary(const demo *d);
/* Makes the folder and writes every result into it. */
clt_status demo_write(const demo *d, clt_error *error);

#endif
