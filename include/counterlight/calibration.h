/* Calibration: what a rig must know of its projector and its camera, measured on the devices as they stand.
 *
 * Timing first (how long light takes from a refresh to the surface), then photometry (responses, crosstalk, black,
 * noise, exposures), then geometry (which panel coordinate each camera pixel sees). Nothing of the scene is assumed but
 * that the camera sees what the projector lights. docs/calibration.md says how each is measured. */
#ifndef COUNTERLIGHT_CALIBRATION_H
#define COUNTERLIGHT_CALIBRATION_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/device.h"
#include "counterlight/panel.h"
#include "counterlight/rig.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_calibration clt_calibration;

typedef struct clt_calibrate_options {
  int levels;       /* of the projector's ramps, 17..65; 0 means 33 */
  int frames;       /* averaged for each field, 1..64; 0 means 6 */
  double watch_s;   /* for which the camera is watched for automatic controls; 0 means 20, negative not at all */
  double timeout_s; /* for one frame; 0 means 2 */
  int attempts;     /* per frame; 0 means 3 */
  unsigned seed;    /* of the flashes that tell the latency */
  /* Called before "latency", "photometry" and "structured light" (done and total 0) and after each of their flashes,
   * uniform fields and pictures; total is an estimate that may change. False stops (CLT_CANCELLED).
   * May be NULL. */
  bool (*progress)(void *context, const char *phase, int done, int total);
  void *context;
} clt_calibrate_options;

/* What was measured. A device's own units: radiance is that of a camera of responsivity 1 where its driver knows none.
 */
typedef struct clt_calibration_info {
  int panel_width, panel_height, camera_width, camera_height, channels; /* pixels */
  clt_panel panel;                                                      /* responses and crosstalk */
  clt_curve camera;                                                     /* sample over full scale to light */
  double black[CLT_PANEL_CHANNELS]; /* light of the dark panel, ambient included, over that of the white one */
  double black_level;               /* code values */
  double full_well, read_noise;     /* electrons */
  double exposures_s[8];            /* chosen from what is seen */
  int exposure_count;
  double latency_s, jitter_s; /* from a refresh's start until its light, and its standard deviation */
  double complete_s;          /* after which every picture was complete, margin included: clt_rig_config.latency_s */
  double pitch;               /* panel pixels from one camera pixel to the next */
  long decoded;               /* camera pixels whose panel coordinate is known */
  double covered;             /* share of the panel's pixels that they see */
  /* The camera's lens, from photographs of a chessboard: fx fy cx cy, pixels, then Brown's k1 k2 p1 p2 k3, as OpenCV
   * defines them, and the rms distance of corners from where the lens puts them, pixels. fx 0: not measured. */
  double lens[9], lens_reprojection;
  int64_t calibrated;               /* seconds since 1970-01-01 UTC */
  char source[CLT_MESSAGE_MAX / 4]; /* the devices, in words */
} clt_calibration_info;

/* Measures all on devices that are open. Takes some minutes at 30 frames a second. CLT_FAILED where something cannot be
 * measured: the message says what and what to do; else as the devices fail. source: the devices in words. */
CLT_PUBLIC clt_status clt_calibrate(clt_projector *projector, clt_camera *camera, const clt_calibrate_options *options,
                                    const char *source, clt_calibration **out, clt_error *error);
CLT_PUBLIC void clt_calibration_destroy(clt_calibration *calibration); /* accepts NULL */

/* Measures the geometry alone again, on devices whose latency, responses and noise are still those of `known` (a camera
 * that was knocked, not another one): *out is `known` with the new map, pitch, coverage, date and findings. Takes the
 * Gray code's pictures and a few to find the exposure. CLT_BAD_INPUT where the devices have other sizes than `known`;
 * CLT_FAILED, `known` being better, where no pixel is decoded, exposure or gain move by themselves, or less than half
 * as much of the panel is seen as in `known`. Of options, levels, frames and watch_s are not used. */
CLT_PUBLIC clt_status clt_calibrate_geometry(const clt_calibration *known, clt_projector *projector, clt_camera *camera,
                                             const clt_calibrate_options *options, clt_calibration **out,
                                             clt_error *error);
/* How far what the camera sees has moved from one calibration to another of the same sizes: median over pixels decoded
 * in both, camera pixels (panel distance over the first one's pitch); infinite where no pixel is. */
CLT_PUBLIC clt_status clt_calibration_moved(const clt_calibration *before, const clt_calibration *after, double *pixels,
                                            clt_error *error);
CLT_PUBLIC clt_calibration_info clt_calibration_describe(const clt_calibration *calibration);

/* What is wrong and what to do about it, in one line: index 0.. until NULL. *serious: what is measured with this rig is
 * wrong until it is put right. */
CLT_PUBLIC const char *clt_calibration_finding(const clt_calibration *calibration, int index, bool *serious);

/* The calibration file (docs/calibration.md), HDF5, replaced whole. CLT_BAD_INPUT, naming file and field, for what is
 * missing, damaged or out of range. */
CLT_PUBLIC clt_status clt_calibration_save(const clt_calibration *calibration, const char *path, clt_error *error);
CLT_PUBLIC clt_status clt_calibration_load(const char *path, clt_calibration **out, clt_error *error);
/* When the calibration in a file was made (clt_calibration_info.calibrated), without reading the rest. */
CLT_PUBLIC clt_status clt_calibration_date(const char *path, int64_t *calibrated, clt_error *error);

/* Puts responses, noise, exposures and latency into a rig's settings, and the calibration itself as its geometry: it
 * must outlive rigs that are opened with them. */
CLT_PUBLIC void clt_calibration_apply(const clt_calibration *calibration, clt_rig_config *config);

#ifdef __cplusplus
}
#endif
#endif
