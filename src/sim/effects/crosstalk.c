/* A panel's colours leak into each other: a 3 x 3 matrix takes drive of the panel to light of the channels. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/state.h"

typedef struct crosstalk {
  size_t cells;
  double matrix[CLT_SIM_CHANNELS_MAX][CLT_SIM_CHANNELS_MAX];
} crosstalk;

static void read(clt_section root, clt_scene_description *description) {
  clt_section projector = clt_section_group(root, "projector");
  double values[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  if (clt_read_numbers(projector, "crosstalk", values, 9, 9, 0.0, 2.0) > 0 && description->channels != 3) {
    clt_section_fail(projector, "crosstalk", "needs 3 channels, and the grid has %d; leave it out",
                     description->channels);
  }
  memcpy(description->effects.crosstalk, values, sizeof values);
}

static bool called_for(const clt_scene *scene, char *why) {
  double most = 0.0;
  bool identity = true;
  for (int c = 0; c < 3; c++) {
    for (int k = 0; k < 3; k++) {
      double value = scene->description.effects.crosstalk[c][k];
      most = fmax(most, c != k ? value : 0.0);
      identity = identity && value == (c == k);
    }
  }
  snprintf(why, CLT_EFFECT_WHY_MAX,
           identity ? "the panel's colours do not leak into each other"
                    : "the panel's colours leak into each other, by up to %.4g of full drive",
           most);
  return !identity;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  crosstalk *state = clt_alloc(1, sizeof *state);
  stage->state = state;
  if (state == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
  }
  state->cells = scene->plan.values / CLT_SIM_CHANNELS_MAX;
  memcpy(state->matrix, scene->description.effects.crosstalk, sizeof state->matrix);
  for (int c = 0; c < CLT_SIM_CHANNELS_MAX; c++) {
    scene->full_drive[c] = state->matrix[c][0] + state->matrix[c][1] + state->matrix[c][2];
  }
  stage->bytes = sizeof *state;
  return CLT_OK;
}

static void drive(const void *state, float *values, float *scratch) {
  const crosstalk *self = state;
  size_t cells = self->cells;
  memcpy(scratch, values, CLT_SIM_CHANNELS_MAX * cells * sizeof *values);
  for (size_t c = 0; c < CLT_SIM_CHANNELS_MAX; c++) {
    const double *row = self->matrix[c];
    for (size_t j = 0; j < cells; j++) {
      values[c * cells + j] = (float)(row[0] * (double)scratch[j] + row[1] * (double)scratch[cells + j] +
                                      row[2] * (double)scratch[2 * cells + j]);
    }
  }
}

const clt_effect clt_effect_crosstalk = {
    .name = "crosstalk", .read = read, .called_for = called_for, .prepare = prepare, .finish = free, .drive = drive};
