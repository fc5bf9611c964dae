/* Pictures as the frames of a camera, one for each picture presented. */
#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "base/memory.h"
#include "counterlight/replay.h"
#include "device/replay/names.h"
#include "image/samples.h"

#define TICK_S (1 / 60.0) /* from refresh to refresh, for want of a better one */

typedef struct pictures pictures;
typedef struct pictures_projector {
  clt_projector base;
  pictures *pictures;
} pictures_projector;
typedef struct pictures_camera {
  clt_camera base;
  pictures *pictures;
} pictures_camera;

struct pictures {
  pictures_projector projector;
  pictures_camera camera;
  clt_projector_info panel;
  clt_camera_info sensor;
  clt_names names;
  int presented;  /* pictures so far */
  int served;     /* frames so far */
  int64_t now_ns; /* time that passes by presenting and exposing */
  double exposure_s;
  int open;            /* devices that are not closed yet */
  clt_samples samples; /* of the frame served last */
  pthread_mutex_t lock;
};

static void destroy(pictures *self) {
  clt_names_finish(&self->names);
  clt_samples_finish(&self->samples);
  pthread_mutex_destroy(&self->lock);
  free(self);
}

static void release(pictures *self) {
  pthread_mutex_lock(&self->lock);
  int left = --self->open;
  pthread_mutex_unlock(&self->lock);
  if (left == 0) {
    destroy(self);
  }
}

static void describe_projector(const clt_projector *projector, clt_projector_info *info) {
  *info = ((const pictures_projector *)projector)->pictures->panel;
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  (void)codes;
  pictures *self = ((pictures_projector *)projector)->pictures;
  pthread_mutex_lock(&self->lock);
  bool over = self->presented == self->names.count;
  self->presented += !over;
  self->now_ns += llround(TICK_S * 1e9);
  *shown_ns = self->now_ns;
  pthread_mutex_unlock(&self->lock);
  return over ? clt_fail(error, CLT_GONE, "there are only %d pictures to replay", self->names.count) : CLT_OK;
}

static void close_projector(clt_projector *projector) {
  if (projector != NULL) {
    release(((pictures_projector *)projector)->pictures);
  }
}

static void describe_camera(const clt_camera *camera, clt_camera_info *info) {
  *info = ((const pictures_camera *)camera)->pictures->sensor;
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  pictures *self = ((pictures_camera *)camera)->pictures;
  if (!(seconds >= self->sensor.exposure_min_s && seconds <= self->sensor.exposure_max_s)) {
    return clt_fail(error, CLT_BAD_INPUT, "an exposure of %g s; pictures stand for %g to %g s", seconds,
                    self->sensor.exposure_min_s, self->sensor.exposure_max_s);
  }
  self->exposure_s = seconds;
  return CLT_OK;
}

static clt_status load(pictures *self, int number, clt_error *error) {
  const char *path = self->names.path[number];
  clt_samples_finish(&self->samples);
  clt_status status = clt_samples_read(path, &self->samples, error);
  const clt_samples *samples = &self->samples;
  const clt_camera_info *sensor = &self->sensor;
  if (status == CLT_OK && sensor->width > 0 &&
      (samples->width != sensor->width || samples->height != sensor->height || samples->channels != sensor->channels ||
       samples->bits != sensor->bits)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: has %d x %d pixels, %d channels, %d bits, the first picture %d x %d, %d, %d", path,
                    samples->width, samples->height, samples->channels, samples->bits, sensor->width, sensor->height,
                    sensor->channels, sensor->bits);
  }
  return status;
}

/* Number of the picture to serve; under the lock. */
static clt_status choose(pictures *self, int64_t not_before_ns, double timeout_s, int *number, int64_t *start_ns,
                         clt_error *error) {
  if (self->served == self->presented) {
    self->now_ns += llround(timeout_s * 1e9);
    return self->presented < self->names.count
               ? clt_fail(error, CLT_TIMEOUT, "there is one picture a pattern, and pattern %d had its own",
                          self->presented)
               : clt_fail(error, CLT_GONE, "there are only %d pictures to replay", self->names.count);
  }
  *number = self->presented - 1;
  self->served = self->presented;
  *start_ns = not_before_ns > self->now_ns ? not_before_ns : self->now_ns;
  self->now_ns = *start_ns + llround(self->exposure_s * 1e9);
  return CLT_OK;
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  pictures *self = ((pictures_camera *)camera)->pictures;
  int number = 0;
  int64_t start_ns = 0;
  pthread_mutex_lock(&self->lock);
  clt_status status = choose(self, not_before_ns, timeout_s, &number, &start_ns, error);
  pthread_mutex_unlock(&self->lock);
  if (status == CLT_OK) {
    status = load(self, number, error);
  }
  if (status == CLT_OK) {
    *frame = (clt_frame){.width = self->sensor.width,
                         .height = self->sensor.height,
                         .channels = self->sensor.channels,
                         .bits = self->sensor.bits,
                         .samples = self->samples.samples,
                         .exposed_ns = start_ns,
                         .exposure_s = self->exposure_s,
                         .sequence = (uint32_t)number};
  }
  return status;
}

static void close_camera(clt_camera *camera) {
  if (camera != NULL) {
    release(((pictures_camera *)camera)->pictures);
  }
}

static const clt_projector_driver projector_driver = {
    .name = "pictures", .describe = describe_projector, .present = present, .close = close_projector};
static const clt_camera_driver camera_driver = {"pictures", describe_camera, set_exposure, next, close_camera};

/* Finds the names, and by the first picture what the camera is. */
static clt_status prepare(pictures *self, const char *path, clt_error *error) {
  clt_status status = clt_names_find(path, &self->names, error);
  if (status == CLT_OK) {
    status = load(self, 0, error);
  }
  if (status == CLT_OK) {
    const clt_samples *first = &self->samples;
    self->sensor = (clt_camera_info){.width = first->width,
                                     .height = first->height,
                                     .channels = first->channels,
                                     .bits = first->bits,
                                     .frame_s = TICK_S,
                                     .exposure_min_s = 1e-6,
                                     .exposure_max_s = 1e3,
                                     .responsivity = 1,
                                     .full_well = 1e4,
                                     .own_pixels = true};
  }
  return status;
}

clt_status clt_replay_open_pictures(const char *path, int panel_width, int panel_height, clt_projector **projector,
                                    clt_camera **camera, int *count, clt_error *error) {
  pictures *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a list of pictures");
  }
  self->projector = (pictures_projector){{&projector_driver}, self};
  self->camera = (pictures_camera){{&camera_driver}, self};
  self->panel = (clt_projector_info){panel_width, panel_height, 1, 8, TICK_S, false};
  self->exposure_s = TICK_S;
  self->open = 2;
  pthread_mutex_init(&self->lock, NULL);
  clt_status status = prepare(self, path, error);
  if (status != CLT_OK) {
    destroy(self);
    return status;
  }
  *count = self->names.count;
  *projector = &self->projector.base;
  *camera = &self->camera.base;
  return CLT_OK;
}
