#include "daemon/pace.h"

#include <math.h>

/* Refreshes come regularly, turns begin as soon as there is a processor: the phase follows early ones sooner than late
 * ones. */
static void follow(pace *self, int64_t now_ns, double refresh_ns) {
  const double early_gain = 0.5, late_gain = 0.1;
  const double expected_ns = refresh_ns * round((double)(now_ns - self->at_ns) / refresh_ns);
  const double late_ns = (double)(now_ns - self->at_ns) - expected_ns;
  self->at_ns += llround(expected_ns + (late_ns < 0 ? early_gain : late_gain) * late_ns);
}

void pace_begin(pace *self, int64_t now_ns, double refresh_s) {
  const int64_t refresh_ns = llround(1e9 * refresh_s);
  follow(self, now_ns, 1e9 * refresh_s);
  self->begun_ns = now_ns;
  if (now_ns < self->planned_ns) {
    self->planned_ns -= refresh_ns;
  } else if (now_ns - self->planned_ns > refresh_ns) {
    self->planned_ns = now_ns;
  }
}

double pace_left(pace *self, int64_t now_ns, double refresh_s, bool waited) {
  const int64_t refresh_ns = llround(1e9 * refresh_s);
  const int64_t next_ns = waited ? self->begun_ns + refresh_ns / 2 : self->planned_ns + refresh_ns;
  self->planned_ns = next_ns > now_ns ? next_ns : now_ns;
  return 1e-9 * (double)(self->planned_ns - now_ns);
}
