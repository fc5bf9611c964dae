/* A camera that misbehaves: a driver around another camera's, which changes its frames on their way. */
#ifndef CLT_TESTS_RIG_WRAPPED_CAMERA_H
#define CLT_TESTS_RIG_WRAPPED_CAMERA_H

#include "counterlight/device.h"
#include "support.h"

enum { WRAPPED_SAMPLES_MAX = 1 << 16 };

/* What it does to the samples of a frame. */
typedef struct wrapped_camera wrapped_camera;
typedef void wrapped_trick(wrapped_camera *camera, clt_frame *frame);
struct wrapped_camera {
  clt_camera base;
  clt_camera *inner;
  wrapped_trick *trick;
  double state[4]; /* the trick's own */
  double strength;
  double fixed_s; /* exposure that it takes whatever is asked for, while its frames tell what was asked for; 0: obeys */
  double asked_s;
  double step; /* that it tells of; 0: as the inner camera does */
  uint64_t random;
  long frames, faults;
  uint16_t samples[WRAPPED_SAMPLES_MAX];   /* that are delivered, until the trick: as the inner camera's */
  uint16_t delivered[WRAPPED_SAMPLES_MAX]; /* with the frame before */
  uint16_t before[WRAPPED_SAMPLES_MAX];    /* of the inner camera's frame before */
};

static inline void wrapped_describe(const clt_camera *camera, clt_camera_info *info) {
  const wrapped_camera *self = (const wrapped_camera *)camera;
  self->inner->driver->describe(self->inner, info);
  info->step = self->step > 0 ? self->step : info->step;
}

static inline clt_status wrapped_set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  wrapped_camera *self = (wrapped_camera *)camera;
  self->asked_s = seconds;
  return self->inner->driver->set_exposure(self->inner, self->fixed_s > 0 ? self->fixed_s : seconds, error);
}

static inline clt_status wrapped_next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                                      clt_error *error) {
  wrapped_camera *self = (wrapped_camera *)camera;
  clt_status status = self->inner->driver->next(self->inner, not_before_ns, timeout_s, frame, error);
  if (status == CLT_OK) {
    size_t count = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
    assert_true(count <= WRAPPED_SAMPLES_MAX);
    memcpy(self->samples, frame->samples, count * sizeof *self->samples);
    frame->exposure_s = self->fixed_s > 0 ? self->asked_s : frame->exposure_s;
    self->trick(self, frame);
    memcpy(self->before, frame->samples, count * sizeof *self->before);
    memcpy(self->delivered, self->samples, count * sizeof *self->delivered);
    frame->samples = self->samples;
    self->frames++;
  }
  return status;
}

static inline void wrapped_init(wrapped_camera *self, clt_camera *inner, wrapped_trick *trick, double strength,
                                uint64_t seed) {
  static const clt_camera_driver driver = {"wrapped", wrapped_describe, wrapped_set_exposure, wrapped_next, NULL};
  *self = (wrapped_camera){.base = {&driver}, .inner = inner, .trick = trick, .strength = strength, .random = seed};
}

/* Multiplies what a channel has above the black level. */
static inline void wrapped_scale(wrapped_camera *self, const clt_frame *frame, int channel, double gain) {
  clt_camera_info info;
  self->inner->driver->describe(self->inner, &info);
  double top = (1 << frame->bits) - 1;
  for (int p = 0; p < frame->width * frame->height; p++) {
    uint16_t *sample = &self->samples[p * frame->channels + channel];
    *sample = (uint16_t)lrint(fmin(fmax(info.black_level + gain * (*sample - info.black_level), 0), top));
  }
}

/* Mean above black over full scale. */
static inline double wrapped_mean(const wrapped_camera *self, const clt_frame *frame, int channel) {
  clt_camera_info info;
  self->inner->driver->describe(self->inner, &info);
  double sum = 0;
  for (int p = 0; p < frame->width * frame->height; p++) {
    sum += self->samples[p * frame->channels + channel] - info.black_level;
  }
  return sum / ((double)frame->width * frame->height * ((1 << frame->bits) - 1));
}

#endif
