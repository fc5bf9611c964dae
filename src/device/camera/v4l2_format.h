/* Format, size and rate of a Video4Linux camera. */
#ifndef CLT_DEVICE_CAMERA_V4L2_FORMAT_H
#define CLT_DEVICE_CAMERA_V4L2_FORMAT_H

#include "counterlight/device.h"
#include "device/camera/pixels.h"
#include "device/camera/v4l2_node.h"

typedef struct clt_v4l2_mode {
  const clt_pixel_format *format;
  clt_picture_layout layout;
  double frame_s;    /* from frame to frame; 0 where the driver does not say */
  int width, height; /* of the samples: the layout's by the format's shrink */
} clt_v4l2_mode;

/* Sets what the configuration wants, "auto" and 0 as clt_camera_config says, and fills mode with what the camera then
 * said it does. CLT_BAD_INPUT, with what it offers, where it does something else. */
clt_status clt_v4l2_choose_mode(const clt_v4l2_node *node, const clt_camera_config *config, clt_v4l2_mode *mode,
                                clt_error *error);

/* A size of one format, or a range of sizes, with its rates; 0 where the driver names none. */
typedef struct clt_v4l2_span {
  int width, height, width_most, height_most; /* the least and the greatest; equal where it is one size */
  double rate_low_hz, rate_high_hz;
} clt_v4l2_span;
/* The size at a place; false after the last. */
bool clt_v4l2_size_at(const clt_v4l2_node *node, uint32_t code, uint32_t place, clt_v4l2_span *span);

#endif
