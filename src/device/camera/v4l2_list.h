/* What Video4Linux cameras this machine has and what each can do: for a person who writes a configuration, and for
 * `counterlight doctor`. There only where the feature v4l2 is built (CLT_HAVE_V4L2). */
#ifndef CLT_DEVICE_CAMERA_V4L2_LIST_H
#define CLT_DEVICE_CAMERA_V4L2_LIST_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/status.h"
#include "device/usb/usb.h"

/* One size of a format, pixels, with the slowest and the fastest rate, frames a second; 0 where the driver does not
 * say. A driver that offers a range of sizes is listed with its least and its greatest. */
typedef struct clt_v4l2_size {
  int width, height;
  double rate_low_hz, rate_high_hz;
} clt_v4l2_size;

typedef struct clt_v4l2_offer {
  char code[5];  /* as the configuration's `format`: "YUYV" */
  char name[32]; /* the driver's words */
  bool decoded;  /* one that counterlight reads */
  int channels;  /* 1 or 3; 0 where it is not read */
  int depth;     /* bits of a sample as the camera sends it; 0 where it is not read */
  bool compressed;
  int size_count;
  clt_v4l2_size *sizes;
} clt_v4l2_offer;

typedef struct clt_v4l2_setting {
  uint32_t id;
  char name[32];
  int64_t least, most, step, standard, value;
  bool menu;      /* values are choices, not amounts */
  bool inactive;  /* another control takes its place now: an automatic one */
  bool read_only; /* cannot be set */
  bool automatic; /* the camera changes the picture by itself through it: to be switched off while measuring */
  bool on;        /* automatic and switched on now */
} clt_v4l2_setting;

typedef struct clt_v4l2_camera {
  char node[64];             /* "/dev/video0" */
  char stable[CLT_PATH_MAX]; /* what to write as `device`: it survives unplugging and starting again */
  char card[32], driver[16], bus[32];
  bool is_usb;
  clt_usb_id usb;    /* where is_usb */
  double usb_mbit_s; /* negotiated speed: 12, 480, 5000, ...; 0: not known, or not USB */
  clt_status status; /* CLT_OK, or why it could not be asked: message */
  char message[CLT_MESSAGE_MAX];
  int offer_count, setting_count;
  clt_v4l2_offer *offers;
  clt_v4l2_setting *settings;
} clt_v4l2_camera;

/* Owned by the struct; a zeroed one is empty. */
typedef struct clt_v4l2_cameras {
  int count;
  clt_v4l2_camera *camera; /* in the order of their nodes */
} clt_v4l2_cameras;

/* Asks every camera; one that cannot be opened (in use is no hindrance, missing permission is) is listed with its
 * status. No camera is no failure. Nothing is changed on any. CLT_FAILED where memory is short. */
clt_status clt_v4l2_list(clt_v4l2_cameras *cameras, clt_error *error);
void clt_v4l2_cameras_finish(clt_v4l2_cameras *cameras);

#endif
