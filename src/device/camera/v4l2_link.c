#include "device/camera/v4l2_link.h"

#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"

#define FRAME_S (1 / 30.0) /* where the driver does not say */
/* A camera is stalled after so many frames' time without one, and some more for a start. */
#define STALL_FRAMES 10
#define STALL_MORE_S 0.3
/* Between two looks for a camera that is away. */
#define LOOK_S 0.05
/* Pictures after which a camera counts as well again. */
enum { WELL_PICTURES = 100 };

static clt_status start(clt_v4l2_link *link, clt_error *error) {
  clt_status status = clt_v4l2_stream_start(&link->node, &link->stream, error);
  link->life_ns = clt_clock_ns();
  return status;
}

/* Nobody else is to change what is locked; where another has that right already, its changes would be noticed. */
static void claim(const clt_v4l2_node *node) {
  clt_v4l2_call(node, VIDIOC_S_PRIORITY, &(enum v4l2_priority){V4L2_PRIORITY_RECORD});
}

/* The port of a USB camera tells the device that is to be reset, whatever its serial number is like. */
static void note_port(clt_v4l2_link *link) {
  clt_v4l2_identity now;
  clt_v4l2_identify(&link->node, &now);
  link->port = now.usb;
  link->port.serial[0] = '\0';
}

static void keep_mode(clt_v4l2_link *link) {
  clt_camera_config *config = &link->config;
  clt_pixels_name(link->mode.format->code, config->format);
  config->width = link->mode.layout.width;
  config->height = link->mode.layout.height;
  config->rate_hz = link->mode.frame_s > 0 ? 1 / link->mode.frame_s : 0;
  link->mode.frame_s = link->mode.frame_s > 0 ? link->mode.frame_s : FRAME_S;
}

clt_status clt_v4l2_link_open(const clt_camera_config *config, clt_v4l2_link *link, clt_error *error) {
  *link = (clt_v4l2_link){.config = *config, .node.fd = -1};
  clt_status status = clt_v4l2_find(config->device, &link->node, &link->identity, error);
  if (status == CLT_OK) {
    claim(&link->node);
    note_port(link);
    status = clt_v4l2_choose_mode(&link->node, config, &link->mode, error);
  }
  if (status == CLT_OK) {
    keep_mode(link);
    status = clt_v4l2_lock_all(&link->node, config, &link->locks, error);
  }
  status = status == CLT_OK ? start(link, error) : status;
  if (status != CLT_OK) {
    clt_v4l2_link_close(link);
  }
  if (status == CLT_TIMEOUT && link->identity.is_usb) {
    clt_usb_reset(&link->port, NULL); /* for who tries again */
  }
  return status;
}

void clt_v4l2_link_close(clt_v4l2_link *link) {
  clt_v4l2_stream_stop(&link->node, &link->stream);
  clt_v4l2_node_close(&link->node);
}

static clt_status reopen(clt_v4l2_link *link, clt_error *error) {
  clt_v4l2_mode mode;
  clt_status status = clt_v4l2_find_again(&link->identity, &link->node, error);
  if (status == CLT_OK) {
    claim(&link->node);
    note_port(link);
    status = clt_v4l2_choose_mode(&link->node, &link->config, &mode, error);
  }
  if (status == CLT_OK) {
    link->mode.layout = mode.layout;
    status = clt_v4l2_lock_again(&link->node, &link->locks, error);
  }
  status = status == CLT_OK ? start(link, error) : status;
  if (status != CLT_OK) {
    clt_v4l2_link_close(link);
  }
  return status;
}

static void pause_for(double seconds) {
  nanosleep(&(struct timespec){0, (long)(seconds * 1e9)}, NULL);
}

static void wait_for_news(const clt_v4l2_link *link, double seconds) {
  clt_error none;
  if (!link->identity.is_usb || clt_usb_wait(&link->identity.usb, seconds, &none) != CLT_TIMEOUT) {
    pause_for(seconds < LOOK_S ? seconds : LOOK_S);
  }
}

/* The camera is reset on its port where it is on one, and has to be opened again in any case. False where it is too
 * soon after the last time. */
static bool reset(clt_v4l2_link *link) {
  if (!clt_usb_backoff_take(&link->backoff, clt_clock_ns())) {
    pause_for(LOOK_S);
    return false;
  }
  clt_error why = {0};
  clt_log(CLT_LOG_WARNING, "%s: the camera does not answer: resetting it", link->node.path);
  clt_v4l2_link_close(link);
  if (link->identity.is_usb && clt_usb_reset(&link->port, &why) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "%s", why.message);
  }
  return true;
}

clt_status clt_v4l2_link_restore(clt_v4l2_link *link, int64_t limit_ns, clt_error *error) {
  for (;;) {
    clt_status status = reopen(link, error);
    if (status == CLT_OK) {
      clt_log(CLT_LOG_NOTICE, "%s: the camera is back", link->node.path);
      return CLT_OK;
    }
    if (status == CLT_TIMEOUT) {
      reset(link);
    }
    int64_t left = limit_ns - clt_clock_ns();
    if (left <= 0) {
      /* Also what looks like a wrong setting passes: a node has no group yet, the last user has not let go. */
      clt_fail_within(error, "the camera is not back yet: ");
      error->status = CLT_GONE;
      return CLT_GONE;
    }
    wait_for_news(link, (double)left * 1e-9);
  }
}

int64_t clt_v4l2_link_patience(const clt_v4l2_link *link) {
  return link->life_ns + (int64_t)((STALL_FRAMES * link->mode.frame_s + STALL_MORE_S) * 1e9);
}

void clt_v4l2_link_good(clt_v4l2_link *link) {
  link->life_ns = clt_clock_ns();
  link->remedies = 0;
  if (++link->good == WELL_PICTURES) {
    link->backoff = (clt_usb_backoff){0};
  }
}

bool clt_v4l2_link_treat(clt_v4l2_link *link, const clt_error *problem) {
  link->good = 0;
  link->life_ns = clt_clock_ns();
  if (problem->status == CLT_GONE) {
    clt_log(CLT_LOG_WARNING, "%s", problem->message);
    clt_v4l2_link_close(link);
    return true;
  }
  if (link->remedies++ > 0) {
    return reset(link);
  }
  clt_error why = {0};
  clt_log(CLT_LOG_WARNING, "%s; its stream is started anew", problem->message);
  clt_v4l2_stream_stop(&link->node, &link->stream);
  if (start(link, &why) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "%s", why.message);
    clt_v4l2_link_close(link);
  }
  return true;
}
