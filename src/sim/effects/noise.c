/* The camera's noise: electrons come by chance, and reading them out adds some. */
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "sim/noise.h"
#include "sim/state.h"

typedef struct noise {
  bool photons;
  double read_noise; /* electrons rms */
} noise;

static bool called_for(const clt_scene *scene, char *why) {
  const clt_camera_description *sensor = &scene->description.camera;
  bool on = sensor->photon_noise || sensor->read_noise > 0.0;
  if (on) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "%s; reading a pixel adds %.4g electrons rms",
             sensor->photon_noise ? "photons arrive by chance" : "photon noise is switched off", sensor->read_noise);
  } else {
    snprintf(why, CLT_EFFECT_WHY_MAX, "photon noise is switched off and reading adds none");
  }
  return on;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  noise *state = clt_alloc(1, sizeof *state);
  stage->state = state;
  if (state == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
  }
  *state = (noise){scene->description.camera.photon_noise, scene->description.camera.read_noise};
  stage->bytes = sizeof *state + scene->plan.values * sizeof(double);
  return CLT_OK;
}

static void electrons(const void *state, clt_signal *signal) {
  const noise *self = state;
  size_t values = (size_t)signal->width * (size_t)signal->height * (size_t)signal->channels;
  for (size_t k = 0; k < values && self->photons; k++) {
    signal->none[k] = clt_noise_none(signal->electrons[k]);
  }
}

static void samples(const void *state, clt_row *row) {
  const noise *self = state;
  for (int k = 0; k < row->count; k++) {
    size_t sample = row->first + (size_t)k;
    row->values[k] =
        self->photons ? clt_noise_electrons(row->key, sample, row->values[k], row->none[k], self->read_noise)
                      : row->values[k] + self->read_noise * clt_noise_normal(clt_noise_uniform(row->key, 2 * sample));
  }
}

const clt_effect clt_effect_noise = {.name = "noise",
                                     .called_for = called_for,
                                     .prepare = prepare,
                                     .finish = free,
                                     .electrons = electrons,
                                     .samples = samples};
