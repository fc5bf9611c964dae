#include "device/camera/v4l2_stream.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <string.h>
#include <sys/mman.h>

#include "base/clock.h"

/* Fewer could not keep a camera busy while one is read. */
enum { BUFFERS_LEAST = 2 };

static int request(const clt_v4l2_node *node, unsigned count, unsigned *granted) {
  struct v4l2_requestbuffers buffers = {
      .count = count, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
  int number = clt_v4l2_call(node, VIDIOC_REQBUFS, &buffers);
  *granted = number == 0 ? buffers.count : 0;
  return number;
}

static clt_status map(const clt_v4l2_node *node, clt_v4l2_stream *stream, clt_error *error) {
  struct v4l2_buffer buffer = {
      .index = (uint32_t)stream->count, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
  int number = clt_v4l2_call(node, VIDIOC_QUERYBUF, &buffer);
  if (number != 0) {
    return clt_v4l2_fail(node, "asking for a buffer", number, error);
  }
  void *start = mmap(NULL, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, node->fd, buffer.m.offset);
  if (start == MAP_FAILED) {
    return clt_v4l2_fail(node, "mapping a buffer", errno, error);
  }
  stream->start[stream->count] = start;
  stream->length[stream->count] = buffer.length;
  stream->count++;
  return clt_v4l2_stream_give(node, stream->count - 1, error);
}

clt_status clt_v4l2_stream_start(const clt_v4l2_node *node, clt_v4l2_stream *stream, clt_error *error) {
  unsigned granted = 0;
  *stream = (clt_v4l2_stream){0};
  int number = request(node, CLT_V4L2_BUFFERS, &granted);
  if (number != 0) {
    return clt_v4l2_fail(node, "asking for buffers", number, error);
  }
  clt_status status = granted >= BUFFERS_LEAST ? CLT_OK : clt_v4l2_fail(node, "asking for buffers", ENOMEM, error);
  for (unsigned k = 0; status == CLT_OK && k < granted && k < CLT_V4L2_BUFFERS; k++) {
    status = map(node, stream, error);
  }
  if (status == CLT_OK) {
    number = clt_v4l2_call(node, VIDIOC_STREAMON, &(int){V4L2_BUF_TYPE_VIDEO_CAPTURE});
    status = number == 0 ? CLT_OK : clt_v4l2_fail(node, "starting the stream", number, error);
  }
  if (status != CLT_OK) {
    clt_v4l2_stream_stop(node, stream);
  }
  return status;
}

void clt_v4l2_stream_stop(const clt_v4l2_node *node, clt_v4l2_stream *stream) {
  unsigned granted = 0;
  if (node->fd >= 0) {
    clt_v4l2_call(node, VIDIOC_STREAMOFF, &(int){V4L2_BUF_TYPE_VIDEO_CAPTURE});
  }
  for (int k = 0; k < stream->count; k++) {
    munmap(stream->start[k], stream->length[k]);
  }
  if (node->fd >= 0) {
    request(node, 0, &granted);
  }
  *stream = (clt_v4l2_stream){0};
}

/* A camera that is unplugged wakes the poll with an error, and then refuses with EINVAL what it took before. */
static clt_status dequeue(const clt_v4l2_node *node, const clt_v4l2_stream *stream, clt_v4l2_picture *picture,
                          clt_error *error) {
  struct v4l2_buffer buffer = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
  int number = clt_v4l2_call(node, VIDIOC_DQBUF, &buffer);
  if (number != 0) {
    return clt_v4l2_fail(node, "taking a picture", number == EINVAL ? ENODEV : number, error);
  }
  bool monotonic = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  size_t length = stream->length[buffer.index];
  *picture = (clt_v4l2_picture){
      .index = (int)buffer.index,
      .bytes = stream->start[buffer.index],
      .used = buffer.bytesused < length ? buffer.bytesused : length,
      .damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0,
      .monotonic = monotonic,
      .at_exposure = monotonic && (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE,
      .stamp_ns =
          monotonic ? buffer.timestamp.tv_sec * 1000000000LL + buffer.timestamp.tv_usec * 1000LL : clt_clock_ns(),
      .sequence = buffer.sequence};
  return CLT_OK;
}

clt_status clt_v4l2_stream_take(const clt_v4l2_node *node, const clt_v4l2_stream *stream, int64_t limit_ns,
                                clt_v4l2_picture *picture, clt_error *error) {
  for (;;) {
    int64_t left = limit_ns - clt_clock_ns();
    struct timespec wait = {left > 0 ? left / 1000000000 : 0, left > 0 ? left % 1000000000 : 0};
    struct pollfd ready = {.fd = node->fd, .events = POLLIN};
    int count = ppoll(&ready, 1, &wait, NULL);
    if (count < 0 && errno != EINTR) {
      return clt_v4l2_fail(node, "waiting for a picture", errno, error);
    }
    if (count > 0) {
      return dequeue(node, stream, picture, error);
    }
    if (left <= 0) {
      return clt_fail(error, CLT_TIMEOUT, "%s: the camera sends nothing", node->path);
    }
  }
}

clt_status clt_v4l2_stream_give(const clt_v4l2_node *node, int index, clt_error *error) {
  struct v4l2_buffer buffer = {
      .index = (uint32_t)index, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
  int number = clt_v4l2_call(node, VIDIOC_QBUF, &buffer);
  return number == 0 ? CLT_OK : clt_v4l2_fail(node, "giving a buffer back", number, error);
}
