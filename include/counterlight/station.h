/* A station: the projector, the camera and the rig that a configuration (or a scene alone) names, opened together. */
#ifndef COUNTERLIGHT_STATION_H
#define COUNTERLIGHT_STATION_H

#include <stdbool.h>

#include "counterlight/acquire.h"
#include "counterlight/calibration.h"
#include "counterlight/rig.h"
#include "counterlight/scene.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The part of a configuration file that names devices and how to measure with them. */
typedef struct clt_station_config {
  char scene[CLT_PATH_MAX]; /* scene file for simulated devices, resolved against the configuration's folder; or "" */
  clt_projector_config projector;
  clt_camera_config camera;
  char calibration[CLT_PATH_MAX]; /* calibration file, resolved likewise; or "" */
  char replay[CLT_PATH_MAX];      /* recording that stands for both devices, resolved likewise; or "" */
  char record[CLT_PATH_MAX];      /* folder in which every frame is kept; or "". Not of the file */
  /* What is 0 (sizes, exposure count, timeout, attempts), negative (latency) or not given (the curves) is filled from
   * the calibration, or else from the scene, when the rig is opened. */
  clt_rig_config rig;
  bool projector_response_given, camera_response_given; /* rig.projector, rig.camera come from the file */
  bool verify_given;                                    /* and rig.verify; if not, it is true */
  char scheme[24];             /* of the acquisition: "auto", "brute", "hadamard", "hierarchical", "blocks" */
  clt_acquire_options acquire; /* scheme, progress and context are left to the caller; watch -1 where nothing is said */
} clt_station_config;

/* The settings that fit a scene file alone: simulated devices and the rig that suits them. */
CLT_PUBLIC clt_status clt_station_for_scene(const char *scene_path, clt_station_config *config, clt_error *error);
/* Reads a configuration file (docs/configuration.md); its section "daemon" is left to the daemon. */
CLT_PUBLIC clt_status clt_station_read(const char *path, clt_station_config *config, clt_error *error);

/* True where two configurations that were read name the same devices and settings. */
CLT_PUBLIC bool clt_station_same(const clt_station_config *a, const clt_station_config *b);

typedef struct clt_station {
  clt_scene *scene;             /* NULL where the devices are real */
  clt_calibration *calibration; /* NULL where there is none; one that the caller puts here becomes the station's */
  clt_projector *projector;
  clt_camera *camera;
  clt_rig *rig;                      /* NULL until clt_station_open_rig */
  clt_projector *recorded_projector; /* the devices themselves where projector and camera record them */
  clt_camera *recorded_camera;
} clt_station;

/* Opens the devices that config names, and loads its calibration. Of config.replay the frames are served and no device
 * is opened; a scene then gives no more than the rig's settings. */
CLT_PUBLIC clt_status clt_station_open(const clt_station_config *config, clt_station *station, clt_error *error);

/* The same one by one, for who must outlive a device that goes: first the scene and the calibration, then each device
 * that is not open (one that is stays). A recording's two open together, with the projector (CLT_GONE for its camera
 * where that was closed), and config.record is not regarded. Once it is begun, the projector and the camera with its
 * rig may be opened, used and closed by two threads, each by one. */
CLT_PUBLIC clt_status clt_station_begin(const clt_station_config *config, clt_station *station, clt_error *error);
CLT_PUBLIC clt_status clt_station_open_projector(const clt_station_config *config, clt_station *station,
                                                 clt_error *error);
CLT_PUBLIC clt_status clt_station_open_camera(const clt_station_config *config, clt_station *station, clt_error *error);
/* Closes the projector; a rig on it must be closed before. */
CLT_PUBLIC void clt_station_close_projector(clt_station *station);
/* Closes the rig and the camera. */
CLT_PUBLIC void clt_station_close_camera(clt_station *station);

/* The rig's settings: what the file says, where it says nothing the station's calibration, then the scene. */
CLT_PUBLIC clt_rig_config clt_station_rig_config(const clt_station_config *config, const clt_station *station);
/* Makes the rig on the station's camera and on `projector`, NULL meaning the station's own (a daemon that presents from
 * its own thread hands in a stand-in, which must outlive the rig). */
CLT_PUBLIC clt_status clt_station_open_rig(const clt_station_config *config, clt_station *station,
                                           clt_projector *projector, clt_error *error);
/* Closes rig, devices, scene and calibration in that order; accepts a zeroed station and NULL. */
CLT_PUBLIC void clt_station_close(clt_station *station);

#ifdef __cplusplus
}
#endif
#endif
