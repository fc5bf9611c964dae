/* When the simulated camera's frames start and how long they are exposed. Times in ns of the scene's clock. */
#ifndef CLT_SIM_SHUTTER_H
#define CLT_SIM_SHUTTER_H

#include <stdint.h>

#include "sim/description.h"

/* The next frame to come, and the changes of exposure that later frames bring. A value: copies may run ahead. */
typedef struct clt_shutter {
  int64_t start_ns, frame_ns; /* of the next frame; least time from frame to frame */
  uint32_t sequence;          /* of the next frame */
  double exposure_s;          /* of the next frame */
  int delay;                  /* frames from a request until it holds */
  int pending;
  struct {
    uint32_t sequence; /* of the first frame that has it */
    double exposure_s;
  } change[CLT_EXPOSURE_DELAY_MAX + 4];
} clt_shutter;

int64_t clt_shutter_exposure_ns(const clt_shutter *shutter);

/* Runs on to the first frame that starts at or after not_before_ns and ends at or after now_ns: frames that ended
 * before are lost, for the camera keeps no queue. */
void clt_shutter_advance(clt_shutter *shutter, int64_t not_before_ns, int64_t now_ns);
/* Runs on by one frame. */
void clt_shutter_step(clt_shutter *shutter);
/* Asks at time now_ns for an exposure time: it holds `delay` frames after the first frame that starts at or after now.
 */
void clt_shutter_request(clt_shutter *shutter, double exposure_s, int64_t now_ns);

#endif
