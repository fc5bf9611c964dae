/* Cameras of Video4Linux, and how they are kept running: docs/camera.md says what a person has to know. */
#ifndef CLT_DEVICE_CAMERA_V4L2_H
#define CLT_DEVICE_CAMERA_V4L2_H

#include "counterlight/device.h"

/* Opens the camera that the configuration names, sets it, locks what would change by itself, and starts it. CLT_GONE
 * where it is not there, CLT_BAD_INPUT where it cannot do what is asked; all else as the driver's messages say.
 *
 * Its next() waits for a frame, and meanwhile brings a camera back that was unplugged (under whatever node it returns)
 * or that sends nothing: the stream is started anew, then the camera is reset on its USB port, less and less often.
 * Everything is then set as it was. What is not done within the time allowed goes on in the next call. A frame is
 * delivered only where its whole exposure is known to have had the time that the control read back. */
clt_status clt_v4l2_open(const clt_camera_config *config, clt_camera **out, clt_error *error);

#endif
