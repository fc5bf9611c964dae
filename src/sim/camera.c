/* The simulated camera: integrates the room's light over its exposure and forms frames as a sensor does. */
#include <stdlib.h>

#include "base/memory.h"
#include "sim/noise.h"
#include "sim/shutter.h"
#include "sim/state.h"

/* Samples of a frame that one thread forms sooner than several have met on a busy machine. */
enum { FEW_SAMPLES = 1 << 16 };
/* Pixels that are taken through the stages of the sensor together. */
enum { RUN = 256 };

typedef struct simulated_camera {
  clt_camera base;
  clt_scene *scene;
  clt_shutter shutter;
  int width, height; /* of a frame */
  int bands;
  clt_band *band;        /* one, or one for each row of pixels */
  clt_exposure exposure; /* its channels stand there once for each layer */
  clt_signal signal;     /* its radiance is the exposure's where nothing tells the pixels of a cell apart */
  uint16_t *samples;
  bool delivered;  /* samples hold a frame */
  bool gone;       /* it was unplugged since it was opened */
  int64_t seen_ns; /* until when that is known */
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
                            .read_noise = sensor->read_noise,
                            .own_pixels = sensor->own_pixels};
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

/* The exposure, for every pixel of a cell. */
static void spread_over_pixels(simulated_camera *self) {
  const clt_exposure *from = &self->exposure;
  clt_signal *to = &self->signal;
  int across = to->width / from->width, down = to->height / from->height;
  for (int k = 0; k < to->channels * to->height; k++) {
    const float *cells = &from->radiance[(size_t)(k / down) * (size_t)from->width];
    float *pixels = &to->radiance[(size_t)k * (size_t)to->width];
    for (int x = 0; x < to->width; x++) {
      pixels[x] = cells[x / across];
    }
  }
}

/* Electrons of a fully exposed pixel are full_well; a negative radiance (of a measured transport) frees none, nor does
 * any in the lowest rows, a share `dark` of them. */
static void expect_electrons(simulated_camera *self, double exposure_s, double dark) {
  const clt_camera_description *sensor = &self->scene->description.camera;
  clt_signal *signal = &self->signal;
  double gain = self->scene->responsivity * exposure_s * sensor->full_well;
  size_t values = (size_t)signal->width * (size_t)signal->height * (size_t)signal->channels;
  if (signal->radiance != self->exposure.radiance && !sensor->own_pixels) {
    spread_over_pixels(self);
  }
  clt_plan_signal(&self->scene->plan, signal);
  for (size_t k = 0; k < values; k++) {
    bool lit = (int)(k / (size_t)signal->width) % signal->height < (1.0 - dark) * signal->height;
    signal->electrons[k] = lit ? fmax(0.0, gain * (double)signal->radiance[k]) : 0.0;
  }
  clt_plan_electrons(&self->scene->plan, signal);
}

/* Samples of pixels x <= pixel < end of row y. */
static void form_run(simulated_camera *self, uint64_t key, int y, int x, int end) {
  const clt_signal *signal = &self->signal;
  double values[RUN * CLT_SIM_CHANNELS_MAX], none[RUN * CLT_SIM_CHANNELS_MAX];
  int channels = signal->channels, across = self->width / signal->width, down = self->height / signal->height;
  clt_row row = {.key = key,
                 .first = ((size_t)y * (size_t)self->width + (size_t)x) * (size_t)channels,
                 .count = (end - x) * channels,
                 .values = values,
                 .none = signal->none != NULL ? none : NULL};
  for (int c = 0; c < channels; c++) {
    size_t line = ((size_t)c * (size_t)signal->height + (size_t)(y / down)) * (size_t)signal->width;
    for (int k = 0; k < end - x; k++) {
      size_t from = line + (size_t)((x + k) / across);
      values[k * channels + c] = signal->electrons[from];
      none[k * channels + c] = signal->none != NULL ? signal->none[from] : 0.0;
    }
  }
  clt_plan_samples(&self->scene->plan, &row);
  for (int k = 0; k < row.count; k++) {
    self->samples[row.first + (size_t)k] = (uint16_t)values[k];
  }
}

static void form_samples(simulated_camera *self, uint32_t sequence) {
  uint64_t key = clt_noise_key(self->scene->description.seed, sequence);
#pragma omp parallel for schedule(static) if (self->width * self->height * self->signal.channels > FEW_SAMPLES)
  for (int y = 0; y < self->height; y++) {
    for (int x = 0; x < self->width; x += RUN) {
      form_run(self, key, y, x, x + RUN < self->width ? x + RUN : self->width);
    }
  }
}

/* Rows of pixels that see cells from anywhere in the picture: every cell's light over their time. */
static void form_rows(simulated_camera *self, const clt_band *band, int first, int last) {
  clt_scene *scene = self->scene;
  clt_exposure layer = self->exposure;
  layer.channels = scene->description.channels;
  clt_timeline_expose(&scene->timeline, band, &self->exposure);
  for (int k = 0; k < scene->plan.layers; k++) {
    clt_plan_expose(&scene->plan, &layer, band, 1);
    layer.radiance += scene->plan.values;
  }
  clt_view_form(&scene->view, self->exposure.radiance, first, last, &self->signal);
}

/* The light of a frame, row by row where the shutter rolls. Returns when the last row ends. */
static int64_t collect_light(simulated_camera *self, const clt_shutter *taken) {
  clt_scene *scene = self->scene;
  bool own = scene->description.camera.own_pixels;
  int rows = self->exposure.height / self->bands, pixels = self->height / self->bands;
  for (int b = 0; b < self->bands; b++) {
    int64_t start_ns = taken->start_ns + b * scene->line_ns;
    self->band[b] = (clt_band){.first = own ? 0 : b * rows,
                               .last = own ? self->exposure.height : (b + 1) * rows,
                               .start_ns = start_ns,
                               .end_ns = start_ns + clt_shutter_exposure_ns(taken)};
    if (own) {
      form_rows(self, &self->band[b], b * pixels, (b + 1) * pixels);
    } else {
      clt_timeline_expose(&scene->timeline, &self->band[b], &self->exposure);
    }
  }
  if (!own) {
    clt_plan_expose(&scene->plan, &self->exposure, self->band, self->bands);
  }
  return self->band[self->bands - 1].end_ns;
}

/* A camera that was unplugged has to be opened again, also where it is back. Under the scene's lock. */
static clt_status stay_plugged(simulated_camera *self, int64_t until_ns, clt_error *error) {
  self->gone = self->gone || clt_plan_away(&self->scene->plan, self->seen_ns, until_ns);
  self->seen_ns = until_ns > self->seen_ns ? until_ns : self->seen_ns;
  return self->gone ? clt_fail(error, CLT_GONE, "the simulated camera was unplugged") : CLT_OK;
}

/* Takes the next wanted frame off the clock into `taken` and collects its light; under the scene's lock. */
static clt_status expose(simulated_camera *self, int64_t not_before_ns, double timeout_s, clt_shutter *taken,
                         clt_fate *fate, clt_error *error) {
  clt_scene *scene = self->scene;
  clt_status status = stay_plugged(self, scene->now_ns, error);
  if (status != CLT_OK) {
    return status;
  }
  *taken = self->shutter;
  double wait_s = ((double)not_before_ns - (double)scene->now_ns) * 1e-9;
  if (wait_s <= timeout_s) {
    clt_shutter_advance(taken, not_before_ns, scene->now_ns);
    while ((*fate = clt_plan_frame(&scene->plan, taken->sequence)).dropped) {
      clt_shutter_step(taken);
    }
    wait_s = (double)(taken->start_ns - scene->now_ns) * 1e-9;
  }
  if (wait_s > timeout_s) {
    scene->now_ns += llround(fmax(timeout_s, 0.0) * 1e9);
    return clt_fail(error, CLT_TIMEOUT, "the simulated camera's next wanted frame starts in %.3g s, after %.3g s",
                    wait_s, timeout_s);
  }
  int64_t end_ns = collect_light(self, taken) + fate->late_ns;
  status = stay_plugged(self, end_ns, error);
  if (status != CLT_OK) {
    scene->now_ns = taken->start_ns > scene->now_ns ? taken->start_ns : scene->now_ns;
    return status;
  }
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
  clt_fate fate = {0};
  pthread_mutex_lock(&self->scene->lock);
  clt_status status = expose(self, not_before_ns, timeout_s, &taken, &fate, error);
  pthread_mutex_unlock(&self->scene->lock);
  if (status != CLT_OK) {
    return status;
  }
  if (!fate.stuck || !self->delivered) {
    expect_electrons(self, taken.exposure_s, fate.dark);
    form_samples(self, taken.sequence);
    self->delivered = true;
  }
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
  if (self->signal.radiance != self->exposure.radiance) {
    free(self->signal.radiance);
  }
  free(self->exposure.radiance);
  free(self->exposure.scratch);
  free(self->signal.scratch);
  free(self->signal.electrons);
  free(self->signal.none);
  free(self->band);
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

/* Buffers as coarse as the scene's effects allow, and those that its effects ask for; false where memory is short. */
static bool make_buffers(simulated_camera *self) {
  const clt_scene_description *description = &self->scene->description;
  const clt_plan *plan = &self->scene->plan;
  int pixels = description->camera.cell_pixels, split = plan->per_row ? pixels : 1, channels = description->channels;
  clt_exposure *exposure = &self->exposure;
  clt_signal *signal = &self->signal;
  *exposure = (clt_exposure){.width = description->width,
                             .height = description->height * split,
                             .channels = channels * plan->layers,
                             .split = split};
  *signal = (clt_signal){.width = plan->per_pixel ? self->width : exposure->width,
                         .height = plan->per_pixel ? self->height : exposure->height,
                         .channels = channels};
  size_t cells = (size_t)exposure->width * (size_t)exposure->height * (size_t)exposure->channels;
  size_t values = (size_t)signal->width * (size_t)signal->height * (size_t)channels;
  bool exposes = clt_plan_any(plan, clt_effect_has_expose), signals = clt_plan_any(plan, clt_effect_has_signal);
  bool counts = clt_plan_any(plan, clt_effect_has_electrons);
  self->bands = plan->per_row ? self->height : 1;
  self->band = clt_alloc((size_t)self->bands, sizeof *self->band);
  exposure->radiance = clt_alloc(cells, sizeof *exposure->radiance);
  exposure->scratch = exposes ? clt_alloc(cells, sizeof *exposure->scratch) : NULL;
  signal->radiance = plan->per_pixel ? clt_alloc(values, sizeof *signal->radiance) : exposure->radiance;
  signal->scratch = signals ? clt_alloc(values, sizeof *signal->scratch) : NULL;
  signal->electrons = clt_alloc(values, sizeof *signal->electrons);
  signal->none = counts ? clt_alloc(values, sizeof *signal->none) : NULL;
  self->samples = clt_alloc((size_t)self->width * (size_t)self->height * (size_t)channels, sizeof *self->samples);
  return self->band && exposure->radiance && (exposure->scratch || !exposes) && signal->radiance &&
         (signal->scratch || !signals) && signal->electrons && (signal->none || !counts) && self->samples;
}

static simulated_camera *create(clt_scene *scene) {
  const clt_scene_description *description = &scene->description;
  simulated_camera *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return NULL;
  }
  self->base.driver = &driver;
  self->scene = scene;
  self->width = description->camera.width;
  self->height = description->camera.height;
  self->shutter = (clt_shutter){.frame_ns = llround(description->camera.frame_s * 1e9),
                                .exposure_s = fmin(description->camera.frame_s, CLT_EXPOSURE_MAX_S),
                                .delay = scene->exposure_delay};
  if (!make_buffers(self)) {
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
  bool taken = scene->camera_open, away = clt_plan_away(&scene->plan, scene->now_ns, scene->now_ns);
  scene->camera_open = taken || !away;
  self->shutter.start_ns = self->seen_ns = scene->now_ns;
  pthread_mutex_unlock(&scene->lock);
  if (taken || away) {
    destroy(self);
    return taken ? clt_fail(error, CLT_BAD_INPUT, "the scene's camera is already open; close it first")
                 : clt_fail(error, CLT_GONE, "the simulated camera is unplugged");
  }
  *out = &self->base;
  return CLT_OK;
}
