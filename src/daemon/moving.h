/* The moving thread: turns the frames of a film into moving pictures for the output, each within its budget. */
#ifndef CLT_DAEMON_MOVING_H
#define CLT_DAEMON_MOVING_H

#include "daemon/letters.h"

/* The thread: works on moving_jobs until one says stop. boxes: a daemon_boxes. */
void *moving_run(void *boxes);

#endif
