/* A scene made ready, and the simulated time that its projector and camera share. */
#ifndef CLT_SIM_STATE_H
#define CLT_SIM_STATE_H

#include <pthread.h>

#include "counterlight/scene.h"
#include "sim/description.h"
#include "sim/effects/plan.h"
#include "sim/light.h"
#include "sim/timeline.h"
#include "sim/view.h"

struct clt_scene {
  clt_scene_description description;
  clt_transport *transport; /* T and b0 */
  double light_ms;          /* that computing or reading T took */
  clt_light_facts light;    /* of a scene of surfaces */
  double *flood;            /* channels * cells values: T 1 */
  double *added;            /* channels * cells values: what the effects add to the transport's own black */
  double full_drive[CLT_SIM_CHANNELS_MAX]; /* most drive of a channel that reaches the surfaces */
  float *drive_of_code;                    /* of the panel, 1 << bits values */
  int64_t latency_ns;                      /* from a refresh until its light is on the surface */
  int64_t jitter_ns;                       /* by which that varies to either side */
  int exposure_delay;                      /* frames from a request until it holds */
  int64_t line_ns;                         /* from the exposure of a row of pixels to that of the next */
  clt_plan plan;
  clt_view view;       /* of a camera with pixels of its own */
  double view_ms;      /* that tracing it took */
  double brightest;    /* radiance of the brightest cell under full drive */
  double responsivity; /* of the camera, described or chosen */
  /* Below: under lock, for the projector and the camera may be called from two threads. */
  pthread_mutex_t lock;
  clt_timeline timeline;
  uint64_t presented; /* pictures */
  int64_t lit_ns;     /* when the last one's light is there */
  int64_t now_ns;
  bool projector_open, camera_open;
};

/* Exposure times of the simulated camera, s. */
#define CLT_EXPOSURE_MIN_S 1e-5
#define CLT_EXPOSURE_MAX_S 4.0

#endif
