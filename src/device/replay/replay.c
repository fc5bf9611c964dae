/* A recording as a pair of devices. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "base/file.h"
#include "base/memory.h"
#include "counterlight/replay.h"
#include "device/replay/index.h"
#include "image/samples.h"

typedef struct replay replay;
typedef struct replayed_projector {
  clt_projector base;
  replay *replay;
} replayed_projector;
typedef struct replayed_camera {
  clt_camera base;
  replay *replay;
} replayed_camera;

struct replay {
  replayed_projector projector;
  replayed_camera camera;
  char folder[CLT_PATH_MAX];
  clt_index index;
  long pattern;        /* presented so far */
  long next;           /* record to serve */
  int open;            /* devices that are not closed yet */
  clt_samples samples; /* of the frame served last */
  pthread_mutex_t lock;
};

static void release(replay *self) {
  pthread_mutex_lock(&self->lock);
  int left = --self->open;
  pthread_mutex_unlock(&self->lock);
  if (left == 0) {
    clt_index_finish(&self->index);
    clt_samples_finish(&self->samples);
    pthread_mutex_destroy(&self->lock);
    free(self);
  }
}

static void describe_projector(const clt_projector *projector, clt_projector_info *info) {
  *info = ((const replayed_projector *)projector)->replay->index.panel;
}

/* The first record of the pattern from the next one on; count where there is none. */
static long find_pattern(const replay *self, long pattern) {
  long at = self->next;
  while (at < self->index.count && self->index.record[at].pattern < pattern) {
    at++;
  }
  return at;
}

static clt_status advance(replay *self, uint64_t hash, int64_t *shown_ns, clt_error *error) {
  long at = find_pattern(self, self->pattern + 1);
  if (at == self->index.count) {
    return clt_fail(error, CLT_GONE, "%s: the recording ends after %ld patterns", self->folder, self->pattern);
  }
  const clt_record *record = &self->index.record[at];
  if (record->pattern == self->pattern + 1 && record->hash != hash) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: frame %ld was recorded for another pattern: number %ld had codes of hash %016lx, now %016lx; "
                    "replay what was recorded, with its options",
                    self->folder, at, record->pattern, (unsigned long)record->hash, (unsigned long)hash);
  }
  self->pattern++;
  self->next = at;
  *shown_ns = record->shown_ns;
  return CLT_OK;
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  replay *self = ((replayed_projector *)projector)->replay;
  uint64_t hash = clt_index_hash(&self->index.panel, codes);
  pthread_mutex_lock(&self->lock);
  clt_status status = advance(self, hash, shown_ns, error);
  pthread_mutex_unlock(&self->lock);
  return status;
}

static void close_projector(clt_projector *projector) {
  if (projector != NULL) {
    release(((replayed_projector *)projector)->replay);
  }
}

static void describe_camera(const clt_camera *camera, clt_camera_info *info) {
  *info = ((const replayed_camera *)camera)->replay->index.sensor;
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  const clt_camera_info *sensor = &((replayed_camera *)camera)->replay->index.sensor;
  return seconds >= sensor->exposure_min_s && seconds <= sensor->exposure_max_s
             ? CLT_OK
             : clt_fail(error, CLT_BAD_INPUT, "an exposure of %g s; the recorded camera takes %g to %g s", seconds,
                        sensor->exposure_min_s, sensor->exposure_max_s);
}

/* The record to serve; under the lock. */
static clt_status choose(replay *self, int64_t not_before_ns, clt_record *out, clt_error *error) {
  const clt_index *index = &self->index;
  while (self->next < index->count && index->record[self->next].pattern <= self->pattern) {
    *out = index->record[self->next++];
    if (out->pattern == self->pattern && out->exposed_ns >= not_before_ns) {
      return CLT_OK;
    }
  }
  return self->next < index->count
             ? clt_fail(error, CLT_TIMEOUT, "%s: the recording has no more frames of pattern %ld", self->folder,
                        self->pattern)
             : clt_fail(error, CLT_GONE, "%s: the recording ends after %ld frames", self->folder, index->count);
}

static clt_status load(replay *self, const clt_record *record, clt_frame *frame, clt_error *error) {
  char path[CLT_PATH_MAX];
  const clt_camera_info *sensor = &self->index.sensor;
  clt_samples *samples = &self->samples;
  clt_samples_finish(samples);
  clt_status status = clt_file_join(self->folder, record->file, path, error);
  if (status == CLT_OK) {
    status = clt_samples_read(path, samples, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  if (samples->width != sensor->width || samples->height != sensor->height || samples->channels != sensor->channels) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: has %d x %d pixels and %d channels, the recorded camera %d x %d and %d",
                    path, samples->width, samples->height, samples->channels, sensor->width, sensor->height,
                    sensor->channels);
  }
  *frame = (clt_frame){.width = sensor->width,
                       .height = sensor->height,
                       .channels = sensor->channels,
                       .bits = sensor->bits,
                       .samples = samples->samples,
                       .exposed_ns = record->exposed_ns,
                       .exposure_s = record->exposure_s,
                       .sequence = record->sequence};
  size_t values = (size_t)sensor->width * (size_t)sensor->height * (size_t)sensor->channels;
  int full = (1 << sensor->bits) - 1;
  for (size_t k = 0; k < values; k++) {
    if (samples->samples[k] > full) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: sample %zu is %d, over the recorded camera's full scale of %d", path,
                      k, samples->samples[k], full);
    }
  }
  return CLT_OK;
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  (void)timeout_s; /* what was recorded is there at once, or never */
  replay *self = ((replayed_camera *)camera)->replay;
  clt_record record;
  pthread_mutex_lock(&self->lock);
  clt_status status = choose(self, not_before_ns, &record, error);
  pthread_mutex_unlock(&self->lock);
  return status == CLT_OK ? load(self, &record, frame, error) : status;
}

static void close_camera(clt_camera *camera) {
  if (camera != NULL) {
    release(((replayed_camera *)camera)->replay);
  }
}

static const clt_projector_driver projector_driver = {
    .name = "replayed", .describe = describe_projector, .present = present, .close = close_projector};
static const clt_camera_driver camera_driver = {"replayed", describe_camera, set_exposure, next, close_camera};

bool clt_replay_is_recording(const char *folder) {
  char path[CLT_PATH_MAX];
  return clt_index_path(folder, path, NULL) == CLT_OK && access(path, F_OK) == 0;
}

clt_status clt_replay_longest_exposure(const char *folder, double *seconds, clt_error *error) {
  clt_index index;
  *seconds = 0;
  clt_status status = clt_index_read(folder, &index, error);
  if (status != CLT_OK) {
    return status;
  }
  for (long k = 0; k < index.count; k++) {
    *seconds = index.record[k].exposure_s > *seconds ? index.record[k].exposure_s : *seconds;
  }
  clt_index_finish(&index);
  return *seconds > 0 ? CLT_OK : clt_fail(error, CLT_BAD_INPUT, "%s: the recording has no frames", folder);
}

clt_status clt_replay_open(const char *folder, clt_projector **projector, clt_camera **camera, clt_error *error) {
  replay *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a recording");
  }
  self->projector = (replayed_projector){{&projector_driver}, self};
  self->camera = (replayed_camera){{&camera_driver}, self};
  self->open = 2;
  char path[CLT_PATH_MAX];
  clt_status status = clt_index_path(folder, path, error); /* checks the length */
  snprintf(self->folder, sizeof self->folder, "%s", folder);
  if (status == CLT_OK) {
    status = clt_index_read(folder, &self->index, error);
  }
  if (status != CLT_OK) {
    free(self);
    return status;
  }
  pthread_mutex_init(&self->lock, NULL);
  *projector = &self->projector.base;
  *camera = &self->camera.base;
  return CLT_OK;
}
