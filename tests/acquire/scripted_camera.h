/* A camera to which a script happens: another camera's frames, changed by what goes on at the devices' time. */
#ifndef CLT_TESTS_ACQUIRE_SCRIPTED_CAMERA_H
#define CLT_TESTS_ACQUIRE_SCRIPTED_CAMERA_H

#include "counterlight/device.h"
#include "noise.h"

enum { SCRIPTED_SAMPLES_MAX = 1 << 13 };

typedef struct fault_script {
  double dropped, duplicated, late, half_dark; /* of the frames */
  double walk_s, walk_for_s, walk_gain;        /* someone crosses the picture, a fifth of it wide; 0 s: nobody */
  double gone_s, gone_for_s;                   /* the camera is not there; < 0: never */
  double stuck_s, stuck_for_s;                 /* it sends the same frame again and again */
  clt_status gone_as;                          /* CLT_GONE or CLT_TIMEOUT */
  double stays_s;                              /* from then on the left third is darker; 0: never */
} fault_script;

typedef struct scripted_camera {
  clt_camera base;
  clt_camera *inner;
  fault_script script;
  clt_camera_info info;
  uint64_t random;
  int64_t first_ns;
  double last_s; /* since the first frame */
  long faults;
  uint16_t now[SCRIPTED_SAMPLES_MAX], before[SCRIPTED_SAMPLES_MAX], delivered[SCRIPTED_SAMPLES_MAX];
} scripted_camera;

static inline void scripted_describe(const clt_camera *camera, clt_camera_info *info) {
  const scripted_camera *self = (const scripted_camera *)camera;
  self->inner->driver->describe(self->inner, info);
}

static inline clt_status scripted_set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  scripted_camera *self = (scripted_camera *)camera;
  return self->inner->driver->set_exposure(self->inner, seconds, error);
}

static inline bool scripted_chance(scripted_camera *self, double chance) {
  bool now = test_random(&self->random) < chance;
  self->faults += now;
  return now;
}

/* Multiplies what the pixels of columns [from, to) have above the black level. */
static inline void scripted_shade(scripted_camera *self, const clt_frame *frame, double from, double to, double gain) {
  for (int p = 0; p < frame->width * frame->height; p++) {
    double x = p % frame->width + 0.5, value = self->info.black_level + gain * (self->now[p] - self->info.black_level);
    if (x >= from && x < to) {
      self->now[p] = (uint16_t)fmin(fmax(lrint(value), 0), (1 << frame->bits) - 1);
    }
  }
}

/* What the room does, at t seconds. */
static inline void scripted_room(scripted_camera *self, const clt_frame *frame, double t) {
  const fault_script *script = &self->script;
  double way = script->walk_for_s > 0 ? (t - script->walk_s) / script->walk_for_s : -1;
  if (way >= 0 && way < 1) {
    double middle = way * frame->width, half = 0.1 * frame->width;
    scripted_shade(self, frame, middle - half, middle + half, script->walk_gain);
  }
  if (script->stays_s > 0 && t >= script->stays_s) {
    scripted_shade(self, frame, 0, frame->width / 3.0, 0.62);
  }
}

/* What the camera does with a frame of `count` samples. */
static inline void scripted_camera_faults(scripted_camera *self, size_t count, double t) {
  const fault_script *script = &self->script;
  bool stuck = t >= script->stuck_s && t < script->stuck_s + script->stuck_for_s;
  size_t bytes = count * sizeof *self->now;
  uint16_t seen[SCRIPTED_SAMPLES_MAX];
  memcpy(seen, self->now, bytes);
  if (self->last_s > 0 && (stuck || scripted_chance(self, script->duplicated))) {
    memcpy(self->now, self->delivered, bytes);
  } else if (self->last_s > 0 && scripted_chance(self, script->late)) {
    for (size_t k = 0; k < count; k++) {
      self->now[k] = (uint16_t)fmin(fmax(self->before[k] + lrint(test_normal(&self->random)), 0), 4095);
    }
  } else if (scripted_chance(self, script->half_dark)) {
    for (size_t k = count / 2; k < count; k++) {
      self->now[k] = (uint16_t)lrint(self->info.black_level + test_normal(&self->random));
    }
  }
  memcpy(self->before, seen, bytes);
  memcpy(self->delivered, self->now, bytes);
}

static inline clt_status scripted_next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                                       clt_error *error) {
  scripted_camera *self = (scripted_camera *)camera;
  const fault_script *script = &self->script;
  clt_status status;
  do {
    status = self->inner->driver->next(self->inner, not_before_ns, timeout_s, frame, error);
    not_before_ns = frame->exposed_ns + 1;
  } while (status == CLT_OK && scripted_chance(self, script->dropped));
  if (status != CLT_OK) {
    return status;
  }
  size_t count = (size_t)frame->width * (size_t)frame->height;
  assert_true(count <= SCRIPTED_SAMPLES_MAX && frame->channels == 1);
  self->first_ns = self->first_ns > 0 ? self->first_ns : frame->exposed_ns;
  double t = (double)(frame->exposed_ns - self->first_ns) * 1e-9;
  if (script->gone_for_s > 0 && t >= script->gone_s && t < script->gone_s + script->gone_for_s) {
    self->faults++;
    status = self->inner->driver->next(self->inner, frame->exposed_ns + 1000000000, 2, frame, error); /* time goes on */
    return status != CLT_OK ? status
                            : clt_fail(error, script->gone_as, "the camera %s",
                                       script->gone_as == CLT_GONE ? "is gone" : "sends nothing");
  }
  memcpy(self->now, frame->samples, count * sizeof *self->now);
  scripted_room(self, frame, t);
  scripted_camera_faults(self, count, t);
  self->last_s = t;
  frame->samples = self->now;
  return CLT_OK;
}

static inline void scripted_init(scripted_camera *self, clt_camera *inner, const fault_script *script, uint64_t seed) {
  static const clt_camera_driver driver = {"scripted", scripted_describe, scripted_set_exposure, scripted_next, NULL};
  *self = (scripted_camera){.base = {&driver}, .inner = inner, .script = *script, .random = seed};
  inner->driver->describe(inner, &self->info);
}

#endif
