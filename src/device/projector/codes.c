#include "device/projector/codes.h"

/* Rounds half upwards: value - whole is exact, where value + 0.5 is not. Written so that compilers vectorise it. */
static inline int nearest(float code, float full) {
  float clipped = code > 0.0F ? (code < 1.0F ? code : 1.0F) : 0.0F; /* NaN is dark */
  float value = clipped * full;
  int whole = (int)value;
  return whole + (value - (float)whole >= 0.5F);
}

void clt_codes_to_bytes(const float *codes, size_t count, uint8_t *out) {
  for (size_t i = 0; i < count; i++) {
    out[i] = (uint8_t)nearest(codes[i], 255.0F);
  }
}

void clt_codes_to_words(const float *codes, size_t count, int full, uint16_t *out) {
  for (size_t i = 0; i < count; i++) {
    out[i] = (uint16_t)nearest(codes[i], (float)full);
  }
}

void clt_codes_to_pixels(const float *codes, size_t count, uint32_t *out) {
  const float *red = codes, *green = codes + count, *blue = codes + 2 * count;
  for (size_t i = 0; i < count; i++) {
    int r = nearest(red[i], 255.0F), g = nearest(green[i], 255.0F), b = nearest(blue[i], 255.0F);
    out[i] = (uint32_t)(r << 16 | g << 8 | b);
  }
}
