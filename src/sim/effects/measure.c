/* What each stage of a scene takes of a frame: it runs a few times on buffers of its own, and the shortest time counts.
 */
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"
#include "sim/state.h"

enum { RUNS = 3, SAMPLES = 1 << 10 };

/* Buffers as large as a frame of the camera's pixels, or as the cells where those are more. */
typedef struct bench {
  clt_scene *scene;
  size_t values, samples; /* of the cells, in all layers; of a frame */
  float *cells, *radiance, *scratch;
  double *electrons, *none;
  clt_exposure exposure;
  clt_band *bands;
  int band_count;
  clt_signal signal;
} bench;

static void finish(bench *b) {
  free(b->cells);
  free(b->radiance);
  free(b->scratch);
  free(b->electrons);
  free(b->none);
  free(b->bands);
}

static void lay_out(bench *b) {
  const clt_scene_description *description = &b->scene->description;
  int channels = description->channels, split = b->scene->plan.per_row ? description->camera.cell_pixels : 1;
  bool pixels = b->scene->plan.per_pixel;
  b->exposure = (clt_exposure){.width = description->width,
                               .height = description->height * split,
                               .channels = channels,
                               .split = split,
                               .radiance = b->radiance,
                               .scratch = b->scratch};
  b->signal = (clt_signal){.width = pixels ? description->camera.width : description->width,
                           .height = pixels ? description->camera.height : description->height * split,
                           .channels = channels,
                           .radiance = b->radiance,
                           .scratch = b->scratch,
                           .electrons = b->electrons,
                           .none = b->none};
  b->band_count = b->scene->plan.per_row ? description->camera.height : 1;
}

/* Bands that together cover the cells, or each of them all cells where pixels see cells from anywhere. */
static void lay_out_bands(bench *b) {
  bool own = b->scene->description.camera.own_pixels;
  int rows = own ? b->exposure.height : b->exposure.height / b->band_count;
  for (int k = 0; k < b->band_count; k++) {
    int first = own ? 0 : k * rows;
    b->bands[k] = (clt_band){.first = first, .last = first + rows, .start_ns = 0, .end_ns = 16666667};
  }
}

static clt_status init(clt_scene *scene, bench *b, clt_error *error) {
  const clt_scene_description *description = &scene->description;
  size_t pixels = (size_t)description->camera.width * (size_t)description->camera.height;
  *b = (bench){.scene = scene,
               .values = scene->plan.values * (size_t)scene->plan.layers,
               .samples = pixels * (size_t)description->channels};
  size_t most = b->samples > b->values ? b->samples : b->values;
  b->cells = clt_alloc(2 * b->values, sizeof *b->cells);
  b->radiance = clt_alloc(most, sizeof *b->radiance);
  b->scratch = clt_alloc(2 * most, sizeof *b->scratch);
  b->electrons = clt_alloc(b->samples, sizeof *b->electrons);
  b->none = clt_alloc(b->samples, sizeof *b->none);
  b->bands = clt_alloc((size_t)description->camera.height, sizeof *b->bands);
  if (!b->cells || !b->radiance || !b->scratch || !b->electrons || !b->none || !b->bands) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory for measuring the scene's effects", description->path);
  }
  lay_out(b);
  lay_out_bands(b);
  return CLT_OK;
}

/* A frame of half light, as every stage finds one. */
static void fill(bench *b) {
  for (size_t k = 0; k < b->values; k++) {
    b->cells[k] = 0.5f;
  }
  for (size_t k = 0; k < b->samples; k++) {
    b->radiance[k] = (float)(0.5 * b->scene->brightest);
    b->electrons[k] = 0.5 * b->scene->description.camera.full_well;
  }
}

static void take_samples(const bench *b, const clt_stage *stage) {
  double values[SAMPLES], none[SAMPLES];
  for (size_t first = 0; first < b->samples; first += SAMPLES) {
    int count = (int)(first + SAMPLES < b->samples ? SAMPLES : b->samples - first);
    for (int k = 0; k < count; k++) {
      values[k] = b->electrons[first + (size_t)k];
      none[k] = 0.0;
    }
    clt_row row = {.first = first, .count = count, .values = values, .none = none};
    stage->effect->samples(stage->state, &row);
  }
}

static void run_once(bench *b, const clt_stage *stage) {
  const clt_effect *effect = stage->effect;
  if (effect->drive != NULL) {
    effect->drive(stage->state, b->cells, b->scratch);
  }
  if (effect->light != NULL) {
    effect->light(stage->state, b->cells, b->cells + b->values);
  }
  for (int layer = 0; layer < b->scene->plan.layers; layer++) {
    if (effect->radiance != NULL) {
      effect->radiance(stage->state, b->cells, b->scratch);
    }
    for (int k = 0; k < b->band_count && effect->expose != NULL; k++) {
      effect->expose(stage->state, &b->exposure, &b->bands[k]);
    }
  }
  if (effect->signal != NULL) {
    effect->signal(stage->state, &b->signal);
  }
  if (effect->electrons != NULL) {
    effect->electrons(stage->state, &b->signal);
  }
  if (effect->samples != NULL) {
    take_samples(b, stage);
  }
}

/* Whether it does anything while frames are made; the others did their work in preparation. */
static bool runs(const clt_effect *effect) {
  return effect->drive || effect->light || effect->radiance || effect->expose || effect->signal || effect->electrons ||
         effect->samples;
}

static double shortest_ms(bench *b, const clt_stage *stage) {
  double shortest = INFINITY;
  for (int n = 0; n < RUNS; n++) {
    fill(b);
    int64_t start_ns = clt_clock_ns();
    run_once(b, stage);
    shortest = fmin(shortest, 1e3 * clt_clock_since(start_ns));
  }
  return shortest;
}

static const clt_stage *stage_of(const clt_plan *plan, const clt_effect *effect) {
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect == effect) {
      return &plan->stages[k];
    }
  }
  return NULL;
}

clt_status clt_scene_effects(clt_scene *scene, clt_effect_report reports[CLT_EFFECTS], clt_error *error) {
  bench b;
  clt_status status = init(scene, &b, error);
  for (int k = 0; k < CLT_EFFECTS && status == CLT_OK; k++) {
    const clt_effect *effect = clt_effects[k];
    const clt_stage *stage = stage_of(&scene->plan, effect);
    reports[k] = (clt_effect_report){.name = effect->name, .on = stage != NULL};
    if (effect->called_for != NULL) {
      effect->called_for(scene, reports[k].why);
    } else {
      snprintf(reports[k].why, sizeof reports[k].why, "this version does not simulate it");
    }
    if (stage != NULL) {
      reports[k].prepare_ms = stage->prepare_ms;
      reports[k].bytes = stage->bytes;
      reports[k].frame_ms = runs(effect) ? shortest_ms(&b, stage) : 0.0;
    }
  }
  finish(&b);
  return status;
}
