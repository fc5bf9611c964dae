/* A node of Video4Linux, and what its errors mean. */
#ifndef CLT_DEVICE_CAMERA_V4L2_NODE_H
#define CLT_DEVICE_CAMERA_V4L2_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/status.h"

typedef struct clt_v4l2_node {
  int fd; /* < 0: closed */
  char path[64];
  char card[32], driver[16], bus[32];
} clt_v4l2_node;

/* Opens a node that captures pictures by streaming; it does not block. CLT_GONE where it is not there, CLT_BAD_INPUT
 * where it is no such camera or the user may not, CLT_FAILED for the rest. */
clt_status clt_v4l2_node_open(const char *path, clt_v4l2_node *node, clt_error *error);
void clt_v4l2_node_close(clt_v4l2_node *node); /* accepts a closed one */
/* An ioctl that a signal does not end; 0, or the errno. */
int clt_v4l2_call(const clt_v4l2_node *node, unsigned long request, void *argument);
/* What a number of errno from a camera means and what to do about it. doing: "setting the format". */
clt_status clt_v4l2_fail(const clt_v4l2_node *node, const char *doing, int number, clt_error *error);

#endif
