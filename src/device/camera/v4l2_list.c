#include "device/camera/v4l2_list.h"

#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "device/camera/pixels.h"
#include "device/camera/v4l2_controls.h"
#include "device/camera/v4l2_find.h"
#include "device/camera/v4l2_format.h"

/* One more element at the end of an array; NULL where memory is short. */
static void *grow(void **array, int *count, size_t size) {
  char *more = realloc(*array, ((size_t)*count + 1) * size);
  if (more == NULL) {
    return NULL;
  }
  *array = more;
  return memset(more + (size_t)(*count)++ * size, 0, size);
}

static bool add_size(clt_v4l2_offer *offer, int width, int height, const clt_v4l2_span *span) {
  clt_v4l2_size *size = grow((void **)&offer->sizes, &offer->size_count, sizeof *size);
  if (size != NULL) {
    *size = (clt_v4l2_size){width, height, span->rate_low_hz, span->rate_high_hz};
  }
  return size != NULL;
}

static bool read_offer(const clt_v4l2_node *node, const struct v4l2_fmtdesc *about, clt_v4l2_offer *offer) {
  const clt_pixel_format *format = clt_pixels_find(about->pixelformat);
  clt_pixels_name(about->pixelformat, offer->code);
  snprintf(offer->name, sizeof offer->name, "%s", (const char *)about->description);
  offer->decoded = format != NULL;
  offer->channels = format != NULL ? format->channels : 0;
  offer->depth = format != NULL ? format->depth : 0;
  offer->compressed = (about->flags & V4L2_FMT_FLAG_COMPRESSED) != 0;
  clt_v4l2_span span;
  bool stored = true;
  for (uint32_t k = 0; stored && clt_v4l2_size_at(node, about->pixelformat, k, &span); k++) {
    stored = add_size(offer, span.width, span.height, &span);
    if (stored && (span.width_most != span.width || span.height_most != span.height)) {
      stored = add_size(offer, span.width_most, span.height_most, &span);
    }
  }
  return stored;
}

static bool read_offers(const clt_v4l2_node *node, clt_v4l2_camera *camera) {
  struct v4l2_fmtdesc about = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
  for (; clt_v4l2_call(node, VIDIOC_ENUM_FMT, &about) == 0; about.index++) {
    clt_v4l2_offer *offer = grow((void **)&camera->offers, &camera->offer_count, sizeof *offer);
    if (offer == NULL || !read_offer(node, &about, offer)) {
      return false;
    }
  }
  return true;
}

static void read_setting(const clt_v4l2_node *node, const struct v4l2_query_ext_ctrl *about,
                         clt_v4l2_setting *setting) {
  struct v4l2_control control = {.id = about->id};
  int64_t off = 0;
  *setting =
      (clt_v4l2_setting){.id = about->id,
                         .least = about->minimum,
                         .most = about->maximum,
                         .step = (int64_t)about->step,
                         .standard = about->default_value,
                         .menu = about->type == V4L2_CTRL_TYPE_MENU || about->type == V4L2_CTRL_TYPE_INTEGER_MENU,
                         .inactive = (about->flags & V4L2_CTRL_FLAG_INACTIVE) != 0,
                         .read_only = (about->flags & V4L2_CTRL_FLAG_READ_ONLY) != 0,
                         .automatic = clt_v4l2_automatic(about->id, &off)};
  snprintf(setting->name, sizeof setting->name, "%s", about->name);
  bool known = clt_v4l2_call(node, VIDIOC_G_CTRL, &control) == 0;
  setting->value = known ? control.value : about->default_value;
  setting->on = setting->automatic && known && setting->value != off;
}

static bool read_settings(const clt_v4l2_node *node, clt_v4l2_camera *camera) {
  const uint32_t after = V4L2_CTRL_FLAG_NEXT_CTRL;
  struct v4l2_query_ext_ctrl about = {.id = after};
  for (; clt_v4l2_call(node, VIDIOC_QUERY_EXT_CTRL, &about) == 0; about.id |= after) {
    bool amount = about.type == V4L2_CTRL_TYPE_INTEGER || about.type == V4L2_CTRL_TYPE_BOOLEAN ||
                  about.type == V4L2_CTRL_TYPE_MENU || about.type == V4L2_CTRL_TYPE_INTEGER_MENU;
    if (!amount || (about.flags & V4L2_CTRL_FLAG_DISABLED)) {
      continue;
    }
    clt_v4l2_setting *setting = grow((void **)&camera->settings, &camera->setting_count, sizeof *setting);
    if (setting == NULL) {
      return false;
    }
    read_setting(node, &about, setting);
  }
  return true;
}

/* What is at a node; false where memory is short. A node that is no camera is left out. */
static bool read_node(int number, clt_v4l2_cameras *cameras) {
  clt_v4l2_node node;
  clt_v4l2_identity identity = {0};
  clt_error error = {0};
  char path[64];
  snprintf(path, sizeof path, "/dev/video%d", number);
  clt_status status = clt_v4l2_node_open(path, &node, &error);
  if (status != CLT_OK && node.card[0] != '\0') {
    return true;
  }
  clt_v4l2_camera *camera = grow((void **)&cameras->camera, &cameras->count, sizeof *camera);
  if (camera == NULL) {
    clt_v4l2_node_close(&node);
    return false;
  }
  clt_v4l2_identify(&node, &identity);
  camera->status = status;
  memcpy(camera->message, error.message, sizeof camera->message);
  memcpy(camera->node, node.path, sizeof camera->node);
  memcpy(camera->card, node.card, sizeof camera->card);
  memcpy(camera->driver, node.driver, sizeof camera->driver);
  memcpy(camera->bus, node.bus, sizeof camera->bus);
  camera->is_usb = clt_v4l2_usb_of_node(number, &camera->usb, &camera->usb_mbit_s);
  clt_v4l2_stable_name(&node, &identity, camera->stable, sizeof camera->stable);
  bool stored = status != CLT_OK || (read_offers(&node, camera) && read_settings(&node, camera));
  clt_v4l2_node_close(&node);
  return stored;
}

clt_status clt_v4l2_list(clt_v4l2_cameras *cameras, clt_error *error) {
  clt_v4l2_nodes nodes;
  *cameras = (clt_v4l2_cameras){0};
  clt_v4l2_nodes_read(&nodes);
  for (int k = 0; k < nodes.count; k++) {
    if (!read_node(nodes.number[k], cameras)) {
      clt_v4l2_cameras_finish(cameras);
      return clt_fail(error, CLT_FAILED, "memory is short for a list of cameras");
    }
  }
  return CLT_OK;
}

void clt_v4l2_cameras_finish(clt_v4l2_cameras *cameras) {
  for (int k = 0; k < cameras->count; k++) {
    clt_v4l2_camera *camera = &cameras->camera[k];
    for (int f = 0; f < camera->offer_count; f++) {
      free(camera->offers[f].sizes);
    }
    free(camera->offers);
    free(camera->settings);
  }
  free(cameras->camera);
  *cameras = (clt_v4l2_cameras){0};
}
