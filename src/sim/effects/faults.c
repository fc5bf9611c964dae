/* What goes wrong between camera and program: frames that never arrive, that carry the samples of the frame before,
 * that arrive late, or whose lower rows are dark. Each by chance, a function of the seed and the frame's number. */
#include <stdio.h>

#include "sim/noise.h"
#include "sim/state.h"

/* Keeps these numbers apart from the noise's, whose seeds are below 2^31. */
static const uint64_t OTHER_SEEDS = 1ull << 40;

static void read(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(clt_section_group(root, "camera"), "faults");
  description->effects.faults = (clt_faults_description){
      .dropped = clt_read_number(section, "dropped", 0.0, 0.0, 0.9),
      .stuck = clt_read_number(section, "stuck", 0.0, 0.0, 0.9),
      .torn = clt_read_number(section, "torn", 0.0, 0.0, 0.9),
      .late = clt_read_number(section, "late", 0.0, 0.0, 1.0),
      .late_s = 1e-3 * clt_read_number(section, "late_ms", 50.0, 0.0, 10000.0),
  };
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_faults_description *faults = &scene->description.effects.faults;
  bool on = faults->dropped > 0.0 || faults->stuck > 0.0 || faults->torn > 0.0 ||
            (faults->late > 0.0 && faults->late_s > 0.0);
  snprintf(why, CLT_EFFECT_WHY_MAX,
           on ? "of 100 frames %.3g are dropped, %.3g stuck at the one before, %.3g dark below, %.3g late by %.4g ms"
              : "every frame arrives, in time",
           100.0 * faults->dropped, 100.0 * faults->stuck, 100.0 * faults->torn, 100.0 * faults->late,
           1e3 * faults->late_s);
  return on;
}

static void frame(const void *state, uint32_t sequence, clt_fate *fate) {
  const clt_scene_description *description = state;
  const clt_faults_description *faults = &description->effects.faults;
  uint64_t key = clt_noise_key(description->seed + OTHER_SEEDS, sequence);
  fate->dropped = clt_noise_uniform(key, 0) < faults->dropped;
  fate->stuck = clt_noise_uniform(key, 1) < faults->stuck;
  fate->dark = clt_noise_uniform(key, 3) < faults->torn ? 0.25 + 0.5 * clt_noise_uniform(key, 4) : 0.0;
  fate->late_ns = clt_noise_uniform(key, 2) < faults->late ? llround(1e9 * faults->late_s) : 0;
}

const clt_effect clt_effect_faults = {
    .name = "faults", .read = read, .called_for = called_for, .prepare = clt_effect_lend_description, .frame = frame};
