#include "sim/scene_file.h"

static const double FAR_AWAY = 1000.0; /* m, the largest legal coordinate */

clt_vector clt_scene_read_vector(clt_section section, const char *key, clt_vector fallback) {
  double v[3];
  return clt_read_numbers(section, key, v, 3, 3, -FAR_AWAY, FAR_AWAY) == 3 ? (clt_vector){v[0], v[1], v[2]} : fallback;
}

void clt_scene_read_channels(clt_section section, const char *key, int channels, double fallback, double low,
                             double high, double *values) {
  int count = clt_read_numbers(section, key, values, 1, CLT_SIM_CHANNELS_MAX, low, high);
  if (count == 0) {
    values[0] = fallback;
  }
  if (count > 1 && count != channels) {
    clt_section_fail(section, key, "has %d values; legal is one, or one for each of the %d channels", count, channels);
  }
  for (int c = 1; c < CLT_SIM_CHANNELS_MAX && count <= 1; c++) {
    values[c] = values[0];
  }
}
