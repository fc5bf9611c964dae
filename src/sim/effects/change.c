/* A region is repainted while the scene is in use: from then on its cells send out another share of the light. What
 * they send to other cells stays as it was. */
#include <stdio.h>

#include "sim/scene_file.h"
#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(root, "change");
  clt_change_description *change = &description->effects.change;
  double cells[4] = {0.0, 0.0, 0.0, 0.0};
  change->at_s = clt_read_number(section, "at_s", 0.0, 0.0, 1e7);
  clt_scene_read_channels(section, "factor", description->channels, 1.0, 0.0, 10.0, change->factor);
  bool given = clt_read_numbers(section, "cells", cells, 4, 4, 0.0, CLT_GRID_SIDE_MAX) == 4;
  if (given && (cells[0] + cells[2] > description->width || cells[1] + cells[3] > description->height)) {
    clt_section_fail(section, "cells", "reach beyond the grid of %d x %d; give [left, top, width, height] inside it",
                     description->width, description->height);
  } else if (!given && section.group != NULL) {
    clt_section_fail(section, "cells", "a change needs cells = [left, top, width, height]");
  }
  change->left = (int)cells[0];
  change->top = (int)cells[1];
  change->width = (int)cells[2];
  change->height = (int)cells[3];
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_change_description *change = &scene->description.effects.change;
  bool on = false;
  for (int c = 0; c < scene->description.channels; c++) {
    on = on || (change->factor[c] != 1.0 && change->width > 0 && change->height > 0);
  }
  snprintf(why, CLT_EFFECT_WHY_MAX, on ? "%d x %d cells are repainted %.6g s after the start" : "nothing is repainted",
           change->width, change->height, change->at_s);
  return on;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)error;
  stage->state = &scene->description.effects.change;
  return CLT_OK;
}

static void expose(const void *state, clt_exposure *exposure, const clt_band *band) {
  const clt_change_description *change = state;
  double after = ((double)band->end_ns - 1e9 * change->at_s) / (double)(band->end_ns - band->start_ns);
  double share = fmin(fmax(after, 0.0), 1.0);
  for (int c = 0; c < exposure->channels && share > 0.0; c++) {
    float factor = (float)(1.0 + share * (change->factor[c] - 1.0));
    for (int y = band->first; y < band->last; y++) {
      int below_top = y / exposure->split - change->top;
      float *row = clt_exposure_row(exposure, c, y) + change->left;
      for (int x = 0; x < change->width && below_top >= 0 && below_top < change->height; x++) {
        row[x] *= factor;
      }
    }
  }
}

const clt_effect clt_effect_change = {
    .name = "change", .read = read, .called_for = called_for, .prepare = prepare, .expose = expose};
