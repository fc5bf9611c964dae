/* The simulated camera: integrates the room's light over its exposure and forms frames as a sensor does. */
#include <stdlib.h>

#include "base/memory.h"
#include "sim/noise.h"
#include "sim/shutter.h"
#include "sim/state.h"

/* Samples of a frame that one thread forms sooner than several have met on a busy machine. */
enum { FEW_SAMPLES = 1 << 16 };

typedef struct simulated_camera {
  clt_camera base;
  clt_scene *scene;
  clt_shutter shutter;
  int width, height; /* of a frame */
  size_t values;     /* channels * cells */
  /* Per value: mean radiance over the exposure, mean electrons, exp(-electrons). */
  float *radiance;
  double *electrons, *none;
  uint16_t *samples;
} simulated_camera;

static void describe(const clt_camera *camera, clt_camera_info *info) {
  const simulated_camera *self = (const simulated_camera *)camera;
  const clt_camera_description *sensor = &self->scene->description.camera;
  *info = (clt_camera_info){.width = self->width,
                            .height = self->height,
                            .channels = self->scene->description.channels,
                            .bits = sensor->bits,
                            .frame_s = sensor->frame_s,
                            .exposure_min_s = CLT_EXPOSURE_MIN_S,
                            .exposure_max_s = CLT_EXPOSURE_MAX_S,
                            .black_level = sensor->black_level,
                            .responsivity = self->scene->responsivity,
                            .full_well = sensor->full_well,
                            .read_noise = sensor->read_noise};
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  simulated_camera *self = (simulated_camera *)camera;
  if (!(seconds >= CLT_EXPOSURE_MIN_S && seconds <= CLT_EXPOSURE_MAX_S)) {
    return clt_fail(error, CLT_BAD_INPUT, "an exposure of %g s is out of the simulated camera's range, %g to %g s",
                    seconds, CLT_EXPOSURE_MIN_S, CLT_EXPOSURE_MAX_S);
  }
  pthread_mutex_lock(&self->scene->lock);
  clt_shutter_request(&self->shutter, seconds, self->scene->now_ns);
  pthread_mutex_unlock(&self->scene->lock);
  return CLT_OK;
}

/* Electrons of a fully exposed pixel are full_well; a negative radiance (of a measured transport) frees none. */
static void expect_electrons(simulated_camera *self, double exposure_s) {
  const clt_camera_description *sensor = &self->scene->description.camera;
  double gain = self->scene->responsivity * exposure_s * sensor->full_well;
  for (size_t k = 0; k < self->values; k++) {
    self->electrons[k] = fmax(0.0, gain * (double)self->radiance[k]);
    self->none[k] = exp(-self->electrons[k]);
  }
}

/* One sample: saturation, response curve (odd below zero, where noise may carry the signal), pedestal, quantisation. */
static uint16_t digitise(const clt_camera_description *sensor, double electrons) {
  double full = (1 << sensor->bits) - 1, signal = fmin(electrons / sensor->full_well, 1.0);
  if (sensor->response.kind != CLT_CURVE_LINEAR) {
    signal = copysign(clt_curve_encode(&sensor->response, fabs(signal)), signal);
  }
  double value = rint(sensor->black_level + signal * (full - sensor->black_level));
  return (uint16_t)fmin(fmax(value, 0.0), full);
}

static void form_samples(simulated_camera *self, uint32_t sequence) {
  const clt_scene_description *description = &self->scene->description;
  const clt_camera_description *sensor = &description->camera;
  uint64_t key = clt_noise_key(description->seed, sequence);
  int channels = description->channels, pixels = sensor->cell_pixels;
  size_t cells = self->values / (size_t)channels;
#pragma omp parallel for schedule(static) if (self->width * self->height * channels > FEW_SAMPLES)
  for (int y = 0; y < self->height; y++) {
    size_t sample = (size_t)y * (size_t)self->width * (size_t)channels;
    for (int x = 0; x < self->width; x++) {
      size_t cell = (size_t)(y / pixels) * (size_t)description->width + (size_t)(x / pixels);
      for (int c = 0; c < channels; c++, sample++) {
        size_t from = (size_t)c * cells + cell;
        double electrons =
            clt_noise_electrons(key, sample, self->electrons[from], self->none[from], sensor->read_noise);
        self->samples[sample] = digitise(sensor, electrons);
      }
    }
  }
}

/* Takes the next wanted frame off the clock into `taken` and collects its light; under the scene's lock. */
static clt_status expose(simulated_camera *self, int64_t not_before_ns, double timeout_s, clt_shutter *taken,
                         clt_error *error) {
  clt_scene *scene = self->scene;
  *taken = self->shutter;
  double wait_s = ((double)not_before_ns - (double)scene->now_ns) * 1e-9;
  if (wait_s <= timeout_s) {
    clt_shutter_advance(taken, not_before_ns, scene->now_ns);
    wait_s = (double)(taken->start_ns - scene->now_ns) * 1e-9;
  }
  if (wait_s > timeout_s) {
    scene->now_ns += llround(fmax(timeout_s, 0.0) * 1e9);
    return clt_fail(error, CLT_TIMEOUT, "the simulated camera's next wanted frame starts in %.3g s, after %.3g s",
                    wait_s, timeout_s);
  }
  int64_t end_ns = taken->start_ns + clt_shutter_exposure_ns(taken);
  clt_timeline_expose(&scene->timeline, taken->start_ns, end_ns, self->radiance);
  self->shutter = *taken;
  clt_shutter_step(&self->shutter);
  scene->now_ns = end_ns > scene->now_ns ? end_ns : scene->now_ns;
  clt_timeline_forget(&scene->timeline, self->shutter.start_ns);
  return CLT_OK;
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  simulated_camera *self = (simulated_camera *)camera;
  clt_shutter taken;
  pthread_mutex_lock(&self->scene->lock);
  clt_status status = expose(self, not_before_ns, timeout_s, &taken, error);
  pthread_mutex_unlock(&self->scene->lock);
  if (status != CLT_OK) {
    return status;
  }
  expect_electrons(self, taken.exposure_s);
  form_samples(self, taken.sequence);
  *frame = (clt_frame){.width = self->width,
                       .height = self->height,
                       .channels = self->scene->description.channels,
                       .bits = self->scene->description.camera.bits,
                       .samples = self->samples,
                       .exposed_ns = taken.start_ns,
                       .exposure_s = taken.exposure_s,
                       .sequence = taken.sequence};
  return CLT_OK;
}

static void destroy(simulated_camera *self) {
  free(self->radiance);
  free(self->electrons);
  free(self->none);
  free(self->samples);
  free(self);
}

static void close_camera(clt_camera *camera) {
  simulated_camera *self = (simulated_camera *)camera;
  if (self != NULL) {
    pthread_mutex_lock(&self->scene->lock);
    self->scene->camera_open = false;
    pthread_mutex_unlock(&self->scene->lock);
    destroy(self);
  }
}

static const clt_camera_driver driver = {"simulated", describe, set_exposure, next, close_camera};

static simulated_camera *create(clt_scene *scene) {
  const clt_scene_description *description = &scene->description;
  simulated_camera *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return NULL;
  }
  self->base.driver = &driver;
  self->scene = scene;
  self->width = description->width * description->camera.cell_pixels;
  self->height = description->height * description->camera.cell_pixels;
  self->values = scene->timeline.values;
  self->shutter = (clt_shutter){.frame_ns = llround(description->camera.frame_s * 1e9),
                                .exposure_s = fmin(description->camera.frame_s, CLT_EXPOSURE_MAX_S),
                                .delay = description->camera.exposure_delay};
  self->radiance = clt_alloc(self->values, sizeof *self->radiance);
  self->electrons = clt_alloc(self->values, sizeof *self->electrons);
  self->none = clt_alloc(self->values, sizeof *self->none);
  self->samples =
      clt_alloc((size_t)self->width * (size_t)self->height * (size_t)description->channels, sizeof *self->samples);
  if (!self->radiance || !self->electrons || !self->none || !self->samples) {
    destroy(self);
    return NULL;
  }
  return self;
}

clt_status clt_scene_open_camera(clt_scene *scene, clt_camera **out, clt_error *error) {
  simulated_camera *self = create(scene);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the simulated camera's frames");
  }
  pthread_mutex_lock(&scene->lock);
  bool taken = scene->camera_open;
  scene->camera_open = true;
  self->shutter.start_ns = scene->now_ns;
  pthread_mutex_unlock(&scene->lock);
  if (taken) {
    destroy(self);
    return clt_fail(error, CLT_BAD_INPUT, "the scene's camera is already open; close it first");
  }
  *out = &self->base;
  return CLT_OK;
}
