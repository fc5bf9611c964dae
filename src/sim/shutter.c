#include "sim/shutter.h"

#include <string.h>

int64_t clt_shutter_exposure_ns(const clt_shutter *shutter) {
  return llround(shutter->exposure_s * 1e9);
}

/* From this frame's start to the next one's. */
static int64_t period_ns(const clt_shutter *shutter) {
  int64_t exposure_ns = clt_shutter_exposure_ns(shutter);
  return exposure_ns > shutter->frame_ns ? exposure_ns : shutter->frame_ns;
}

static void apply_changes(clt_shutter *shutter) {
  while (shutter->pending > 0 && (int32_t)(shutter->sequence - shutter->change[0].sequence) >= 0) {
    shutter->exposure_s = shutter->change[0].exposure_s;
    shutter->pending--;
    memmove(&shutter->change[0], &shutter->change[1], (size_t)shutter->pending * sizeof shutter->change[0]);
  }
}

void clt_shutter_step(clt_shutter *shutter) {
  shutter->start_ns += period_ns(shutter);
  shutter->sequence++;
  apply_changes(shutter);
}

void clt_shutter_advance(clt_shutter *shutter, int64_t not_before_ns, int64_t now_ns) {
  for (;;) {
    int64_t reaching_now = now_ns - clt_shutter_exposure_ns(shutter);
    int64_t wanted = not_before_ns > reaching_now ? not_before_ns : reaching_now;
    if (shutter->start_ns >= wanted) {
      return;
    }
    if (shutter->pending == 0) {
      int64_t period = period_ns(shutter), frames = (wanted - shutter->start_ns - 1) / period;
      shutter->start_ns += frames * period;
      shutter->sequence += (uint32_t)frames;
    }
    clt_shutter_step(shutter);
  }
}

void clt_shutter_request(clt_shutter *shutter, double exposure_s, int64_t now_ns) {
  clt_shutter_advance(shutter, INT64_MIN, now_ns);
  clt_shutter ahead = *shutter;
  clt_shutter_advance(&ahead, now_ns, now_ns);
  uint32_t sequence = ahead.sequence + (uint32_t)shutter->delay;
  if (shutter->pending == 0 || shutter->change[shutter->pending - 1].sequence != sequence) {
    shutter->pending++;
  }
  shutter->change[shutter->pending - 1].sequence = sequence;
  shutter->change[shutter->pending - 1].exposure_s = exposure_s;
  apply_changes(shutter);
}
