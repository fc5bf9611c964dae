/* A region is repainted while the scene is in use, for good or for a while, or something that is darker or brighter
 * passes in front of it: its cells then send out another share of the light. What they send to other cells stays as it
 * was. */
#include <stdio.h>

#include "sim/scene_file.h"
#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(root, "change");
  clt_change_description *change = &description->effects.change;
  double cells[4] = {0.0, 0.0, 0.0, 0.0};
  change->at_s = clt_read_number(section, "at_s", 0.0, 0.0, 1e7);
  change->for_s = clt_read_number(section, "for_s", 0.0, 0.0, 1e7);
  change->every_s = clt_read_number(section, "every_s", 0.0, 0.0, 1e7);
  clt_read_numbers(section, "speed", change->speed, 2, 2, -1e4, 1e4);
  clt_scene_read_channels(section, "factor", description->channels, 1.0, 0.0, 10.0, change->factor);
  bool given = clt_read_numbers(section, "cells", cells, 4, 4, 0.0, CLT_GRID_SIDE_MAX) == 4;
  if (given && (cells[0] + cells[2] > description->width || cells[1] + cells[3] > description->height)) {
    clt_section_fail(section, "cells", "reach beyond the grid of %d x %d; give [left, top, width, height] inside it",
                     description->width, description->height);
  } else if (!given && section.group != NULL) {
    clt_section_fail(section, "cells", "a change needs cells = [left, top, width, height]");
  }
  if (change->every_s > 0.0 && !(change->for_s > 0.0 && change->for_s < change->every_s)) {
    clt_section_fail(section, "every_s", "is %g with for_s = %g; what comes again must be gone in between",
                     change->every_s, change->for_s);
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
  int used = snprintf(why, CLT_EFFECT_WHY_MAX,
                      on ? "%d x %d cells are repainted %.6g s after the start" : "nothing is repainted", change->width,
                      change->height, change->at_s);
  if (on && change->for_s > 0.0 && used > 0 && used < CLT_EFFECT_WHY_MAX) {
    snprintf(why + used, (size_t)(CLT_EFFECT_WHY_MAX - used), ", for %.6g s", change->for_s);
  }
  return on;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)error;
  stage->state = &scene->description.effects.change;
  return CLT_OK;
}

/* Part of the exposure for which it is there; *since_s: how long it has been in the middle of it. */
static double find_share(const clt_change_description *change, const clt_band *band, double *since_s) {
  double from_s = 1e-9 * (double)band->start_ns, to_s = 1e-9 * (double)band->end_ns, start_s = change->at_s;
  if (change->every_s > 0.0) {
    start_s += fmax(floor((to_s - start_s) / change->every_s), 0.0) * change->every_s;
  }
  double end_s = change->for_s > 0.0 ? start_s + change->for_s : INFINITY;
  *since_s = fmax(0.5 * (from_s + to_s) - start_s, 0.0);
  return fmax(fmin(to_s, end_s) - fmax(from_s, start_s), 0.0) / (to_s - from_s);
}

/* A region that moves is where it is in the middle of the exposure, to whole cells. */
static void expose(const void *state, clt_exposure *exposure, const clt_band *band) {
  const clt_change_description *change = state;
  double since_s, share = find_share(change, band, &since_s);
  double left = change->left + floor(change->speed[0] * since_s), top = change->top + floor(change->speed[1] * since_s);
  int first = (int)fmin(fmax(left, 0.0), exposure->width);
  int last = (int)fmin(fmax(left + change->width, 0.0), exposure->width);
  for (int c = 0; c < exposure->channels && share > 0.0; c++) {
    float factor = (float)(1.0 + share * (change->factor[c] - 1.0));
    for (int y = band->first; y < band->last; y++) {
      double below_top = y / exposure->split - top;
      float *row = clt_exposure_row(exposure, c, y);
      for (int x = first; x < last && below_top >= 0.0 && below_top < change->height; x++) {
        row[x] *= factor;
      }
    }
  }
}

const clt_effect clt_effect_change = {
    .name = "change", .read = read, .called_for = called_for, .prepare = prepare, .expose = expose};
