/* Cameras of libcamera (0.0.3 of Debian 12, to 0.7; docs/libcamera.md). There only where the feature libcamera is built
 * (CLT_HAVE_LIBCAMERA). */
#ifndef CLT_DEVICE_CAMERA_LIBCAMERA_H
#define CLT_DEVICE_CAMERA_LIBCAMERA_H

#include "counterlight/device.h"

/* Opens the camera that config->device names: "auto" (the first), libcamera's identifier or the end of one, or a model.
 * What is automatic is switched off first, then the values are set; the camera is handed out once its pictures show
 * them, where it tells, else a few pictures later. CLT_GONE where it is not there, CLT_BAD_INPUT where it cannot do
 * what is asked for, CLT_TIMEOUT where no picture came.
 *
 * A frame's exposed_ns is the request's SensorTimestamp less the exposure: handlers stamp the start of the readout,
 * which ends the first row's exposure. Where there is none it is the buffer's own time less the exposure. Frames carry
 * the exposure that the request's metadata tells; where it tells none, frames that may still have the exposure before
 * are dropped. A camera without a control of the exposure (vimc) has only one, for which its frame time stands. */
clt_status clt_libcamera_camera_open(const clt_camera_config *config, clt_camera **out, clt_error *error);

#endif
