/* Streaming from a Video4Linux camera into buffers that the kernel shares. */
#ifndef CLT_DEVICE_CAMERA_V4L2_STREAM_H
#define CLT_DEVICE_CAMERA_V4L2_STREAM_H

#include <stddef.h>

#include "device/camera/v4l2_node.h"

enum { CLT_V4L2_BUFFERS = 4 };

/* A zeroed one is stopped. */
typedef struct clt_v4l2_stream {
  int count;
  void *start[CLT_V4L2_BUFFERS];
  size_t length[CLT_V4L2_BUFFERS];
} clt_v4l2_stream;

/* A buffer that the camera filled. */
typedef struct clt_v4l2_picture {
  int index;
  const uint8_t *bytes;
  size_t used;
  bool damaged;
  bool monotonic;   /* stamp_ns is of CLOCK_MONOTONIC; else it is when the buffer was taken */
  bool at_exposure; /* stamp_ns is of the start of the exposure; else of the picture's end */
  int64_t stamp_ns;
  uint32_t sequence; /* counts from the start of the stream */
} clt_v4l2_picture;

/* Starts with every buffer given to the camera. Where it fails the stream is stopped. */
clt_status clt_v4l2_stream_start(const clt_v4l2_node *node, clt_v4l2_stream *stream, clt_error *error);
/* Stops, and gives every buffer back; also for a camera that is gone. */
void clt_v4l2_stream_stop(const clt_v4l2_node *node, clt_v4l2_stream *stream);
/* Waits for a picture until limit_ns; CLT_TIMEOUT where none came, CLT_GONE. The caller gives it back. */
clt_status clt_v4l2_stream_take(const clt_v4l2_node *node, const clt_v4l2_stream *stream, int64_t limit_ns,
                                clt_v4l2_picture *picture, clt_error *error);
clt_status clt_v4l2_stream_give(const clt_v4l2_node *node, int index, clt_error *error);

#endif
