/* One acquisition under way: what its schemes share. */
#ifndef CLT_ACQUIRE_SESSION_H
#define CLT_ACQUIRE_SESSION_H

#include "acquire/journal.h"
#include "acquire/watch.h"
#include "counterlight/acquire.h"

typedef struct clt_session {
  clt_rig *rig;
  clt_acquire_options options; /* checked, defaults filled in */
  clt_rig_info info;           /* of the rig, before the first pattern */
  size_t cells;
  clt_image drive;                 /* the next pattern; schemes write it */
  double weight;                   /* of its light in the sum that is checked; 0: 1 or -1, whichever leaves a drive */
  clt_image seen, deviation;       /* the last observation */
  clt_image black, black_variance; /* the mean of the repeats and the variance of that mean */
  clt_image landmark, landmark_deviation; /* a random picture as first observed; empty without a journal of a name */
  clt_image flood, flood_variance; /* likewise, the black subtracted; an infinite variance: not seen in any repeat */
  clt_progress progress;
  clt_journal journal;
  clt_watch watch;
  char plan[CLT_TEXT_MAX]; /* the scheme, and why this one */
  int64_t started_ns;
} clt_session;

/* A way to measure T. */
typedef struct clt_scheme {
  const char *name;
  int (*repeats)(size_t cells);                 /* of black and flood where the options leave it open */
  long (*patterns)(const clt_session *session); /* expected number, without black, flood and checks */
  double (*error)(const clt_session *session);  /* expected relative RMS of an appearance */
  bool stops;                                   /* where the seconds allowed are over, with what it has */
  /* Measures a transport with black and flood already in the session; rows sum to the flood; sigma is kept. */
  clt_status (*measure)(clt_session *session, clt_transport **out, clt_error *error);
} clt_scheme;
enum { CLT_REPEATS_DEFAULT = 8, CLT_REPEATS_MAX = 256 };
extern const clt_scheme clt_scheme_brute, clt_scheme_hadamard, clt_scheme_hierarchical, clt_scheme_blocks;

clt_status clt_session_init(clt_session *session, clt_rig *rig, const clt_acquire_options *options, clt_error *error);
/* Makes the watch by the options, and where what is seen is to be kept for it a journal without a name, if there is
 * none with one. */
clt_status clt_session_begin_watch(clt_session *session, bool kept, clt_error *error);
void clt_session_finish(clt_session *session); /* accepts a half-built one */

/* The next pattern is the first of black, flood and the scheme: the place from which to begin again. */
void clt_session_mark_start(clt_session *session);
/* What is there already is to be trusted: the place up to which the journal counts after a disturbance. */
void clt_session_mark_good(clt_session *session);
/* After a failure: *again where the watch wants the same patterns once more, which then come from the journal up to the
 * last good look. Otherwise the failure stands. */
clt_status clt_session_begin_again(clt_session *session, bool *again, clt_error *error);
/* From here on black and flood are what the watch expects. */
void clt_session_watch(clt_session *session);
/* Looks at the sum of the patterns since the last look and at white, if the watch is on and there were any. Where
 * either was not as expected, fails once white is again as it was, or after the patience. */
clt_status clt_session_look(clt_session *session, clt_error *error);
/* The same where a look is due before session->drive; the sum alone where that is `summed` and cannot be added to it.
 */
clt_status clt_session_look_before(clt_session *session, bool summed, clt_error *error);
/* Whether the last observation shows what the first of these repeats (k = 0) did. Where not, all are taken again. */
clt_status clt_session_compare_repeat(clt_session *session, int k, clt_error *error);

/* Where the journal has a name: observes a random picture, by which a resumed acquisition is confirmed. */
clt_status clt_session_take_landmark(clt_session *session, clt_error *error);
/* After black and flood were taken from an inherited journal: whether they and the landmark are what is seen now. Where
 * not, which is tried for the patience, everything is to begin anew. */
clt_status clt_session_confirm(clt_session *session, clt_error *error);

/* Drives every cell of every channel with one value. */
void clt_session_fill(clt_session *session, float value);
/* Shows session->drive and observes it; counts it and reports progress. CLT_CANCELLED where the caller wants no more.
 */
clt_status clt_session_take(clt_session *session, const char *phase, clt_error *error);
/* The same by the rig, whatever the journal holds, which stays as it is. */
clt_status clt_session_take_anew(clt_session *session, const char *phase, clt_error *error);
/* The same as clt_session_take of a pattern that is measured: after a look where one is due, and less what the lamp
 * drifted. */
clt_status clt_session_observe(clt_session *session, const char *phase, clt_error *error);
/* The same of a pattern from which T is not made, which no sum contains. */
clt_status clt_session_test(clt_session *session, const char *phase, clt_error *error);
/* Observes the drive options.repeats times: mean of the valid observations of each value and the variance of that mean
 * (infinite where none was valid; the mean is then the last bound seen). */
clt_status clt_session_average(clt_session *session, const char *phase, clt_image *mean, clt_image *variance,
                               clt_error *error);

/* Makes the random picture of a number, each value 0 or 1, the next pattern. */
void clt_session_draw(clt_session *session, unsigned number);
/* False where another pattern would probably end after the seconds allowed. */
bool clt_session_may_go_on(const clt_session *session);
/* ||b0 + T x - y|| / ||y|| of the last observation y of the drive x, less what its noise adds. */
clt_status clt_session_miss(const clt_session *session, const clt_transport *transport, double *relative,
                            clt_error *error);
/* Observes options.checks random pictures: the same of all together, < 0 where there is none. */
clt_status clt_session_check(clt_session *session, const clt_transport *transport, double *relative, clt_error *error);

#endif
