/* The connection to one camera: opened, lost, and found again. */
#ifndef CLT_DEVICE_CAMERA_V4L2_LINK_H
#define CLT_DEVICE_CAMERA_V4L2_LINK_H

#include "device/camera/v4l2_controls.h"
#include "device/camera/v4l2_find.h"
#include "device/camera/v4l2_format.h"
#include "device/camera/v4l2_stream.h"

typedef struct clt_v4l2_link {
  clt_camera_config config; /* what was "as it is" is what it then was */
  clt_v4l2_node node;
  clt_v4l2_identity identity;
  clt_usb_id port; /* where it is plugged in now */
  clt_v4l2_mode mode;
  clt_v4l2_locks locks;
  clt_v4l2_stream stream;
  int64_t life_ns; /* when it last gave a sign of life, or was given a remedy */
  int remedies;    /* without a good picture since */
  int good;        /* pictures since the last remedy */
  clt_usb_backoff backoff;
} clt_v4l2_link;

clt_status clt_v4l2_link_open(const clt_camera_config *config, clt_v4l2_link *link, clt_error *error);
/* Stops and closes; the link can be opened again. Accepts a closed one. */
void clt_v4l2_link_close(clt_v4l2_link *link);
/* Waits until the camera is there and set as before; CLT_GONE, with what hinders, where it is not by limit_ns. A camera
 * that is there but does not answer is reset. */
clt_status clt_v4l2_link_restore(clt_v4l2_link *link, int64_t limit_ns, clt_error *error);

/* When a camera that sends nothing is stalled, ns of clt_clock_ns. */
int64_t clt_v4l2_link_patience(const clt_v4l2_link *link);
/* Notes a good picture. */
void clt_v4l2_link_good(clt_v4l2_link *link);
/* Treats a camera that is gone or stalled, as problem says; true where its stream was started anew, or it has to be
 * waited for (the node is closed then), false where the next remedy is not due yet. */
bool clt_v4l2_link_treat(clt_v4l2_link *link, const clt_error *problem);

#endif
