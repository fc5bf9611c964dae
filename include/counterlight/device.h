/* Projectors and cameras: one table of functions each, behind which real, simulated and replayed devices look alike.
 *
 * Times are nanoseconds of the devices' common clock (CLOCK_MONOTONIC for hardware, simulated time for the simulated
 * pair); only differences and comparisons mean something. Drivers are called from one thread at a time, but a projector
 * and the camera of a pair may be called from two threads. */
#ifndef COUNTERLIGHT_DEVICE_H
#define COUNTERLIGHT_DEVICE_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One camera frame. The camera owns samples; they stay valid until its next call. */
typedef struct clt_frame {
  int width, height, channels; /* channels 1 or 3 (R, G, B) */
  int bits;                    /* full scale is (1 << bits) - 1 */
  const uint16_t *samples;     /* samples[(y * width + x) * channels + c], row 0 at the top */
  int64_t exposed_ns;          /* start of exposure, at the frame's first row */
  double exposure_s;           /* the exposure time that this frame really had */
  uint32_t sequence;           /* counts frames, gaps included */
} clt_frame;

/* What a camera is, as far as its driver or the configuration knows. A sample of a pixel that sees radiance L for t
 * seconds is black_level + encode(responsivity * L * t) * (full scale - black_level), plus noise. */
typedef struct clt_camera_info {
  int width, height, channels, bits;
  double frame_s; /* time from frame to frame, s */
  double exposure_min_s, exposure_max_s;
  double black_level;  /* sample value without light, in code values */
  double responsivity; /* 1 / (radiance * s): fraction of full scale; 1 where not known */
  double full_well;    /* electrons at full scale, > 0: photon noise has variance signal * full_well */
  double read_noise;   /* electrons, rms */
  bool own_pixels;     /* which pixel sees which part of the picture must be measured: no grid is promised */
} clt_camera_info;

typedef struct clt_camera clt_camera;
typedef struct clt_camera_driver {
  const char *name; /* as in the configuration: "simulated", "v4l2", ... */
  void (*describe)(const clt_camera *camera, clt_camera_info *info);
  /* Asks for an exposure time, s. Frames already under way keep theirs: clt_frame.exposure_s tells when it holds. */
  clt_status (*set_exposure)(clt_camera *camera, double seconds, clt_error *error);
  /* Waits for the first frame whose exposure starts at or after not_before_ns, dropping earlier ones. CLT_TIMEOUT when
   * none came within timeout_s (of the devices' clock), CLT_GONE when the camera is no longer there. */
  clt_status (*next)(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame, clt_error *error);
  void (*close)(clt_camera *camera); /* frees the camera; accepts NULL */
} clt_camera_driver;
/* A driver's own camera starts with this member. */
struct clt_camera {
  const clt_camera_driver *driver;
};

/* What a projector is. The panel shows code values; light = response(code). */
typedef struct clt_projector_info {
  int width, height, channels; /* panel size in pixels; channels 1 or 3 */
  int bits;                    /* of a code value */
  double refresh_s;            /* s from refresh to refresh */
} clt_projector_info;

typedef struct clt_projector clt_projector;
typedef struct clt_projector_driver {
  const char *name;
  void (*describe)(const clt_projector *projector, clt_projector_info *info);
  /* Puts a picture of panel code values 0..1 on the glass at the next refresh: codes[(c * height + y) * width + x],
   * copied before the call returns. *shown_ns: when the refresh that first shows it starts. The light may follow later
   * (the projector's latency). */
  clt_status (*present)(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error);
  void (*close)(clt_projector *projector); /* frees the projector; accepts NULL */
} clt_projector_driver;
struct clt_projector {
  const clt_projector_driver *driver;
};

#ifdef __cplusplus
}
#endif
#endif
