#include "sim/effects/plan.h"

#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "sim/state.h"

void clt_effects_read(clt_section root, clt_scene_description *description) {
  for (int k = 0; k < CLT_EFFECTS; k++) {
    if (clt_effects[k]->read != NULL) {
      clt_effects[k]->read(root, description);
    }
  }
}

clt_status clt_effect_lend_description(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)error;
  stage->state = &scene->description;
  return CLT_OK;
}

bool clt_effect_has_expose(const clt_effect *effect) {
  return effect->expose != NULL;
}

bool clt_effect_has_signal(const clt_effect *effect) {
  return effect->signal != NULL;
}

bool clt_effect_has_electrons(const clt_effect *effect) {
  return effect->electrons != NULL;
}

static bool has_light(const clt_effect *effect) {
  return effect->light != NULL;
}

static bool changes_light(const clt_effect *effect) {
  return effect->drive != NULL || effect->radiance != NULL;
}

static bool tells_rows_apart(const clt_effect *effect) {
  return effect->per_row;
}

static bool tells_pixels_apart(const clt_effect *effect) {
  return effect->per_pixel;
}

bool clt_plan_any(const clt_plan *plan, bool (*has)(const clt_effect *effect)) {
  for (int k = 0; k < plan->count; k++) {
    if (has(plan->stages[k].effect)) {
      return true;
    }
  }
  return false;
}

static clt_status out_of_memory(const clt_scene *scene, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s: out of memory for the scene's effects", scene->description.path);
}

static clt_status take_diagonal(clt_scene *scene, clt_error *error) {
  clt_plan *plan = &scene->plan;
  int channels = scene->description.channels;
  size_t cells = plan->values / (size_t)channels;
  double *diagonal = clt_alloc(cells, sizeof *diagonal);
  plan->diagonal = clt_alloc(plan->values, sizeof *plan->diagonal);
  if (diagonal == NULL || plan->diagonal == NULL) {
    free(diagonal);
    return out_of_memory(scene, error);
  }
  for (int c = 0; c < channels; c++) {
    clt_transport_diagonal(scene->transport, c, diagonal);
    for (size_t i = 0; i < cells; i++) {
      plan->diagonal[(size_t)c * cells + i] = (float)diagonal[i];
    }
  }
  free(diagonal);
  return CLT_OK;
}

static clt_status add_stage(clt_scene *scene, const clt_effect *effect, clt_error *error) {
  clt_stage *stage = &scene->plan.stages[scene->plan.count++];
  int64_t start_ns = clt_clock_ns();
  stage->effect = effect;
  clt_status status = effect->prepare != NULL ? effect->prepare(scene, stage, error) : CLT_OK;
  stage->prepare_ms += 1e3 * clt_clock_since(start_ns);
  return status;
}

clt_status clt_plan_compile(clt_scene *scene, clt_error *error) {
  clt_plan *plan = &scene->plan;
  const clt_scene_description *description = &scene->description;
  clt_status status = CLT_OK;
  plan->values = (size_t)description->width * (size_t)description->height * (size_t)description->channels;
  for (int k = 0; k < CLT_EFFECTS && status == CLT_OK; k++) {
    char why[CLT_EFFECT_WHY_MAX];
    if (clt_effects[k]->called_for != NULL && clt_effects[k]->called_for(scene, why)) {
      status = add_stage(scene, clt_effects[k], error);
    }
  }
  if (status == CLT_OK && !clt_plan_any(plan, has_light)) {
    status = take_diagonal(scene, error);
  }
  if (status == CLT_OK && clt_plan_any(plan, changes_light)) {
    plan->work = clt_alloc(3 * plan->values, sizeof *plan->work);
    if (plan->work == NULL) {
      return out_of_memory(scene, error);
    }
    plan->scratch = plan->work + plan->values;
  }
  plan->per_row = clt_plan_any(plan, tells_rows_apart);
  plan->per_pixel = description->camera.own_pixels || clt_plan_any(plan, tells_pixels_apart);
  plan->layers = description->camera.own_pixels ? CLT_VIEW_LAYERS : 1;
  return status;
}

void clt_plan_finish(clt_plan *plan) {
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->finish != NULL) {
      plan->stages[k].effect->finish(plan->stages[k].state);
    }
  }
  free(plan->diagonal);
  free(plan->work);
  *plan = (clt_plan){0};
}

void clt_plan_drive(const clt_plan *plan, float *drive, float *scratch) {
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->drive != NULL) {
      plan->stages[k].effect->drive(plan->stages[k].state, drive, scratch);
    }
  }
}

void clt_plan_radiance(const clt_plan *plan, float *radiance, float *scratch) {
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->radiance != NULL) {
      plan->stages[k].effect->radiance(plan->stages[k].state, radiance, scratch);
    }
  }
}

/* radiance = b0 + diag(T) drive */
static void light_directly(const clt_scene *scene, const float *drive, float *radiance) {
  size_t cells = scene->plan.values / (size_t)scene->description.channels;
  for (int c = 0; c < scene->description.channels; c++) {
    const float *black = clt_transport_black(scene->transport, c);
    for (size_t i = 0; i < cells; i++) {
      size_t k = (size_t)c * cells + i;
      radiance[k] = (float)((double)black[i] + (double)drive[k] * (double)scene->plan.diagonal[k]);
    }
  }
}

void clt_plan_light(void *context, const float *drive, float *radiance) {
  clt_scene *scene = context;
  clt_plan *plan = &scene->plan;
  if (plan->work != NULL) {
    memcpy(plan->work, drive, plan->values * sizeof *drive);
    clt_plan_drive(plan, plan->work, plan->scratch);
    drive = plan->work;
  }
  if (plan->diagonal != NULL) {
    light_directly(scene, drive, radiance);
  }
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->light != NULL) {
      plan->stages[k].effect->light(plan->stages[k].state, drive, radiance);
    }
  }
  if (plan->layers == CLT_VIEW_LAYERS) {
    clt_view_add_indirect(&scene->view, drive, radiance);
  }
  for (int layer = 0; layer < plan->layers; layer++) {
    clt_plan_radiance(plan, radiance + (size_t)layer * plan->values, plan->scratch);
  }
}

bool clt_plan_away(const clt_plan *plan, int64_t from_ns, int64_t to_ns) {
  bool away = false;
  for (int k = 0; k < plan->count && !away; k++) {
    away = plan->stages[k].effect->away != NULL && plan->stages[k].effect->away(plan->stages[k].state, from_ns, to_ns);
  }
  return away;
}

clt_fate clt_plan_frame(const clt_plan *plan, uint32_t sequence) {
  clt_fate fate = {0};
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->frame != NULL) {
      plan->stages[k].effect->frame(plan->stages[k].state, sequence, &fate);
    }
  }
  return fate;
}

void clt_plan_expose(const clt_plan *plan, clt_exposure *exposure, const clt_band *bands, int count) {
  for (int k = 0; k < plan->count; k++) {
    for (int b = 0; b < count && plan->stages[k].effect->expose != NULL; b++) {
      plan->stages[k].effect->expose(plan->stages[k].state, exposure, &bands[b]);
    }
  }
}

void clt_plan_signal(const clt_plan *plan, clt_signal *signal) {
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->signal != NULL) {
      plan->stages[k].effect->signal(plan->stages[k].state, signal);
    }
  }
}

void clt_plan_electrons(const clt_plan *plan, clt_signal *signal) {
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->electrons != NULL) {
      plan->stages[k].effect->electrons(plan->stages[k].state, signal);
    }
  }
}

void clt_plan_samples(const clt_plan *plan, clt_row *row) {
  for (int k = 0; k < plan->count; k++) {
    if (plan->stages[k].effect->samples != NULL) {
      plan->stages[k].effect->samples(plan->stages[k].state, row);
    }
  }
}
