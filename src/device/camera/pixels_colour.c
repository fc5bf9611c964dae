/* Pixels whose channels share a word, and Y'CbCr. */
#include <math.h>

#include "device/camera/pixels.h"
#include "device/camera/pixels_detail.h"

#define FULL_10 1023.0

/* Y' = kr R' + (1 - kr - kb) G' + kb B', Cb = (B' - Y') / (2 (1 - kb)), Cr = (R' - Y') / (2 (1 - kr)). */
typedef struct weights {
  double kr, kb;
} weights;
static const weights matrices[] = {[CLT_MATRIX_601] = {0.299, 0.114},
                                   [CLT_MATRIX_709] = {0.2126, 0.0722},
                                   [CLT_MATRIX_2020] = {0.2627, 0.0593},
                                   [CLT_MATRIX_240M] = {0.212, 0.087}};

clt_ycbcr clt_ycbcr_make(const clt_picture_layout *layout) {
  weights k = matrices[layout->matrix];
  double kg = 1 - k.kr - k.kb;
  double y_range = layout->limited ? 219 : 255, c_range = layout->limited ? 224 : 255;
  double red = 2 * (1 - k.kr) * FULL_10 / c_range, blue = 2 * (1 - k.kb) * FULL_10 / c_range;
  return (clt_ycbcr){.y_gain = (float)(FULL_10 / y_range),
                     .y_black = layout->limited ? 16 : 0,
                     .red_cr = (float)red,
                     .green_cb = (float)(-blue * k.kb / kg),
                     .green_cr = (float)(-red * k.kr / kg),
                     .blue_cb = (float)blue};
}

double clt_pixels_step(const clt_pixel_format *format, const clt_picture_layout *layout) {
  static const clt_picture_layout jpeg = {.matrix = CLT_MATRIX_601};
  double full = (1 << format->bits) - 1;
  if (!format->differences && !format->compressed) {
    double stretched = layout->limited && format->channels == 3 ? 255.0 / 219 : 1;
    return stretched * full / ((1 << format->depth) - 1);
  }
  clt_ycbcr form = clt_ycbcr_make(format->compressed ? &jpeg : layout);
  float colour = fmaxf(fmaxf(form.red_cr, form.blue_cb), -form.green_cb - form.green_cr);
  return (double)(form.y_gain + colour) * full / FULL_10 * ldexp(1, 8 - format->depth);
}

static uint16_t clip(float value) {
  return value <= 0 ? 0 : value >= (float)FULL_10 ? (uint16_t)FULL_10 : (uint16_t)(value + 0.5f);
}

void clt_ycbcr_convert(const clt_ycbcr *form, int y, int cb, int cr, uint16_t rgb[3]) {
  float light = ((float)y - form->y_black) * form->y_gain, u = (float)(cb - 128), v = (float)(cr - 128);
  rgb[0] = clip(light + form->red_cr * v);
  rgb[1] = clip(light + form->green_cb * u + form->green_cr * v);
  rgb[2] = clip(light + form->blue_cb * u);
}

/* A field of some bits as one of eight: its top bits repeat, so that full scale becomes full scale. */
static int widen(uint32_t word, int shift, int bits) {
  uint32_t value = word >> shift & ((1u << bits) - 1);
  return (int)((value * 255 + ((1u << bits) - 1) / 2) / ((1u << bits) - 1));
}

/* Colour differences have their zero at half of the range, which a wider field must keep. */
static int widen_difference(uint32_t word, int shift, int bits) {
  return (int)((word >> shift & ((1u << bits) - 1)) << (8 - bits));
}

static uint32_t read_word(const uint8_t *from, const clt_field_detail *detail) {
  uint32_t word = 0;
  for (int k = 0; k < detail->bytes; k++) {
    word |= (uint32_t)from[k] << 8 * (detail->swapped ? detail->bytes - 1 - k : k);
  }
  return word;
}

/* 16..235 of 8 bits to 0..255. */
static uint16_t stretch(int value) {
  return value <= 16 ? 0 : value >= 235 ? 255 : (uint16_t)(((value - 16) * 255 + 109) / 219);
}

clt_status clt_decode_fields(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error) {
  const clt_field_detail *detail = format->detail;
  clt_ycbcr form = clt_ycbcr_make(layout);
  size_t row = (size_t)layout->width * (size_t)detail->bytes;
  clt_status status = clt_pixels_whole(format, used, layout->stride * ((size_t)layout->height - 1) + row, error);
  for (int y = 0; status == CLT_OK && y < layout->height; y++) {
    const uint8_t *from = bytes + (size_t)y * layout->stride;
    for (int x = 0; x < layout->width; x++, from += detail->bytes, samples += 3) {
      uint32_t word = read_word(from, detail);
      if (format->differences) {
        clt_ycbcr_convert(&form, widen_difference(word, detail->shift[0], detail->bits[0]),
                          widen_difference(word, detail->shift[1], detail->bits[1]),
                          widen_difference(word, detail->shift[2], detail->bits[2]), samples);
        continue;
      }
      for (int c = 0; c < 3; c++) {
        int value = widen(word, detail->shift[c], detail->bits[c]);
        samples[c] = layout->limited ? stretch(value) : (uint16_t)value;
      }
    }
  }
  return status;
}

clt_status clt_decode_packed(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error) {
  const clt_packed_detail *detail = format->detail;
  clt_ycbcr form = clt_ycbcr_make(layout);
  size_t row = ((size_t)layout->width + 1) / 2 * 4;
  clt_status status = clt_pixels_whole(format, used, layout->stride * ((size_t)layout->height - 1) + row, error);
  for (int y = 0; status == CLT_OK && y < layout->height; y++) {
    const uint8_t *from = bytes + (size_t)y * layout->stride;
    for (int x = 0; x < layout->width; x++, samples += 3) {
      const uint8_t *pair = from + x / 2 * 4;
      clt_ycbcr_convert(&form, pair[detail->y[x % 2]], pair[detail->cb], pair[detail->cr], samples);
    }
  }
  return status;
}

/* The planes of colour differences begin one after the other behind the first plane; a row of them takes stride *
 * 2 / across bytes where they are interleaved, stride / across where they are not. */
clt_status clt_decode_planes(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error) {
  const clt_plane_detail *detail = format->detail;
  clt_ycbcr form = clt_ycbcr_make(layout);
  size_t rows = ((size_t)layout->height + (size_t)detail->down - 1) / (size_t)detail->down;
  size_t chroma_stride = layout->stride * (detail->interleaved ? 2 : 1) / (size_t)detail->across;
  size_t step = detail->interleaved ? 2 : 1, second = detail->interleaved ? 1 : chroma_stride * rows;
  const uint8_t *chroma = bytes + layout->stride * (size_t)layout->height;
  clt_status status = clt_pixels_whole(
      format, used, layout->stride * (size_t)layout->height + chroma_stride * rows * (detail->interleaved ? 1 : 2),
      error);
  for (int y = 0; status == CLT_OK && y < layout->height; y++) {
    const uint8_t *light = bytes + (size_t)y * layout->stride;
    const uint8_t *first = chroma + (size_t)(y / detail->down) * chroma_stride;
    for (int x = 0; x < layout->width; x++, samples += 3) {
      const uint8_t *at = first + (size_t)(x / detail->across) * step;
      int cb = detail->red_first ? at[second] : at[0], cr = detail->red_first ? at[0] : at[second];
      clt_ycbcr_convert(&form, light[x], cb, cr, samples);
    }
  }
  return status;
}
