#include "daemon/input.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "device/camera/v4l2.h"

bool input_is(const char *content) {
  return strncmp(content, "/dev/", 5) == 0;
}

#ifdef CLT_HAVE_V4L2
enum { COLOURS = 3, SAMPLES = 65536 };

/* The wait for one picture, and a time between two that is short enough, s. */
static const double timeout_s = 1, enough_s = 1.01 / 50;

typedef struct input {
  char device[CLT_PATH_MAX];
  clt_camera *camera; /* NULL: not opened yet */
  uint8_t *codes;
  size_t room;
  uint8_t code_of[SAMPLES];
} input;

static clt_status open_as(input *self, const char *format, clt_error *error) {
  clt_camera_config config = {.driver = "v4l2", .gain = -1, .focus = -1, .power_line_hz = -1};
  snprintf(config.device, sizeof config.device, "%s", self->device);
  snprintf(config.format, sizeof config.format, "%s", format);
  return clt_v4l2_open(&config, &self->camera, error);
}

static void close_camera(input *self) {
  if (self->camera != NULL) {
    self->camera->driver->close(self->camera);
  }
  self->camera = NULL;
}

/* Of the formats that mean codes to be shown (raw ones mean light) the first that is fast enough, else the fastest. */
static clt_status open_best(input *self, clt_error *error) {
  static const char *const formats[] = {"RGB3", "BGR3", "NV12", "YUYV", "UYVY", "MJPG", "GREY"};
  const char *best = NULL;
  double best_s = INFINITY;
  clt_status status = CLT_BAD_INPUT;
  for (size_t i = 0; i < sizeof formats / sizeof formats[0] && status == CLT_BAD_INPUT; i++) {
    clt_camera_info info;
    status = open_as(self, formats[i], error);
    if (status != CLT_OK) {
      continue;
    }
    self->camera->driver->describe(self->camera, &info);
    if (info.frame_s > enough_s) {
      best = info.frame_s < best_s ? formats[i] : best;
      best_s = info.frame_s < best_s ? info.frame_s : best_s;
      close_camera(self);
      status = CLT_BAD_INPUT;
    }
  }
  return status == CLT_BAD_INPUT && best != NULL ? open_as(self, best, error) : status;
}

static clt_status open_camera(input *self, clt_error *error) {
  clt_status status = open_best(self, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_camera_info info;
  self->camera->driver->describe(self->camera, &info);
  unsigned full = (1u << info.bits) - 1;
  for (unsigned sample = 0; sample < SAMPLES; sample++) {
    self->code_of[sample] = (uint8_t)(((sample < full ? sample : full) * 255u + full / 2) / full);
  }
  return CLT_OK;
}

/* Grey is three times the same. */
static void take_codes(input *self, const clt_frame *frame) {
  size_t count = (size_t)frame->width * (size_t)frame->height, channels = (size_t)frame->channels;
#pragma omp parallel for schedule(static)
  for (size_t k = 0; k < count; k++) {
    for (size_t c = 0; c < COLOURS; c++) {
      self->codes[COLOURS * k + c] = self->code_of[frame->samples[channels * k + (channels == COLOURS ? c : 0)]];
    }
  }
}

static clt_status next(void *data, const uint8_t **codes, int *width, int *height, clt_error *error) {
  input *self = data;
  clt_frame frame;
  clt_status status = self->camera == NULL ? open_camera(self, error) : CLT_OK;
  status = status == CLT_OK ? self->camera->driver->next(self->camera, 0, timeout_s, &frame, error) : status;
  if (status != CLT_OK) {
    return status;
  }
  size_t bytes = (size_t)frame.width * (size_t)frame.height * COLOURS;
  if (self->room < bytes) {
    free(self->codes);
    self->codes = clt_alloc(bytes, 1);
    self->room = self->codes != NULL ? bytes : 0;
  }
  if (self->codes == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: memory is short for its pictures", self->device);
  }
  take_codes(self, &frame);
  *codes = self->codes;
  *width = frame.width;
  *height = frame.height;
  return CLT_OK;
}

static void close_input(void *data) {
  input *self = data;
  close_camera(self);
  free(self->codes);
  free(self);
}

static clt_status film_of_input(const char *device, const clt_film_options *options, clt_film **out, clt_error *error) {
  input *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", device);
  }
  snprintf(self->device, sizeof self->device, "%s", device);
  return clt_film_of_source(&(clt_film_source){self, next, close_input}, options, out, error);
}
#else
static clt_status film_of_input(const char *device, const clt_film_options *options, clt_film **out, clt_error *error) {
  (void)options, (void)out;
  return clt_fail(error, CLT_BAD_INPUT, "%s: this build has no Video4Linux, and shows no video inputs", device);
}
#endif

clt_status input_film(const char *content, const clt_film_options *options, clt_film **out, clt_error *error) {
  return input_is(content) ? film_of_input(content, options, out, error) : clt_film_open(content, options, out, error);
}

clt_status input_poster(const char *content, clt_image *picture, clt_error *error) {
  enum { WIDTH = 16, HEIGHT = 9 };
  const float grey = 0.18F;
  if (!input_is(content)) {
    return clt_film_poster(content, picture, error);
  }
  clt_film *film = NULL;
  clt_status status = film_of_input(content, &(clt_film_options){WIDTH, HEIGHT, 1}, &film, error);
  clt_film_close(film);
  status = status == CLT_OK ? clt_image_init(picture, CLT_PANEL_CHANNELS, HEIGHT, WIDTH, error) : status;
  for (size_t k = 0; status == CLT_OK && k < clt_image_size(picture); k++) {
    picture->data[k] = grey;
  }
  return status;
}
