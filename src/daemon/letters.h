/* The daemon's threads, who owns what, and the letters between them.
 *
 *   main      (output.c)   begins and ends the station, owns the projector (opens it, closes it where it is lost),
 *                          presents; never waits for another thread for longer than one refresh
 *   measure   (measure.c)  owns the station's camera and rig (opens them, closes them where the camera is lost); the
 *                          rig projects through a stand-in (standin.c) that hands each pattern to main
 *   solver    (solver.c)   owns the content, the transport with its certificate, and the files of the state directory
 *                          (calibration.h5 is measure's)
 *   moving    (moving.c)   owns the film that plays (player.c, with a thread that decodes) and makes a moving picture
 *                          of each frame
 *   control   (control.c)  owns the state machine, the control socket, signals, timers and the watchdog; decides what
 *                          the others do and keeps copies of what they found
 *
 * A letter belongs to the sender until it is put, to the mailbox until it is taken, then to the receiver. Mailboxes
 * (not the reel) keep the latest letter only, so:
 *   - every job has a number, and its answer carries it: an answer with an older number is out of date and dropped;
 *   - a newer job for `measure` cancels the one it works on (noticed at its next pattern);
 *   - control gives `solver` a job only when it has answered the last one: no job of its is ever lost.
 * Letters to control also count up the eventfd `wake`. */
#ifndef CLT_DAEMON_LETTERS_H
#define CLT_DAEMON_LETTERS_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "base/mailbox.h"
#include "counterlight/counterlight.h"
#include "daemon/model.h"
#include "daemon/reel.h"

typedef struct daemon_boxes {
  clt_mailbox *orders;       /* control -> main: output_order */
  clt_mailbox *drives;       /* control -> main: output_drive */
  reel *reel;                /* moving -> main: reel_picture, several, each by its time; and back, to be filled again */
  clt_mailbox *patterns;     /* measure -> main: output_pattern */
  clt_mailbox *answers;      /* main -> measure: output_answer */
  clt_mailbox *opened;       /* main -> control: output_opened */
  clt_mailbox *frames;       /* main -> control: output_frames */
  clt_mailbox *measure_jobs; /* control -> measure: measure_job */
  clt_mailbox *progress;     /* measure -> control: measure_progress */
  clt_mailbox *measured;     /* measure -> control: measure_result */
  clt_mailbox *solver_jobs;  /* control -> solver: solver_job */
  clt_mailbox *moving_jobs;  /* control -> moving: moving_job */
  clt_mailbox *moved;        /* moving -> control: moving_report */
  clt_mailbox *haste;        /* control -> solver: solver_haste */
  clt_mailbox *solved;       /* solver -> control: solver_result */
  int wake;                  /* eventfd, non-blocking */
} daemon_boxes;

clt_status daemon_boxes_init(daemon_boxes *boxes, clt_error *error);
void daemon_boxes_finish(daemon_boxes *boxes); /* accepts a half-made or zeroed one */
/* Puts a letter for control into one of the boxes and wakes it. */
void daemon_report(const daemon_boxes *boxes, clt_mailbox *box, void *letter);

/* --- main --- */

typedef enum output_order_kind { OUTPUT_OPEN, OUTPUT_STOP } output_order_kind;
typedef struct output_order {
  output_order_kind kind; /* OPEN: the projector, where it is not open yet */
  clt_station_config station;
} output_order;

/* A drive to show from now on: linear light; the panel is a whole multiple of its size, or of one channel. */
typedef struct output_drive {
  clt_image drive;
  clt_panel panel; /* that it is for */
  uint64_t serial; /* of its content */
} output_drive;

/* A picture of panel codes to show at once and until the next pattern; without codes: measuring has ended, the drive
 * comes back. */
typedef struct output_pattern {
  float *codes; /* as clt_projector_driver.present takes them */
} output_pattern;
typedef struct output_answer {
  int64_t shown_ns;
  clt_error error; /* status CLT_OK: it is on the glass */
} output_answer;

/* What became of opening the projector, or (CLT_GONE) that it is no longer there and was closed. */
typedef struct output_opened {
  clt_error error;      /* CLT_OK: open */
  clt_station *station; /* begun; its camera and rig are for measure */
  clt_projector_info projector;
  char projector_name[32];
  clt_panel panel; /* as far as it is known before the rig is */
} output_opened;

typedef struct output_frames {
  uint64_t turns;     /* of the loop: its heartbeat */
  uint64_t presented; /* pictures handed to the projector */
  uint64_t late;      /* turns that took longer than 1.5 refreshes */
  double fps;         /* over the last report's time */
  bool picture;       /* a picture, not only patterns, has been up */
  bool ended;         /* measure, solver and output have ended: the last report */
} output_frames;

/* --- measure --- */

typedef enum measure_kind {
  MEASURE_NOTHING,
  MEASURE_CALIBRATE, /* camera and rig, where they are not open yet */
  MEASURE_ACQUIRE,
  MEASURE_VERIFY,
  MEASURE_REFINE,
  MEASURE_PHOTOMETRY, /* black and gain anew */
  MEASURE_CHANGED,    /* what changed anew, by a few photographs where they explain it */
  MEASURE_GEOMETRY,   /* what each camera pixel sees anew, then as MEASURE_CHANGED */
  MEASURE_STOP
} measure_kind;

/* A drive with what it should look like, on the grid. */
typedef struct daemon_picture {
  clt_image drive;
  clt_image target; /* wanted radiance; empty where the picture is uncompensated */
  clt_image lit;    /* 1 where a cell takes part, else 0 */
  bool compensated;
  bool recalled; /* the drive is that of an earlier run, and nothing else of it is known */
  double white[CLT_CHANNELS_MAX];
  clt_compensation compensation;
} daemon_picture;

typedef struct measure_job {
  measure_kind kind;
  uint64_t number;
  clt_station_config config;    /* CALIBRATE, ACQUIRE */
  clt_station *station;         /* CALIBRATE */
  clt_projector_info projector; /* CALIBRATE */
  daemon_picture picture;       /* VERIFY, REFINE */
  daemon_model *model;          /* VERIFY, REFINE, PHOTOMETRY, CHANGED, GEOMETRY; held; NULL: none in hand */

  char calibration[CLT_PATH_MAX]; /* GEOMETRY: file for the new one */
  char journal[CLT_PATH_MAX];     /* of an acquisition, with which it is resumed */
  char settings[CLT_PATH_MAX];    /* the configuration's file */
  bool anew;                      /* an acquisition goes on with nothing that was measured earlier */
} measure_job;

typedef struct measure_progress {
  uint64_t number;
  char phase[48];
  long done, total, resumed; /* as in clt_progress */
  double seconds, left;
} measure_progress;

/* Frames of the camera since the daemon started, whatever rigs they were taken by. */
typedef struct camera_frames {
  long used;
  long repeated, strange, torn; /* refused and taken again, as clt_rig_info tells them apart */
} camera_frames;

/* What came of refining; errors are ||y - target|| / ||target|| of photographs, noise is theirs. */
typedef struct refinement {
  int photographs; /* 0: not refined */
  double before, after, noise;
} refinement;

/* What came of measuring the geometry again. */
typedef struct geometry_renewal {
  bool measured, adopted; /* not adopted: the earlier one is better, and why says so */
  double covered;         /* share of the panel that is seen */
  double moved;           /* camera pixels, median */
  char why[CLT_MESSAGE_MAX];
} geometry_renewal;

typedef enum renew_outcome { RENEW_NONE, RENEW_FITS, RENEW_GAIN, RENEW_REPAINT, RENEW_MEASURE } renew_outcome;
/* What was found to have changed; before and after: of the photograph that fits worst. */
typedef struct renewal {
  renew_outcome outcome;
  int patterns; /* that it took, those of a whole acquisition included */
  size_t rows;  /* REPAINT: that got a factor of their own, of all channels */
  clt_fit before, after;
  geometry_renewal geometry; /* of MEASURE_GEOMETRY; where it is not adopted, nothing else was looked at */
} renewal;

typedef struct measure_result {
  measure_kind kind;
  uint64_t number;
  clt_error error;
  bool closed;      /* the camera was lost, and must be opened again (CALIBRATE) */
  char camera[32];  /* CALIBRATE: its driver */
  clt_rig_info rig; /* CALIBRATE; its texts are the two below */
  char response[32], source[CLT_TEXT_MAX];
  camera_frames frames;
  clt_transport *transport; /* ACQUIRE, PHOTOMETRY, CHANGED, GEOMETRY; NULL: the one in use fits */
  renewal renewed;          /* PHOTOMETRY, CHANGED, GEOMETRY */
  clt_image observation;    /* VERIFY, REFINE: radiance */
  double verified_error;    /* VERIFY, REFINE: ||y - target|| / ||target|| over lit cells */
  refinement refined;       /* REFINE */
  clt_image drive;          /* REFINE: the better one */
  bool checked;             /* VERIFY: fit is known */
  double brightness;        /* VERIFY, where checked: of the light, of what T predicts */
  clt_fit fit;              /* VERIFY: whether the photograph is what T predicts */
} measure_result;

/* --- solver --- */

typedef enum solver_kind {
  SOLVER_CONTENT,  /* take other content */
  SOLVER_PREPARE,  /* the stored drive where it still fits, else the uncompensated picture */
  SOLVER_LOAD,     /* look for a stored transport */
  SOLVER_ADOPT,    /* certify, solve with and store a new transport */
  SOLVER_SOLVE,    /* compensate the content */
  SOLVER_SNAPSHOT, /* write what is up as pictures */
  SOLVER_COST,     /* measure what accuracy costs; last, and given up when other work comes */
  SOLVER_STOP,
  SOLVER_KINDS
} solver_kind;

typedef struct solver_job {
  solver_kind kind;
  uint64_t number;
  int descriptor;                /* CONTENT: an open picture file; -1: go back to the configured one */
  char name[CLT_PATH_MAX];       /* CONTENT: what people call it */
  char configured[CLT_PATH_MAX]; /* CONTENT: what the configuration names */
  int width, height, channels;   /* PREPARE: the panel; LOAD (0: not known), SOLVE: the grid */
  char source[CLT_TEXT_MAX];     /* LOAD: the rig */
  clt_panel panel;               /* SNAPSHOT */
  char method[24];               /* SOLVE, ADOPT */
  double tolerance, deadline_s;
  clt_white white;
  bool moves;               /* content does */
  clt_transport *transport; /* ADOPT */
  daemon_picture picture;   /* SNAPSHOT */
  clt_image observation;    /* SNAPSHOT; may be empty */
} solver_job;

/* Other work waits: a SOLVER_COST is to be given up. */
typedef struct solver_haste {
  uint64_t number; /* of the job */
} solver_haste;

/* What is known of the transport in use. */
typedef struct transport_facts {
  bool present;
  clt_transport_info info;
  clt_provenance origin;
} transport_facts;

typedef struct solver_result {
  solver_kind kind;
  uint64_t number;
  clt_error error;
  daemon_picture picture;     /* PREPARE, SOLVE, ADOPT */
  transport_facts facts;      /* LOAD, ADOPT, SOLVE */
  char content[CLT_PATH_MAX]; /* CONTENT: its name */
  json_t *tradeoff;           /* COST */
  daemon_model *model;        /* in use, held; NULL: none */
} solver_result;

/* --- moving --- */

/* What is to move from now on. */
typedef struct moving_job {
  bool stop;               /* the daemon ends */
  uint64_t serial;         /* of the content */
  char path[CLT_PATH_MAX]; /* of the film; empty: nothing moves */
  clt_projector_info projector;
  clt_panel panel;
  daemon_model *model;       /* held; NULL: shown uncompensated */
  clt_frames_options frames; /* live.budget_ms: of a frame's solve */
  double picture_s;          /* that each picture of a folder is shown */
} moving_job;

typedef struct moving_report {
  uint64_t serial;                /* of the content */
  uint64_t frames, late, skipped; /* of the film: shown; of these, more than a refresh late; passed over */
  uint64_t slow;                  /* took longer than a refresh */
  uint64_t slipped;               /* since the film began: decoded after they were due */
  uint64_t direct;                /* compensated, with no time for a step (clt_frames_result) */
  double fps;                     /* over the last report's time */
  bool compensated;
  char why[CLT_MESSAGE_MAX]; /* the film stands still; empty where it does not */
  double ms;                 /* that the last frame took */
  clt_frames_result last;    /* of that, where it is compensated */
} moving_report;

/* Deep copy; `to` is overwritten. CLT_FAILED where memory is short (then `to` is empty). */
clt_status daemon_picture_copy(const daemon_picture *from, daemon_picture *to, clt_error *error);
void daemon_picture_finish(daemon_picture *picture); /* accepts an empty one */
clt_status daemon_image_copy(const clt_image *from, clt_image *to, clt_error *error);

/* Frees of letters that hold more than themselves; each accepts NULL. */
void output_drive_free(void *letter);
void output_pattern_free(void *letter);
void moving_job_free(void *letter);
void measure_job_free(void *letter);
void measure_result_free(void *letter);
void solver_job_free(void *letter);
void solver_result_free(void *letter);

#endif
