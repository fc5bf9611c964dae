/* Filter mosaics (Bayer): one pixel of samples for every square of four on the sensor, half the size each way.
 *
 * Nothing is interpolated: red and blue are what the sensor measured, green is the mean of both of its pixels. Light is
 * kept, noise of neighbours stays independent, and edges get no colours of their own; the channels lie half a pixel of
 * the sensor off the square's middle, red one way and blue the other. */
#include "device/camera/pixels.h"
#include "device/camera/pixels_detail.h"

static uint32_t read_sample(const uint8_t *row, int x, bool wide) {
  return wide ? (uint32_t)row[2 * x] | (uint32_t)row[2 * x + 1] << 8 : row[x];
}

/* The mean of a sum of two samples at the depth of the output. */
static uint16_t scale(uint32_t sum, uint32_t from, uint32_t to) {
  return sum >= 2 * from ? (uint16_t)to : (uint16_t)(((uint64_t)sum * to + from) / (2 * (uint64_t)from));
}

clt_status clt_decode_mosaic(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error) {
  const clt_mosaic_detail *red = format->detail;
  bool wide = format->depth > 8;
  uint32_t from = (1u << format->depth) - 1, to = (1u << format->bits) - 1;
  size_t row = (size_t)layout->width * (wide ? 2 : 1);
  clt_status status = clt_pixels_whole(format, used, layout->stride * ((size_t)layout->height - 1) + row, error);
  for (int y = 0; status == CLT_OK && y + 1 < layout->height; y += 2) {
    const uint8_t *with_red = bytes + (size_t)(y + red->y) * layout->stride;
    const uint8_t *with_blue = bytes + (size_t)(y + 1 - red->y) * layout->stride;
    for (int x = 0; x + 1 < layout->width; x += 2, samples += 3) {
      int at = x + red->x, beside = x + 1 - red->x;
      samples[0] = scale(2 * read_sample(with_red, at, wide), from, to);
      samples[1] = scale(read_sample(with_red, beside, wide) + read_sample(with_blue, at, wide), from, to);
      samples[2] = scale(2 * read_sample(with_blue, beside, wide), from, to);
    }
  }
  return status;
}
