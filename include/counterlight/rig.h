/* The rig: the narrow waist of the program. observe(drive) -> linear radiance on the projector's grid, with its
 * standard deviation. Nothing above it knows what a camera is; nothing below it knows what a transport matrix is. */
#ifndef COUNTERLIGHT_RIG_H
#define COUNTERLIGHT_RIG_H

#include "counterlight/device.h"
#include "counterlight/image.h"
#include "counterlight/panel.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_rig clt_rig;

typedef struct clt_rig_info {
  int width, height, channels; /* the grid: drive cells and observed cells */
  const char *response;        /* the projector's response curve as clt_curve_parse reads it */
  const char *source;          /* what is observed, in words: the scene or the devices */
  long patterns, frames;       /* shown and used since the rig was opened */
  long doubted;                /* patterns whose exposures contradicted each other at first */
  /* Frames that were refused and taken again: they repeated the one before, were of another picture, or contradicted
   * the other exposures of theirs. */
  long repeated, strange, torn;
  double seconds; /* on the devices' clock, when the last frame began */
  /* What clt_panel_shown needs to tell the light of a drive; NULL: drives are shown as they are. The rig's. */
  const clt_panel *panel;
  int panel_bits;
  double rounding; /* radiance by which dark values are off together, observation after observation, as a standard
                      deviation: steps of the camera that its noise does not dither; 0: it does */
} clt_rig_info;

typedef struct clt_rig_operations {
  void (*describe)(const clt_rig *rig, clt_rig_info *info);
  /* Projects drive (linear light, 0..1, the grid's size and channels) and gives the linear radiance of every observed
   * cell, black included, as means over footprints, and its standard deviation. Both images were initialised by the
   * caller to the grid's size. Values may be slightly negative (noise is not clipped). A cell without one valid sample
   * (saturated in every exposure, not seen, or contradicted by other exposures at every attempt) has an infinite
   * deviation. Blocks; tries again by itself as configured; CLT_TIMEOUT, CLT_GONE or CLT_FAILED when that did not help:
   * where frames are proven to be of another picture, CLT_TIMEOUT with their numbers. */
  clt_status (*observe)(clt_rig *rig, const clt_image *drive, clt_image *radiance, clt_image *deviation,
                        clt_error *error);
  void (*close)(clt_rig *rig); /* frees the rig, not its devices; accepts NULL */
} clt_rig_operations;
struct clt_rig {
  const clt_rig_operations *operations;
};

/* A corner of the grid that shows the number of the picture instead of the drive, as proof of what a frame shows: 4 x 4
 * blocks of side x side cells, half of them always bright. Its cells take no drive, and their radiance has an infinite
 * deviation. side 0: none. */
typedef struct clt_patch {
  int left, top, side; /* cells */
} clt_patch;

/* How a projector and a camera make a rig. */
typedef struct clt_rig_config {
  int width, height;   /* the grid; the panel is a whole multiple of it in each direction */
  clt_panel projector; /* from light to the panel's codes */
  clt_curve camera;    /* response of the camera, sample over full scale to light */
  /* The sensor as it was calibrated, as in clt_camera_info; full_well 0: as its driver describes it. */
  double black_level, full_well, read_noise;
  double exposures_s[8]; /* ascending, each within the camera's range */
  int exposure_count;    /* 1..8 */
  double latency_s;      /* from a refresh's start until its light is complete on the surface, margin included */
  double timeout_s;      /* for one frame */
  int attempts;          /* per frame, >= 1 */
  bool verify;           /* exposures of one picture that contradict each other are taken again */
  clt_patch patch;
  /* Which camera pixels see which cell; not owned, outlives the rig. NULL: the camera sees the grid magnified by a
   * whole factor. */
  const struct clt_calibration *calibration;
  char source[CLT_MESSAGE_MAX / 4];
} clt_rig_config;

/* A rig on an opened projector and camera, which must outlive it. Without a calibration the camera sees the grid
 * magnified by a whole factor (k x k camera pixels a cell). CLT_BAD_INPUT where sizes or exposures do not fit; the
 * message says how. */
CLT_PUBLIC clt_status clt_rig_open(const clt_rig_config *config, clt_projector *projector, clt_camera *camera,
                                   clt_rig **out, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
