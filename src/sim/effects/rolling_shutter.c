/* The camera exposes its rows of pixels one after the other. */
#include <stdio.h>

#include "sim/state.h"

static void read(clt_section root, clt_scene_description *description) {
  clt_section camera = clt_section_group(root, "camera");
  description->effects.line_s = 1e-6 * clt_read_number(camera, "line_us", 0.0, 0.0, 1000.0);
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_scene_description *description = &scene->description;
  double line_s = description->effects.line_s;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           line_s > 0.0
               ? "each row of pixels is exposed %.4g us after the one above, the last one %.4g ms after the first"
               : "all rows of pixels are exposed at the same time",
           1e6 * line_s, 1e3 * line_s * (description->camera.height - 1));
  return line_s > 0.0;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)stage;
  (void)error;
  scene->line_ns = llround(1e9 * scene->description.effects.line_s);
  return CLT_OK;
}

const clt_effect clt_effect_rolling_shutter = {
    .name = "rolling-shutter", .read = read, .called_for = called_for, .prepare = prepare, .per_row = true};
