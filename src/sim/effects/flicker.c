/* The ambient light flickers with twice the frequency of the mains: ambient (1 + depth sin(2 pi 2 mains t)), integrated
 * over the exposure. */
#include <stdio.h>

#include "sim/effects/sine.h"
#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section flicker = clt_section_group(root, "flicker");
  description->effects.flicker.mains_hz = clt_read_number(flicker, "mains_hz", 50.0, 1.0, 1000.0);
  description->effects.flicker.depth = clt_read_number(flicker, "depth", 0.0, 0.0, 1.0);
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_flicker_description *flicker = &scene->description.effects.flicker;
  bool light = clt_ambient_most(&scene->description) > 0.0;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           flicker->depth <= 0.0 ? "the ambient light is steady"
           : light               ? "the ambient light varies by %.4g %% at %.4g Hz, twice the mains"
                                 : "there is no ambient light that could flicker",
           100.0 * flicker->depth, 2.0 * flicker->mains_hz);
  return flicker->depth > 0.0 && light;
}

static void expose(const void *state, clt_exposure *exposure, const clt_band *band) {
  const clt_scene_description *description = state;
  const clt_flicker_description *flicker = &description->effects.flicker;
  double mean = flicker->depth * clt_sine_mean(2.0 * flicker->mains_hz, band);
  for (int c = 0; c < exposure->channels; c++) {
    float gain = (float)(mean * description->ambient[c]);
    for (int y = band->first; y < band->last; y++) {
      float *row = clt_exposure_row(exposure, c, y);
      for (int x = 0; x < exposure->width; x++) {
        row[x] += gain;
      }
    }
  }
}

const clt_effect clt_effect_flicker = {.name = "flicker",
                                       .read = read,
                                       .called_for = called_for,
                                       .prepare = clt_effect_lend_description,
                                       .expose = expose};
