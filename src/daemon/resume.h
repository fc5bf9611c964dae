/* Acquisitions that were interrupted, by a camera that went or by the end of the daemon, and go on. */
#ifndef CLT_DAEMON_RESUME_H
#define CLT_DAEMON_RESUME_H

#include "daemon/letters.h"

/* Since its last pattern, and starts of the daemon that go on with it; what is older, or outlived more of them, begins
 * anew. */
enum { RESUME_AGE_S = 3600, RESUME_STARTS = 3 };

/* At the start: whether an acquisition of an earlier run is to go on although there is a transport that serves. */
bool resume_is_owed(const char *journal);
/* Before a job: where its acquisition is to be measured anew the journal goes; where it goes on with an earlier run's
 * (*first, which an acquisition sets to false) that is counted, across the ends of the daemon. */
void resume_begin(const measure_job *job, bool *first);
/* A journal that served its purpose, with the count. */
void resume_drop(const char *journal);
/* After an acquisition: one that failed otherwise than by its devices or by being cancelled would fail again by its
 * journal, which goes. That of a whole one stays until the transport is adopted. */
void resume_settle(const measure_job *job, clt_status status);
/* What an acquisition belongs to beside its rig: its scheme, and the files of configuration, scene and calibration by
 * their times and sizes. */
void resume_describe(const measure_job *job, const clt_station *station, char *text, size_t size);

#endif
