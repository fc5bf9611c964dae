#include "device/camera/v4l2_node.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

/* A cause, how the caller is to act on it, and what a person is to do. */
typedef struct cause {
  int number;
  clt_status status;
  const char *advice;
} cause;

static const cause causes[] = {
    {ENODEV, CLT_GONE, "the camera was unplugged; plug it in again"},
    {ENXIO, CLT_GONE, "the camera was unplugged; plug it in again"},
    {ENOENT, CLT_GONE, "the camera is not there; plug it in, or see `counterlight doctor` for what there is"},
    {ESHUTDOWN, CLT_GONE, "the camera's USB port was switched off; plug it in again"},
    {EIO, CLT_TIMEOUT, "the camera does not answer properly; check its cable and its port"},
    {EPIPE, CLT_TIMEOUT, "the camera refused the request"},
    {EPROTO, CLT_TIMEOUT, "the camera's USB transfers fail; check its cable and its port"},
    {EILSEQ, CLT_TIMEOUT, "the camera's USB transfers fail; check its cable and its port"},
    {EOVERFLOW, CLT_TIMEOUT, "the camera sent more than it announced"},
    {ETIMEDOUT, CLT_TIMEOUT, "the camera does not answer"},
    {EAGAIN, CLT_TIMEOUT, "the camera is not ready"},
    {EACCES, CLT_BAD_INPUT, "this user may not; join the group `video`"},
    {EPERM, CLT_BAD_INPUT, "this user may not; join the group `video`"},
    {EBUSY, CLT_FAILED, "another program uses the camera; end it (`fuser -v` with the node says which)"},
    {EINVAL, CLT_BAD_INPUT, "the camera cannot do that"},
    {ERANGE, CLT_BAD_INPUT, "the value is beyond what the camera takes"},
    {ENOTTY, CLT_BAD_INPUT, "the camera cannot do that"},
    {ENOSPC, CLT_FAILED, "the USB bus has no room for that many pictures; take a lower rate or size, or another port"},
    {ENOMEM, CLT_FAILED, "memory is short; take a smaller size"},
    {EMFILE, CLT_FAILED, "too many files are open"},
};

clt_status clt_v4l2_fail(const clt_v4l2_node *node, const char *doing, int number, clt_error *error) {
  for (size_t k = 0; k < sizeof causes / sizeof causes[0]; k++) {
    if (causes[k].number == number) {
      return clt_fail(error, causes[k].status, "%s: %s: %s; %s", node->path, doing, strerror(number), causes[k].advice);
    }
  }
  return clt_fail(error, CLT_FAILED, "%s: %s: %s; plug the camera out and in", node->path, doing, strerror(number));
}

int clt_v4l2_call(const clt_v4l2_node *node, unsigned long request, void *argument) {
  int result;
  do {
    result = ioctl(node->fd, request, argument);
  } while (result != 0 && errno == EINTR);
  return result == 0 ? 0 : errno;
}

static clt_status ask(clt_v4l2_node *node, clt_error *error) {
  struct v4l2_capability about = {0};
  int number = clt_v4l2_call(node, VIDIOC_QUERYCAP, &about);
  if (number != 0) {
    return clt_v4l2_fail(node, "asking what it is", number, error);
  }
  snprintf(node->card, sizeof node->card, "%s", (const char *)about.card);
  snprintf(node->driver, sizeof node->driver, "%s", (const char *)about.driver);
  snprintf(node->bus, sizeof node->bus, "%s", (const char *)about.bus_info);
  uint32_t can = about.capabilities & V4L2_CAP_DEVICE_CAPS ? about.device_caps : about.capabilities;
  if (!(can & V4L2_CAP_VIDEO_CAPTURE) || !(can & V4L2_CAP_STREAMING)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: \"%s\" does not capture pictures by streaming%s; see `counterlight doctor` for cameras",
                    node->path, node->card,
                    can & V4L2_CAP_VIDEO_CAPTURE_MPLANE ? " in one plane: use the driver \"libcamera\"" : "");
  }
  return CLT_OK;
}

clt_status clt_v4l2_node_open(const char *path, clt_v4l2_node *node, clt_error *error) {
  *node = (clt_v4l2_node){.fd = -1};
  snprintf(node->path, sizeof node->path, "%s", path);
  node->fd = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (node->fd < 0) {
    return clt_v4l2_fail(node, "opening the camera", errno, error);
  }
  clt_status status = ask(node, error);
  if (status != CLT_OK) {
    clt_v4l2_node_close(node);
  }
  return status;
}

void clt_v4l2_node_close(clt_v4l2_node *node) {
  if (node->fd >= 0) {
    close(node->fd);
  }
  node->fd = -1;
}
