/* The main thread: owns the projector and keeps a picture up. */
#ifndef CLT_DAEMON_OUTPUT_H
#define CLT_DAEMON_OUTPUT_H

#include "daemon/letters.h"

typedef struct output output;

clt_status output_create(const daemon_boxes *boxes, output **out, clt_error *error);
/* Opens the projector and presents until the order to stop comes: the pending pattern where there is one, else the
 * latest drive. Every turn lasts one refresh, or less where a pattern comes. */
void output_run(output *main);
void output_destroy(output *main); /* closes the station: after measure has ended; accepts NULL */

/* Panel codes of a drive: codes[(c * height + y) * width + x] = code of the drive's cell over that pixel; one channel
 * lights all of the panel's. codes has channels * height * width of the panel. */
void output_encode(const output_drive *picture, const clt_projector_info *panel, float *codes);

#endif
