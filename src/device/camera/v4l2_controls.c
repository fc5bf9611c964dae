#include "device/camera/v4l2_controls.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

#define EXPOSURE_UNIT_S 1e-4 /* of V4L2_CID_EXPOSURE_ABSOLUTE */
/* Tries of a request that the camera did not answer. */
enum { TRIES = 3 };

/* A control that lets the camera change its pictures by itself, the value that ends it, and another for cameras that
 * lack the first. In the order in which they have to go: later ones may only be there once the first are off. */
typedef struct automatic {
  uint32_t id;
  int64_t off, second;
} automatic;

static const automatic automatics[] = {
    {V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL, V4L2_EXPOSURE_SHUTTER_PRIORITY},
    {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0, 0}, /* exposure_dynamic_framerate */
    {V4L2_CID_AUTOGAIN, 0, 0},
    {V4L2_CID_ISO_SENSITIVITY_AUTO, V4L2_ISO_SENSITIVITY_MANUAL, V4L2_ISO_SENSITIVITY_MANUAL},
    {V4L2_CID_AUTO_WHITE_BALANCE, 0, 0},
    {V4L2_CID_AUTO_N_PRESET_WHITE_BALANCE, V4L2_WHITE_BALANCE_MANUAL, V4L2_WHITE_BALANCE_MANUAL},
    {V4L2_CID_FOCUS_AUTO, 0, 0},
    {V4L2_CID_AUTOBRIGHTNESS, 0, 0},
    {V4L2_CID_HUE_AUTO, 0, 0},
    {V4L2_CID_CHROMA_AGC, 0, 0},
    {V4L2_CID_COLOR_KILLER, 0, 0},
    {V4L2_CID_BACKLIGHT_COMPENSATION, 0, 0},
    {V4L2_CID_WIDE_DYNAMIC_RANGE, 0, 0},
    {V4L2_CID_IMAGE_STABILIZATION, 0, 0},
};
enum { AUTOMATICS = sizeof automatics / sizeof automatics[0] };

/* What makes the picture and is left as it is, unless the configuration says. */
static const uint32_t values[] = {
    V4L2_CID_EXPOSURE_ABSOLUTE,
    V4L2_CID_EXPOSURE,
    V4L2_CID_GAIN,
    V4L2_CID_ANALOGUE_GAIN,
    V4L2_CID_DIGITAL_GAIN,
    V4L2_CID_ISO_SENSITIVITY,
    V4L2_CID_IRIS_ABSOLUTE,
    V4L2_CID_WHITE_BALANCE_TEMPERATURE,
    V4L2_CID_RED_BALANCE,
    V4L2_CID_BLUE_BALANCE,
    V4L2_CID_BRIGHTNESS,
    V4L2_CID_CONTRAST,
    V4L2_CID_SATURATION,
    V4L2_CID_HUE,
    V4L2_CID_GAMMA,
    V4L2_CID_SHARPNESS,
    V4L2_CID_FOCUS_ABSOLUTE,
    V4L2_CID_ZOOM_ABSOLUTE,
    V4L2_CID_PAN_ABSOLUTE,
    V4L2_CID_TILT_ABSOLUTE,
    V4L2_CID_HFLIP,
    V4L2_CID_VFLIP,
    V4L2_CID_POWER_LINE_FREQUENCY,
};
enum { VALUES = sizeof values / sizeof values[0] };

bool clt_v4l2_automatic(uint32_t id, int64_t *off) {
  for (int k = 0; k < AUTOMATICS; k++) {
    if (automatics[k].id == id) {
      *off = automatics[k].off;
      return true;
    }
  }
  return false;
}

static int call_patiently(const clt_v4l2_node *node, unsigned long request, void *argument) {
  int number = 0;
  for (int k = 0; k < TRIES; k++) {
    number = clt_v4l2_call(node, request, argument);
    if (number != EIO && number != EPIPE && number != EPROTO) {
      break;
    }
  }
  return number;
}

static int read_value(const clt_v4l2_node *node, uint32_t id, int64_t *value) {
  struct v4l2_control control = {.id = id};
  int number = call_patiently(node, VIDIOC_G_CTRL, &control);
  *value = control.value;
  return number;
}

static int write_value(const clt_v4l2_node *node, uint32_t id, int64_t value, int64_t *got) {
  struct v4l2_control control = {.id = id, .value = (int32_t)value};
  int number = call_patiently(node, VIDIOC_S_CTRL, &control);
  return number != 0 ? number : read_value(node, id, got);
}

/* Whether the camera has that control and it can be set. */
static bool query(const clt_v4l2_node *node, uint32_t id, struct v4l2_queryctrl *about) {
  *about = (struct v4l2_queryctrl){.id = id};
  return call_patiently(node, VIDIOC_QUERYCTRL, about) == 0 &&
         !(about->flags & (V4L2_CTRL_FLAG_DISABLED | V4L2_CTRL_FLAG_READ_ONLY));
}

static clt_v4l2_lock *add(clt_v4l2_locks *locks, const struct v4l2_queryctrl *about, int64_t value) {
  clt_v4l2_lock *lock = &locks->lock[locks->count++];
  *lock = (clt_v4l2_lock){.id = about->id, .value = value};
  snprintf(lock->name, sizeof lock->name, "%s", (const char *)about->name);
  return lock;
}

static bool lost(int number) {
  return number == ENODEV || number == ENXIO;
}

/* Switches one off; a camera that will not is used all the same, and said to be. */
static clt_status switch_off(const clt_v4l2_node *node, const automatic *control, clt_v4l2_locks *locks,
                             clt_error *error) {
  struct v4l2_queryctrl about;
  int64_t got = 0;
  if (!query(node, control->id, &about)) {
    return CLT_OK;
  }
  int number = write_value(node, control->id, control->off, &got);
  int64_t value = control->off;
  if ((number != 0 || got != value) && control->second != control->off) {
    value = control->second;
    number = write_value(node, control->id, value, &got);
  }
  if (lost(number)) {
    return clt_v4l2_fail(node, "switching off what is automatic", number, error);
  }
  clt_v4l2_lock *lock = add(locks, &about, value);
  lock->held = number == 0 && got == value;
  if (!lock->held) {
    clt_log(CLT_LOG_WARNING, "%s: \"%s\" cannot be switched off (%s): pictures may change by themselves", node->path,
            lock->name, number != 0 ? strerror(number) : "it stays as it was");
  }
  return CLT_OK;
}

/* What the configuration wants of a control; false where it leaves it. */
static bool wanted(const clt_camera_config *config, uint32_t id, const char **key, int64_t *value) {
  static const int lines[] = {V4L2_CID_POWER_LINE_FREQUENCY_DISABLED, V4L2_CID_POWER_LINE_FREQUENCY_50HZ,
                              V4L2_CID_POWER_LINE_FREQUENCY_60HZ};
  switch (id) {
  case V4L2_CID_GAIN:
    *key = "gain";
    *value = llround(config->gain);
    return config->gain >= 0;
  case V4L2_CID_WHITE_BALANCE_TEMPERATURE:
    *key = "white_balance_k";
    *value = llround(config->white_balance_k);
    return config->white_balance_k > 0;
  case V4L2_CID_FOCUS_ABSOLUTE:
    *key = "focus";
    *value = llround(config->focus);
    return config->focus >= 0;
  case V4L2_CID_POWER_LINE_FREQUENCY:
    *key = "power_line_hz";
    *value = lines[config->power_line_hz == 60 ? 2 : config->power_line_hz == 50];
    return config->power_line_hz >= 0;
  default:
    return false;
  }
}

static clt_status hold(const clt_v4l2_node *node, const clt_camera_config *config, uint32_t id, clt_v4l2_locks *locks,
                       clt_error *error) {
  const char *key = NULL;
  int64_t value = 0, got = 0;
  struct v4l2_queryctrl about;
  bool asked = wanted(config, id, &key, &value);
  if (!query(node, id, &about)) {
    return asked ? clt_fail(error, CLT_BAD_INPUT, "%s: camera.%s: the camera has no such control; leave it out",
                            node->path, key)
                 : CLT_OK;
  }
  int number = asked ? 0 : read_value(node, id, &value);
  if (number == 0 && asked && (value < about.minimum || value > about.maximum)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: camera.%s: the camera takes %d to %d", node->path, key, about.minimum,
                    about.maximum);
  }
  number = number != 0 ? number : write_value(node, id, value, &got);
  if (lost(number) || (asked && number != 0)) {
    return clt_v4l2_fail(node, asked ? key : (const char *)about.name, number, error);
  }
  if (asked && llabs(got - value) > about.step) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: camera.%s: asked for %lld, the camera reads back %lld", node->path, key,
                    (long long)value, (long long)got);
  }
  clt_v4l2_lock *lock = add(locks, &about, number == 0 ? got : value);
  lock->held = number == 0;
  if (!lock->held && !(about.flags & V4L2_CTRL_FLAG_INACTIVE)) {
    clt_log(CLT_LOG_WARNING, "%s: \"%s\" cannot be locked: %s", node->path, lock->name, strerror(number));
  }
  return CLT_OK;
}

static clt_v4l2_lock *find(clt_v4l2_locks *locks, uint32_t id) {
  for (int k = 0; k < locks->count; k++) {
    if (locks->lock[k].id == id) {
      return &locks->lock[k];
    }
  }
  return NULL;
}

/* Exposure times that the camera takes; none without the control, or where it is not manual. */
static void learn_exposure(const clt_v4l2_node *node, clt_v4l2_locks *locks) {
  struct v4l2_queryctrl about;
  const clt_v4l2_lock *lock = find(locks, V4L2_CID_EXPOSURE_ABSOLUTE), *mode = find(locks, V4L2_CID_EXPOSURE_AUTO);
  locks->timed = lock != NULL && lock->held && (mode == NULL || mode->held) &&
                 query(node, V4L2_CID_EXPOSURE_ABSOLUTE, &about) && about.minimum >= 0 && about.maximum > 0;
  if (!locks->timed) {
    clt_log(CLT_LOG_WARNING, "%s: the exposure time cannot be set: every exposure is taken to last a frame",
            node->path);
    return;
  }
  locks->exposure_min_s = (about.minimum > 0 ? about.minimum : about.step > 0 ? about.step : 1) * EXPOSURE_UNIT_S;
  locks->exposure_max_s = about.maximum * EXPOSURE_UNIT_S;
  locks->exposure_asked = lock->value;
  locks->exposure_s = (double)lock->value * EXPOSURE_UNIT_S;
}

clt_status clt_v4l2_lock_all(const clt_v4l2_node *node, const clt_camera_config *config, clt_v4l2_locks *locks,
                             clt_error *error) {
  clt_status status = CLT_OK;
  *locks = (clt_v4l2_locks){0};
  for (int k = 0; status == CLT_OK && k < AUTOMATICS; k++) {
    status = switch_off(node, &automatics[k], locks, error);
  }
  for (int k = 0; status == CLT_OK && k < VALUES; k++) {
    status = hold(node, config, values[k], locks, error);
  }
  if (status == CLT_OK) {
    learn_exposure(node, locks);
  }
  return status;
}

static clt_status set_exposure(const clt_v4l2_node *node, clt_v4l2_locks *locks, clt_error *error) {
  int64_t got = 0;
  int number = write_value(node, V4L2_CID_EXPOSURE_ABSOLUTE, locks->exposure_asked, &got);
  if (number != 0) {
    return clt_v4l2_fail(node, "setting the exposure", number, error);
  }
  locks->exposure_s = (double)got * EXPOSURE_UNIT_S;
  return CLT_OK;
}

clt_status clt_v4l2_lock_again(const clt_v4l2_node *node, clt_v4l2_locks *locks, clt_error *error) {
  for (int k = 0; k < locks->count; k++) {
    clt_v4l2_lock *lock = &locks->lock[k];
    int64_t got = 0;
    if (!lock->held || lock->id == V4L2_CID_EXPOSURE_ABSOLUTE) {
      continue;
    }
    int number = write_value(node, lock->id, lock->value, &got);
    if (number != 0) {
      return clt_v4l2_fail(node, lock->name, number, error);
    }
    if (got != lock->value) {
      return clt_fail(error, CLT_TIMEOUT, "%s: \"%s\" was %lld and is %lld after the camera came back", node->path,
                      lock->name, (long long)lock->value, (long long)got);
    }
  }
  return locks->timed ? set_exposure(node, locks, error) : CLT_OK;
}

bool clt_v4l2_exposure_is(const clt_v4l2_locks *locks, double seconds) {
  return locks->exposure_asked == llround(seconds / EXPOSURE_UNIT_S);
}

void clt_v4l2_expose_later(double seconds, clt_v4l2_locks *locks) {
  locks->exposure_asked = llround(seconds / EXPOSURE_UNIT_S);
}

clt_status clt_v4l2_expose(const clt_v4l2_node *node, double seconds, clt_v4l2_locks *locks, clt_error *error) {
  clt_v4l2_expose_later(seconds, locks);
  return set_exposure(node, locks, error);
}
