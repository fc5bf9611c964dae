/* Which node is the camera: by a name that stays the same when nodes are numbered anew. */
#ifndef CLT_DEVICE_CAMERA_V4L2_FIND_H
#define CLT_DEVICE_CAMERA_V4L2_FIND_H

#include <stdbool.h>

#include "device/camera/v4l2_node.h"
#include "device/usb/usb.h"

/* What a camera is known by. */
typedef struct clt_v4l2_identity {
  bool is_usb;
  clt_usb_id usb;
  char card[32], bus[32]; /* where it is none of USB */
} clt_v4l2_identity;

/* The nodes below /sys/class/video4linux, by number. */
enum { CLT_V4L2_NODES_MAX = 64 };
typedef struct clt_v4l2_nodes {
  int count, number[CLT_V4L2_NODES_MAX];
} clt_v4l2_nodes;
void clt_v4l2_nodes_read(clt_v4l2_nodes *nodes);

/* What is behind a node, as sysfs says; is_usb is false for all else. */
bool clt_v4l2_usb_of_node(int number, clt_usb_id *usb, double *mbit_s);

/* Opens the camera that the configuration's `device` names, and says what it is known by from now on. CLT_GONE where
 * there is none such now; CLT_BAD_INPUT where the name is wrong or does not say which of several. */
clt_status clt_v4l2_find(const char *device, clt_v4l2_node *node, clt_v4l2_identity *identity, clt_error *error);
/* Opens that camera again, under whatever node. A USB device is known by vendor, product and serial number; without a
 * serial number, by vendor, product and port. */
clt_status clt_v4l2_find_again(const clt_v4l2_identity *identity, clt_v4l2_node *node, clt_error *error);
/* What `device` is to be so that the camera is found after any replugging. */
void clt_v4l2_stable_name(const clt_v4l2_node *node, const clt_v4l2_identity *identity, char *name, size_t size);
void clt_v4l2_identify(const clt_v4l2_node *node, clt_v4l2_identity *identity);

#endif
