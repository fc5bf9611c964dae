/* The control loop: owns the state machine and decides what the other threads do. One struct, these files:
 * control.c (events of the loop), actions.c (what the machine's actions do), jobs.c (work given to the other threads
 * and its answers), plays.c (content that moves), verdicts.c (what photographs say), methods.c (what clients may ask),
 * report.c (what they are told).
 */
#ifndef CLT_DAEMON_CONTROL_H
#define CLT_DAEMON_CONTROL_H

#include <systemd/sd-event.h>
#include <time.h>

#include "base/log.h"
#include "daemon/config.h"
#include "daemon/letters.h"
#include "daemon/listen.h"
#include "daemon/machine.h"
#include "daemon/notify.h"
#include "daemon/server.h"
#include "daemon/trend.h"

/* What a client's deferred reply waits for. */
enum { WAITS_FOR_CONTENT = 1, WAITS_FOR_SNAPSHOT = 2, WAITS_FOR_TRADEOFF = 3 };

/* What the clients and the configuration asked for and nobody has done yet. */
typedef struct control_wishes {
  unsigned solver;        /* bit set of solver_kind */
  bool acquire;           /* a new transport is owed, through failures and retries, until it serves */
  bool anew;              /* it was asked for, so that none that was interrupted is resumed */
  bool owed;              /* one of an earlier run goes on once the stored transport serves */
  measure_kind scope;     /* of that: MEASURE_PHOTOMETRY, MEASURE_CHANGED, MEASURE_GEOMETRY, else all of it */
  bool refine;            /* asked for, at the next verification */
  bool snapshot;          /* to be written when the picture has been photographed */
  int content_descriptor; /* of SOLVER_CONTENT; -1: the configured picture */
  char content_name[CLT_PATH_MAX];
  uint64_t content_ticket, snapshot_ticket;
  clt_transport *transport; /* of SOLVER_ADOPT */
} control_wishes;

/* What the other threads are at. */
typedef struct control_work {
  uint64_t number;         /* of the newest job of each thread; they share the count */
  uint64_t measure_number; /* newest job of measure */
  bool measuring, solving; /* its answer is not here yet */
  solver_kind solver_kind; /* of the job that is being solved */
  bool rigless;            /* it looks for a transport before the rig is known */
  uint64_t content_ticket, snapshot_ticket;
  moving_job playing; /* the last one given to moving; its model is for comparison only */
} control_work;

/* What they found. */
typedef struct control_findings {
  bool open; /* the projector is */
  output_opened devices;
  char camera[32]; /* its driver; empty while it is not open */
  camera_frames camera_frames;
  bool calibrated;             /* what follows is known */
  int width, height, channels; /* of the grid */
  char response[32], source[CLT_TEXT_MAX];
  transport_facts transport;
  daemon_model *model;      /* the transport itself, held; NULL: none */
  daemon_picture picture;   /* the last drive that was computed */
  uint64_t picture_content; /* content_serial that it is for */
  json_t *tradeoff;         /* what accuracy costs with that picture; NULL: not measured yet */
  uint64_t content_serial;  /* counts pictures that were asked for */
  char content[CLT_PATH_MAX];
  trend trend;           /* of verifications since the picture was computed */
  bool drifts;           /* faster than the configuration allows */
  renewal renewed;       /* by the last `reacquire` of less than the whole transport */
  clt_image observation; /* of the last verification; may be empty */
  double verified_error; /* < 0: not verified since the picture changed */
  time_t verified;
  bool checked; /* fit is that of the last verification */
  clt_fit fit;
  refinement refined; /* of the picture that is up; photographs 0: as it was solved for */
  output_frames frames;
  moving_report moved; /* serial 0: nothing moves yet */
  measure_progress progress;
} control_findings;

typedef struct control {
  const daemon_boxes *boxes;
  listener *listening;
  daemon_overrides overrides;
  daemon_config config;
  sd_event *loop;
  sd_event_source *wake, *signals[3], *retry, *verify, *grace;
  server *service;
  notifier notify;
  machine_state state;
  time_t since;
  char why[CLT_MESSAGE_MAX]; /* why it holds; empty where nothing is wrong */
  int attempt;               /* failures in a row */
  uint64_t tickets;
  control_wishes wishes;
  control_work work;
  control_findings found;
} control;

/* Makes the loop and serves the socket. The pointers must outlive the control; content is the picture's name. */
clt_status control_create(const daemon_boxes *boxes, listener *listening, const daemon_config *config,
                          const daemon_overrides *overrides, const char *content, control **out, clt_error *error);
/* The thread: runs until main has reported that everything ended. self: a control. */
void *control_run(void *self);
void control_destroy(control *self); /* accepts NULL */

/* control.c: takes an event; false where the table refuses it in this state. */
bool control_event(control *self, machine_event event);
/* Keeps why something failed, for the status, and logs it. */
void control_blame(control *self, const clt_error *error);
/* Starts a timer, seconds from now. */
void control_arm(sd_event_source *timer, double seconds);
/* Reads the configuration again; on failure the old one stays. *restart: what holds only from the next start on, or
 * NULL. */
clt_status control_reload(control *self, const char **restart, clt_error *error);

/* actions.c */
void control_act(control *self, machine_action action);

/* jobs.c */
/* Whether there is a square transport of the rig's grid. */
bool control_has_model(const control *self);
void control_measure(control *self, measure_kind kind);
void control_want(control *self, solver_kind kind);
/* Tells the solver to give up what can wait. */
void control_hasten(control *self);
/* True while what accuracy costs is being measured, or owed. */
bool control_measures_cost(const control *self);
void control_on_opened(control *self, output_opened *letter);
void control_on_measured(control *self, measure_result *letter);
void control_on_solved(control *self, solver_result *letter);
void control_finish_jobs(control *self);

/* plays.c: the configured content moves while it is what is shown; what `show` brings is always a picture. */
bool control_moves(const control *self);
/* plays.c: has the content move, where it does and that is not so yet; ends that with the daemon. */
void control_play(control *self);
void control_stop_moving(control *self);
void control_on_moved(control *self, const moving_report *letter);

/* verdicts.c */
void control_on_verification(control *self, measure_result *letter);
void control_on_refinement(control *self, measure_result *letter);
void control_on_renewal(control *self, const measure_result *letter);

/* methods.c: a server_handler; context: a control. */
void control_on_request(void *context, client *from, const rpc_request *request);

/* report.c: new documents. */
json_t *control_status(const control *self);
json_t *control_state_note(const control *self);
/* What the last verification found; null where there is none. */
json_t *control_verify_note(const control *self);
/* How fast the verifications drift; null where that is not known. */
json_t *control_drift_note(const control *self);
/* What the last reacquisition of less than the whole transport found; null where there is none. */
json_t *control_renewed_note(const control *self);
/* Paths of the last snapshot. */
json_t *control_snapshot_note(const control *self);
/* How the film plays; null where nothing moves. */
json_t *control_moving_note(const control *self);
json_t *control_progress_note(const measure_progress *progress);
/* One line for systemd's STATUS= and the log. */
void control_status_line(const control *self, char *line, size_t size);
/* Logs a line; the journal gets state, reason, content and devices as fields of their own. */
void control_note(const control *self, clt_log_level level, const char *line);

#endif
