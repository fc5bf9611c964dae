#include <math.h>

#include "counterlight/image.h"

/* The colour map "inferno" (S. van der Walt, N. Smith 2015, CC0) at eleven equidistant values, sRGB code values. Its
 * lightness rises evenly from black to pale yellow. */
static const unsigned char inferno[][3] = {
    {0x00, 0x00, 0x04}, {0x16, 0x0b, 0x39}, {0x42, 0x0a, 0x68}, {0x6a, 0x17, 0x6e},
    {0x93, 0x26, 0x67}, {0xbc, 0x37, 0x54}, {0xdd, 0x51, 0x3a}, {0xf3, 0x78, 0x19},
    {0xfc, 0xa5, 0x0a}, {0xf6, 0xd7, 0x46}, {0xfc, 0xff, 0xa4},
};

/* Linear light of one channel of the map at a fraction 0..1; NaN counts as 0. */
static float colour_at(double fraction, int channel) {
  static const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  const int steps = (int)(sizeof inferno / sizeof inferno[0]) - 1;
  double at = fraction > 0 ? fmin(fraction, 1) * steps : 0;
  int step = at < steps ? (int)at : steps - 1;
  double low = inferno[step][channel], high = inferno[step + 1][channel];
  return (float)clt_curve_decode(&srgb, (low + (at - step) * (high - low)) / 255);
}

clt_status clt_image_heatmap(const clt_image *values, double top, clt_image *out, clt_error *error) {
  *out = (clt_image){0};
  if (values->channels != 1 || !(top > 0) || isinf(top)) {
    return clt_fail(error, CLT_BAD_INPUT, "a heat map takes one channel and a top above 0, not %d channels and %g",
                    values->channels, top);
  }
  clt_status status = clt_image_init(out, 3, values->height, values->width, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t plane = clt_image_size(values);
  for (size_t i = 0; i < plane; i++) {
    for (int c = 0; c < 3; c++) {
      out->data[(size_t)c * plane + i] = colour_at(values->data[i] / top, c);
    }
  }
  return CLT_OK;
}
