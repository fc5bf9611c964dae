/* What goes wrong between camera and program: frames that never arrive, that carry the samples of the frame before,
 * that arrive late, or whose lower rows are dark. Each by chance, a function of the seed and the frame's number. And a
 * camera that is unplugged at a time of the scene's clock. */
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
      .gone_at_s = clt_read_number(section, "gone_at_s", 0.0, 0.0, 1e6),
      .gone_s = clt_read_number(section, "gone_s", 0.0, 0.0, 1e6),
      .gone_every_s = clt_read_number(section, "gone_every_s", 0.0, 0.0, 1e6),
  };
  const clt_faults_description *faults = &description->effects.faults;
  if (faults->gone_every_s > 0.0 && faults->gone_every_s <= faults->gone_s) {
    clt_section_fail(section, "gone_every_s", "is %g with gone_s = %g; the camera must come back in between",
                     faults->gone_every_s, faults->gone_s);
  }
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_faults_description *faults = &scene->description.effects.faults;
  bool on = faults->dropped > 0.0 || faults->stuck > 0.0 || faults->torn > 0.0 ||
            (faults->late > 0.0 && faults->late_s > 0.0) || faults->gone_s > 0.0;
  int used = snprintf(
      why, CLT_EFFECT_WHY_MAX,
      on ? "of 100 frames %.3g are dropped, %.3g stuck at the one before, %.3g dark below, %.3g late by %.4g ms"
         : "every frame arrives, in time",
      100.0 * faults->dropped, 100.0 * faults->stuck, 100.0 * faults->torn, 100.0 * faults->late, 1e3 * faults->late_s);
  if (faults->gone_s > 0.0 && used > 0 && used < CLT_EFFECT_WHY_MAX) {
    snprintf(why + used, (size_t)(CLT_EFFECT_WHY_MAX - used), "; unplugged for %g s at %g s", faults->gone_s,
             faults->gone_at_s);
  }
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

/* It is unplugged at at + k every <= t < at + k every + gone; of those times the first that has not ended before
 * from_ns is looked at. */
static bool away(const void *state, int64_t from_ns, int64_t to_ns) {
  const clt_faults_description *faults = &((const clt_scene_description *)state)->effects.faults;
  double from_s = 1e-9 * (double)from_ns, start_s = faults->gone_at_s;
  if (faults->gone_every_s > 0.0) {
    double number = floor((from_s - faults->gone_at_s - faults->gone_s) / faults->gone_every_s) + 1.0;
    start_s += fmax(number, 0.0) * faults->gone_every_s;
  }
  return faults->gone_s > 0.0 && from_s < start_s + faults->gone_s && 1e-9 * (double)to_ns >= start_s;
}

const clt_effect clt_effect_faults = {.name = "faults",
                                      .read = read,
                                      .called_for = called_for,
                                      .prepare = clt_effect_lend_description,
                                      .frame = frame,
                                      .away = away};
