/* A station: the projector, the camera and the rig that a configuration (or a scene alone) names, opened together. */
#ifndef COUNTERLIGHT_STATION_H
#define COUNTERLIGHT_STATION_H

#include <stdbool.h>

#include "counterlight/acquire.h"
#include "counterlight/rig.h"
#include "counterlight/scene.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The part of a configuration file that names devices and how to measure with them. */
typedef struct clt_station_config {
  char scene[CLT_PATH_MAX]; /* scene file for simulated devices, resolved against the configuration's folder; or "" */
  char projector[32];       /* driver names: "simulated" */
  char camera[32];
  /* What is 0 (sizes, exposure count, timeout, attempts), negative (latency) or not given (the curves) is filled from
   * the scene when the rig is opened. */
  clt_rig_config rig;
  bool projector_response_given, camera_response_given; /* rig.projector, rig.camera come from the file */
  char scheme[24];                                      /* of the acquisition: "auto", "brute", "hadamard", "hierarchical", "blocks" */
  clt_acquire_options acquire;                          /* scheme, progress and context are left to the caller */
} clt_station_config;

/* The settings that fit a scene file alone: simulated devices and the rig that suits them. */
CLT_PUBLIC clt_status clt_station_for_scene(const char *scene_path, clt_station_config *config, clt_error *error);
/* Reads a configuration file (docs/configuration.md); its section "daemon" is left to the daemon. */
CLT_PUBLIC clt_status clt_station_read(const char *path, clt_station_config *config, clt_error *error);

typedef struct clt_station {
  clt_scene *scene; /* NULL where the devices are real */
  clt_projector *projector;
  clt_camera *camera;
  clt_rig *rig; /* NULL until clt_station_open_rig */
} clt_station;

/* Opens the devices that config names. */
CLT_PUBLIC clt_status clt_station_open(const clt_station_config *config, clt_station *station, clt_error *error);
/* Makes the rig on the station's camera and on `projector`, NULL meaning the station's own (a daemon that presents from
 * its own thread hands in a stand-in, which must outlive the rig). */
CLT_PUBLIC clt_status clt_station_open_rig(const clt_station_config *config, clt_station *station,
                                           clt_projector *projector, clt_error *error);
/* Closes rig, devices and scene in that order; accepts a zeroed station and NULL. */
CLT_PUBLIC void clt_station_close(clt_station *station);

#ifdef __cplusplus
}
#endif
#endif
