/* Acquisitions that were interrupted, by a camera that went or by the end of the daemon, and go on. */
#ifndef CLT_DAEMON_RESUME_H
#define CLT_DAEMON_RESUME_H

#include "daemon/letters.h"

/* Since its last pattern; what is older begins anew. */
enum { RESUME_AGE_S = 3600 };

/* Before a job: where its acquisition is to be measured anew the journal goes. */
void resume_begin(const measure_job *job);
/* After an acquisition: one that failed otherwise than by its devices or by being cancelled would fail again by its
 * journal, which goes. That of a whole one stays until the transport is adopted. */
void resume_settle(const measure_job *job, clt_status status);
/* What an acquisition belongs to beside its rig: its scheme, and the files of configuration, scene and calibration by
 * their times and sizes. */
void resume_describe(const measure_job *job, const clt_station *station, char *text, size_t size);

#endif
