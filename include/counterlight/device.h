/* Projectors and cameras: one table of functions each, behind which real, simulated and replayed devices look alike.
 *
 * Times are nanoseconds of the devices' common clock (CLOCK_MONOTONIC for hardware, simulated time for the simulated
 * pair); only differences and comparisons mean something. Drivers are called from one thread at a time, but a projector
 * and the camera of a pair may be called from two threads. */
#ifndef COUNTERLIGHT_DEVICE_H
#define COUNTERLIGHT_DEVICE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "counterlight/panel.h"
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
  double step;         /* code values by half of which rounding moves a sample at most: more than 1 where samples are
                        * computed of fewer bits (Y'CbCr, filter mosaics); 0: 1 */
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

/* Which camera, and what to set and lock on it: the section "camera" of a configuration. Drivers take what concerns
 * them; what is 0 (or negative, where 0 means something) is left as the camera has it, but locked all the same. */
typedef struct clt_camera_config {
  char driver[32];
  char device[CLT_PATH_MAX]; /* "auto", a node, a name below /dev/v4l/by-id, "usb:VENDOR:PRODUCT[:SERIAL]"
                              * (hexadecimal), "port:BUS-PORT[.PORT...]", a libcamera identifier */
  char format[8];            /* four characters ("YUYV", "MJPG", "GREY", ...); "auto": the one of the most bits */
  int width, height;         /* pixels */
  double rate_hz;            /* frames a second */
  double gain;               /* of the driver's unit; < 0: as it is */
  double white_balance_k;    /* kelvin */
  double focus;              /* of the driver's unit; < 0: as it is */
  int power_line_hz;         /* 0 off, 50, 60; < 0: as it is */
} clt_camera_config;

/* Which projector: the section "projector" of a configuration, as for the camera. */
typedef struct clt_projector_config {
  char driver[32];
  char monitor[128]; /* "auto": not the primary one; a name, a part of its model, or "X,Y" of its corner */
  int width, height; /* of the mode (or the window), pixels; 0: as it is */
  double refresh_hz; /* 0: as it is */
  bool window;       /* a window on the desk, not the whole screen */
} clt_projector_config;

/* A moving picture at the panel's own resolution, corrected on the grid: the drive of panel pixel p and channel c is
 * gain_c(p) * linear(content_c(p)) + offset_c(p), clipped to 0..1, gain and offset interpolated bilinearly between the
 * centres of the cells. The panel's responses and crosstalk then give the codes, which are dithered to the glass. */
typedef struct clt_live_picture {
  int width, height;      /* of content, pixels: stretched over the whole panel; content_c(p) is its mean there, in
                           * linear light (where it has as many pixels as the panel, its pixel) */
  const uint8_t *content; /* content[(y * width + x) * 3 + c], sRGB codes */
  int grid_width, grid_height;
  const float *gain, *offset; /* [(c * grid_height + y) * grid_width + x], three channels */
  clt_panel panel;
  uint32_t seed; /* of the dither; another for every frame */
} clt_live_picture;

/* Codes of a moving picture for a panel that cannot encode it by itself, not dithered: codes[(c * height + y) * width +
 * x], 0..1, of `channels` (1 or 3) x height x width; a panel of one channel shows the content's luminance by the first
 * gain and offset. Within 1e-4 of the formula above where responses are as clt_curve knows them. */
CLT_PUBLIC clt_status clt_live_encode(const clt_live_picture *picture, int channels, int height, int width,
                                      float *codes, clt_error *error);
/* Brings codes to steps of 1 / (2^bits - 1), up or down by chance so that their mean stays: floor(code * full + u) /
 * full, u uniform in 0..1, a function of seed and place. */
CLT_PUBLIC void clt_live_dither(float *codes, size_t count, int bits, uint32_t seed);

/* What a projector is. The panel shows code values; light = response(code). */
typedef struct clt_projector_info {
  int width, height, channels; /* panel size in pixels; channels 1 or 3 */
  int bits;                    /* of a code value */
  double refresh_s;            /* s from refresh to refresh */
  bool waits;                  /* present() waits for refreshes, so that calls in a row come one refresh apart; else it
                                  returns when it has the picture */
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
  /* The same for a moving picture, which the projector encodes by itself; NULL where it cannot. */
  clt_status (*present_live)(clt_projector *projector, const clt_live_picture *picture, int64_t *shown_ns,
                             clt_error *error);
} clt_projector_driver;
struct clt_projector {
  const clt_projector_driver *driver;
};

#ifdef __cplusplus
}
#endif
#endif
