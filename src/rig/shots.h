/* Raw frames of panel pictures: what is below observe(), and what calibration looks at.
 *
 * Frames are paired with pictures by time stamps alone: the first frame whose exposure began after the picture's light
 * was complete, and that had the exposure time asked for. */
#ifndef CLT_RIG_SHOTS_H
#define CLT_RIG_SHOTS_H

#include <stdbool.h>

#include "counterlight/device.h"

typedef struct clt_shots {
  clt_projector *projector;
  clt_camera *camera; /* neither owned */
  clt_projector_info panel;
  clt_camera_info sensor;
  double latency_s; /* from a refresh's start until its light is complete, margin included */
  double timeout_s; /* for one frame */
  int attempts;     /* per frame, >= 1 */
  long shown;       /* pictures */
  long frames;      /* that were used */
  long retaken;     /* frames that were refused and asked for again */
  long stuck;       /* of these, frames that repeated the samples of the one before */
  bool noisy;       /* the sensor's noise makes two equal frames impossible, so that a frame which repeats is refused */
  int64_t last_ns;  /* start of the last frame that was used, on the devices' clock */
  uint64_t digest;  /* of the samples of the frame before; 0: there was none */
} clt_shots;

/* Describes the devices. noisy is set from the camera's read noise: at least a fifth of a code value. */
void clt_shots_init(clt_shots *shots, clt_projector *projector, clt_camera *camera, double latency_s, double timeout_s,
                    int attempts);

/* Takes what calibration found of the sensor in place of what its driver says. */
void clt_shots_calibrate(clt_shots *shots, double black_level, double full_well, double read_noise);

/* Puts codes [(c * height + y) * width + x], 0..1, on the panel. *complete_ns: exposures that start from then on see
 * only this picture. */
clt_status clt_shots_show(clt_shots *shots, const float *codes, int64_t *complete_ns, clt_error *error);

/* The first frame that starts at or after not_before_ns, had this exposure time and repeats no other; retried as
 * configured. The camera owns the samples until its next call. CLT_TIMEOUT where none came in all attempts, CLT_GONE as
 * the driver says, CLT_FAILED where the frames are not what the camera announced. */
clt_status clt_shots_take(clt_shots *shots, int64_t not_before_ns, double exposure_s, clt_frame *frame,
                          clt_error *error);

/* A number of a frame's samples, by which one that repeats another is known; 0 where nearly all samples are at the ends
 * of the scale and tell nothing. */
uint64_t clt_shots_digest(const clt_frame *frame);

#endif
