/* Controls of a Video4Linux camera: what it does by itself is switched off, what makes the picture is set, read back,
 * kept, and set again after the camera was away. */
#ifndef CLT_DEVICE_CAMERA_V4L2_CONTROLS_H
#define CLT_DEVICE_CAMERA_V4L2_CONTROLS_H

#include "counterlight/device.h"
#include "device/camera/v4l2_node.h"

enum { CLT_V4L2_LOCKS_MAX = 48 };

/* A control and the value that it is to have. */
typedef struct clt_v4l2_lock {
  uint32_t id;
  char name[32];
  int64_t value;
  bool held; /* the camera read back that value */
} clt_v4l2_lock;

typedef struct clt_v4l2_locks {
  int count;
  clt_v4l2_lock lock[CLT_V4L2_LOCKS_MAX];
  bool timed; /* the camera takes an exposure time */
  int64_t exposure_asked;
  double exposure_min_s, exposure_max_s, exposure_s;
} clt_v4l2_locks;

/* Switches off what is automatic, sets what the configuration names, takes the rest as the camera has it, and keeps
 * all of that in locks. What it could not hold is said in the log, and left with held = false. CLT_BAD_INPUT where the
 * camera does not take a value that the configuration names; CLT_GONE, CLT_TIMEOUT. */
clt_status clt_v4l2_lock_all(const clt_v4l2_node *node, const clt_camera_config *config, clt_v4l2_locks *locks,
                             clt_error *error);
/* Sets all of it again, as after a reset; CLT_TIMEOUT where the camera does not hold now what it held before. */
clt_status clt_v4l2_lock_again(const clt_v4l2_node *node, clt_v4l2_locks *locks, clt_error *error);
/* Whether that exposure time, s, is the one that was asked for last. */
bool clt_v4l2_exposure_is(const clt_v4l2_locks *locks, double seconds);
/* Has it set by the next clt_v4l2_lock_again. */
void clt_v4l2_expose_later(double seconds, clt_v4l2_locks *locks);
/* Sets it, and keeps what the camera read back (whole 100 us). */
clt_status clt_v4l2_expose(const clt_v4l2_node *node, double seconds, clt_v4l2_locks *locks, clt_error *error);

/* Whether the camera changes its pictures by itself through this control, and the value that ends that. */
bool clt_v4l2_automatic(uint32_t id, int64_t *off);

#endif
