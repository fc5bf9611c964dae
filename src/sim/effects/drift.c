/* The lamp's brightness changes slowly: 1 + per_hour * hours + amplitude sin(2 pi t / period), not below 0, from the
 * opening of the scene. It acts on all light of the projector, its leak included. */
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "sim/effects/sine.h"
#include "sim/state.h"

typedef struct drift {
  clt_drift_description law;
  float unlit[]; /* channels * cells: radiance that does not come from the projector */
} drift;

static void read(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(clt_section_group(root, "projector"), "drift");
  description->effects.drift = (clt_drift_description){
      .per_hour = clt_read_number(section, "per_hour", 0.0, -1.0, 1.0),
      .amplitude = clt_read_number(section, "amplitude", 0.0, 0.0, 0.5),
      .period_s = clt_read_number(section, "period_s", 600.0, 10.0, 1e6),
  };
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_drift_description *law = &scene->description.effects.drift;
  bool on = law->per_hour != 0.0 || law->amplitude > 0.0;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           on ? "the lamp changes by %.4g %% an hour and swings by %.4g %% every %.4g s"
              : "the lamp keeps its brightness",
           100.0 * law->per_hour, 100.0 * law->amplitude, law->period_s);
  return on;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  size_t bytes = sizeof(drift) + scene->plan.values * sizeof(float);
  size_t cells = scene->plan.values / (size_t)scene->description.channels;
  drift *state = clt_alloc(1, bytes);
  stage->state = state;
  if (state == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
  }
  stage->bytes = bytes;
  state->law = scene->description.effects.drift;
  for (int c = 0; c < scene->description.channels; c++) {
    const float *black = clt_transport_black(scene->transport, c); /* the transport's own: nothing was added yet */
    for (size_t i = 0; i < cells; i++) {
      state->unlit[(size_t)c * cells + i] = black[i] + (float)scene->description.ambient[c];
    }
  }
  return CLT_OK;
}

static void expose(const void *state, clt_exposure *exposure, const clt_band *band) {
  const drift *self = state;
  double hours = 0.5e-9 * ((double)band->start_ns + (double)band->end_ns) / 3600.0;
  float gain = (float)fmax(0.0, 1.0 + self->law.per_hour * hours +
                                    self->law.amplitude * clt_sine_mean(1.0 / self->law.period_s, band));
  int cell_rows = exposure->height / exposure->split;
  for (int c = 0; c < exposure->channels; c++) {
    for (int y = band->first; y < band->last; y++) {
      const float *unlit = &self->unlit[(size_t)(c * cell_rows + y / exposure->split) * (size_t)exposure->width];
      float *row = clt_exposure_row(exposure, c, y);
      for (int x = 0; x < exposure->width; x++) {
        row[x] = unlit[x] + gain * (row[x] - unlit[x]);
      }
    }
  }
}

const clt_effect clt_effect_drift = {
    .name = "drift", .read = read, .called_for = called_for, .prepare = prepare, .finish = free, .expose = expose};
