/* The recorder: a projector and a camera that keep what goes through them. */
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/memory.h"
#include "counterlight/replay.h"
#include "device/replay/index.h"
#include "image/samples.h"

typedef struct recorder recorder;
typedef struct recorder_projector {
  clt_projector base;
  recorder *recorder;
} recorder_projector;
typedef struct recorder_camera {
  clt_camera base;
  recorder *recorder;
} recorder_camera;

struct recorder {
  recorder_projector projector;
  recorder_camera camera;
  clt_projector *inner_projector; /* not owned */
  clt_camera *inner_camera;       /* not owned */
  clt_projector_info panel;
  char folder[CLT_PATH_MAX];
  int index; /* descriptor */
  int open;  /* devices that are not closed yet */
  long frames;
  clt_record now;       /* the pattern that is shown */
  pthread_mutex_t lock; /* for now and open */
};

/* One of the devices is closed; the last one frees all. */
static void release(recorder *self) {
  pthread_mutex_lock(&self->lock);
  int left = --self->open;
  pthread_mutex_unlock(&self->lock);
  if (left == 0) {
    close(self->index);
    pthread_mutex_destroy(&self->lock);
    free(self);
  }
}

static void describe_projector(const clt_projector *projector, clt_projector_info *info) {
  const recorder *self = ((const recorder_projector *)projector)->recorder;
  self->inner_projector->driver->describe(self->inner_projector, info);
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  recorder *self = ((recorder_projector *)projector)->recorder;
  clt_status status = self->inner_projector->driver->present(self->inner_projector, codes, shown_ns, error);
  if (status == CLT_OK) {
    uint64_t hash = clt_index_hash(&self->panel, codes);
    pthread_mutex_lock(&self->lock);
    self->now.pattern++;
    self->now.hash = hash;
    self->now.shown_ns = *shown_ns;
    pthread_mutex_unlock(&self->lock);
  }
  return status;
}

static void close_projector(clt_projector *projector) {
  if (projector != NULL) {
    release(((recorder_projector *)projector)->recorder);
  }
}

static void describe_camera(const clt_camera *camera, clt_camera_info *info) {
  const recorder *self = ((const recorder_camera *)camera)->recorder;
  self->inner_camera->driver->describe(self->inner_camera, info);
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  recorder *self = ((recorder_camera *)camera)->recorder;
  return self->inner_camera->driver->set_exposure(self->inner_camera, seconds, error);
}

/* The file first, then its line: a line always has its file. */
static clt_status keep(recorder *self, const clt_frame *frame, clt_error *error) {
  pthread_mutex_lock(&self->lock);
  clt_record record = self->now;
  pthread_mutex_unlock(&self->lock);
  record.sequence = frame->sequence;
  record.exposed_ns = frame->exposed_ns;
  record.exposure_s = frame->exposure_s;
  snprintf(record.file, sizeof record.file, "frame-%06ld.png", self->frames);
  char path[CLT_PATH_MAX];
  /* The writer only reads the samples. */
  const clt_samples samples = {frame->width, frame->height, frame->channels, 16, (uint16_t *)(uintptr_t)frame->samples};
  clt_status status = clt_file_join(self->folder, record.file, path, error);
  if (status == CLT_OK) {
    status = clt_samples_write(path, &samples, error);
  }
  if (status == CLT_OK && (status = clt_index_append(self->index, &record, error)) != CLT_OK) {
    unlink(path);
  }
  if (status != CLT_OK) {
    clt_fail_within(error, "recording frame %ld (free some space, or record elsewhere): ", self->frames);
    return CLT_FAILED;
  }
  self->frames++;
  return CLT_OK;
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  recorder *self = ((recorder_camera *)camera)->recorder;
  clt_status status = self->inner_camera->driver->next(self->inner_camera, not_before_ns, timeout_s, frame, error);
  return status == CLT_OK ? keep(self, frame, error) : status;
}

static void close_camera(clt_camera *camera) {
  if (camera != NULL) {
    release(((recorder_camera *)camera)->recorder);
  }
}

static const clt_projector_driver projector_driver = {
    .name = "recorded", .describe = describe_projector, .present = present, .close = close_projector};
static const clt_camera_driver camera_driver = {"recorded", describe_camera, set_exposure, next, close_camera};

static clt_status make_folder(const char *folder, clt_error *error) {
  return mkdir(folder, 0777) != 0 && errno != EEXIST
             ? clt_fail(error, CLT_BAD_INPUT, "%s: the recording's folder cannot be made: %s", folder, strerror(errno))
             : CLT_OK;
}

clt_status clt_recording_open(const char *folder, clt_projector *projector, clt_camera *camera,
                              clt_projector **recorded_projector, clt_camera **recorded_camera, clt_error *error) {
  recorder *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a recording");
  }
  clt_camera_info sensor;
  projector->driver->describe(projector, &self->panel);
  camera->driver->describe(camera, &sensor);
  self->inner_projector = projector;
  self->inner_camera = camera;
  self->projector.base.driver = &projector_driver;
  self->camera.base.driver = &camera_driver;
  self->projector.recorder = self->camera.recorder = self;
  self->open = 2;
  char path[CLT_PATH_MAX];
  clt_status status = clt_index_path(folder, path, error); /* checks the length */
  snprintf(self->folder, sizeof self->folder, "%s", folder);
  if (status == CLT_OK) {
    status = make_folder(folder, error);
  }
  if (status == CLT_OK) {
    status = clt_index_create(folder, &self->panel, &sensor, &self->index, error);
  }
  if (status != CLT_OK) {
    free(self);
    return status;
  }
  pthread_mutex_init(&self->lock, NULL);
  *recorded_projector = &self->projector.base;
  *recorded_camera = &self->camera.base;
  return CLT_OK;
}
