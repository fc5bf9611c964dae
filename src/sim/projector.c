/* The simulated projector: quantises code values, turns them into drive and lights the room after its latency. */
#include <stdlib.h>

#include "base/memory.h"
#include "sim/noise.h"
#include "sim/state.h"

typedef struct simulated_projector {
  clt_projector base;
  clt_scene *scene;
  float *drive, *codes; /* channels * cells values of work space each */
} simulated_projector;

static void describe(const clt_projector *projector, clt_projector_info *info) {
  const clt_scene_description *description = &((const simulated_projector *)projector)->scene->description;
  *info = (clt_projector_info){.width = description->width,
                               .height = description->height,
                               .channels = description->channels,
                               .bits = description->projector.bits,
                               .refresh_s = description->projector.refresh_s};
}

/* The first refresh that starts after now. */
static int64_t next_refresh(int64_t now_ns, double refresh_s) {
  double number = floor((double)now_ns * 1e-9 / refresh_s);
  int64_t start_ns;
  do {
    number += 1.0;
    start_ns = llround(number * refresh_s * 1e9);
  } while (start_ns <= now_ns);
  return start_ns;
}

/* When the light of a picture that is shown at start_ns is there: never before that of the one before. */
static int64_t light_follows(clt_scene *scene, int64_t start_ns) {
  /* Keeps these numbers apart from the noise's and the faults'. */
  const uint64_t other_seeds = 1ull << 41;
  uint64_t key = clt_noise_key(scene->description.seed + other_seeds, scene->presented++);
  int64_t jitter_ns = llround((2.0 * clt_noise_uniform(key, 0) - 1.0) * (double)scene->jitter_ns);
  int64_t lit_ns = start_ns + scene->latency_ns + jitter_ns;
  lit_ns = lit_ns > start_ns ? lit_ns : start_ns;
  scene->lit_ns = lit_ns > scene->lit_ns ? lit_ns : scene->lit_ns;
  return scene->lit_ns;
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  simulated_projector *self = (simulated_projector *)projector;
  clt_scene *scene = self->scene;
  const clt_projector_description *panel = &scene->description.projector;
  size_t values = scene->timeline.values;
  float full = (float)((1 << panel->bits) - 1);
  for (size_t k = 0; k < values; k++) {
    float code = codes[k] > 0.0f ? codes[k] : 0.0f; /* NaN is dark */
    self->drive[k] = scene->drive_of_code[lroundf(full * (code < 1.0f ? code : 1.0f))];
  }
  pthread_mutex_lock(&scene->lock);
  int64_t start_ns = next_refresh(scene->now_ns, panel->refresh_s);
  clt_timeline_forget(&scene->timeline, scene->now_ns - llround(CLT_EXPOSURE_MAX_S * 1e9));
  clt_status status = clt_timeline_show(&scene->timeline, self->drive, light_follows(scene, start_ns), error);
  if (status == CLT_OK) {
    scene->now_ns = start_ns;
    *shown_ns = start_ns;
  }
  pthread_mutex_unlock(&scene->lock);
  return status;
}

static clt_status present_live(clt_projector *projector, const clt_live_picture *picture, int64_t *shown_ns,
                               clt_error *error) {
  simulated_projector *self = (simulated_projector *)projector;
  const clt_scene_description *description = &self->scene->description;
  clt_status status =
      clt_live_encode(picture, description->channels, description->height, description->width, self->codes, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_live_dither(self->codes, self->scene->timeline.values, description->projector.bits, picture->seed);
  return present(projector, self->codes, shown_ns, error);
}

static void destroy(simulated_projector *self) {
  free(self->drive);
  free(self->codes);
  free(self);
}

static void close_projector(clt_projector *projector) {
  simulated_projector *self = (simulated_projector *)projector;
  if (self != NULL) {
    pthread_mutex_lock(&self->scene->lock);
    self->scene->projector_open = false;
    pthread_mutex_unlock(&self->scene->lock);
    destroy(self);
  }
}

static const clt_projector_driver driver = {
    .name = "simulated",
    .describe = describe,
    .present = present,
    .close = close_projector,
    .present_live = present_live,
};

static simulated_projector *create(clt_scene *scene) {
  simulated_projector *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return NULL;
  }
  self->base.driver = &driver;
  self->scene = scene;
  self->drive = clt_alloc(scene->timeline.values, sizeof(float));
  self->codes = clt_alloc(scene->timeline.values, sizeof(float));
  if (self->drive == NULL || self->codes == NULL) {
    destroy(self);
    return NULL;
  }
  return self;
}

clt_status clt_scene_open_projector(clt_scene *scene, clt_projector **out, clt_error *error) {
  simulated_projector *self = create(scene);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the simulated projector");
  }
  pthread_mutex_lock(&scene->lock);
  bool taken = scene->projector_open;
  scene->projector_open = true;
  pthread_mutex_unlock(&scene->lock);
  if (taken) {
    destroy(self);
    return clt_fail(error, CLT_BAD_INPUT, "the scene's projector is already open; close it first");
  }
  *out = &self->base;
  return CLT_OK;
}
