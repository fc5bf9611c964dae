/* The measuring thread: calibrates, acquires and verifies through the rig. */
#ifndef CLT_DAEMON_MEASURE_H
#define CLT_DAEMON_MEASURE_H

#include "daemon/letters.h"

/* Works on jobs until one of kind MEASURE_STOP comes. boxes: a const daemon_boxes, which must outlive the thread. */
void *measure_run(void *boxes);

/* ||seen - target|| / ||target|| over the cells where lit is not 0 and the deviation is finite; all of one size. */
double measure_error(const clt_image *seen, const clt_image *deviation, const clt_image *target, const clt_image *lit);

#endif
