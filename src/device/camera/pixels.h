/* From the bytes of a camera's picture to samples: one table of formats, named as Video4Linux names them.
 *
 * Samples are proportional to what the camera sent: no tone curve is put on or taken off. Formats whose samples have to
 * be computed (colour differences, filter mosaics) come out with two bits more than the camera's, so that rounding once
 * more adds nothing to speak of; all others come out as they are. */
#ifndef CLT_DEVICE_CAMERA_PIXELS_H
#define CLT_DEVICE_CAMERA_PIXELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"

#define CLT_FOURCC(a, b, c, d)                                                                                         \
  ((uint32_t)(a) | (uint32_t)(b) << 8 | (uint32_t)(c) << 16 | (uint32_t)(d) << 24) /* the first character lowest */

/* How Y'CbCr was made of R'G'B' (the kernel's "Detailed Colorspace Descriptions"). */
typedef enum clt_colour_matrix {
  CLT_MATRIX_601,
  CLT_MATRIX_709,
  CLT_MATRIX_2020, /* non-constant luminance */
  CLT_MATRIX_240M
} clt_colour_matrix;

/* A picture as it lies in the buffer. */
typedef struct clt_picture_layout {
  int width, height; /* pixels of the sensor */
  size_t stride;     /* bytes from row to row of the first plane */
  size_t size;       /* bytes that a whole picture takes; compressed: the most that it can */
  clt_colour_matrix matrix;
  bool limited; /* black at 16, white at 235 (colour differences 16 to 240) of 8 bits */
} clt_picture_layout;

typedef struct clt_pixel_format clt_pixel_format;
/* Fills samples[(y * width + x) * channels + c] from a picture of used bytes. CLT_TIMEOUT where the picture is damaged
 * or not whole: the next may be better. */
typedef clt_status (*clt_pixel_decoder)(const clt_pixel_format *format, const clt_picture_layout *layout,
                                        const uint8_t *bytes, size_t used, uint16_t *samples, clt_error *error);

struct clt_pixel_format {
  uint32_t code;
  int channels; /* of the samples: 1, or 3 (R, G, B) */
  int depth;    /* bits as the camera sends them */
  int bits;     /* of the samples */
  int shrink;   /* pixels of the sensor a side for one of the samples: 2 for filter mosaics */
  bool compressed;
  bool differences; /* Y'CbCr: matrix and range count */
  clt_pixel_decoder decode;
  const void *detail; /* the decoder's own */
};

/* The format of that code; NULL where it is not read. */
const clt_pixel_format *clt_pixels_find(uint32_t code);
/* The format at a place in the order of preference among equally deep ones; NULL after the last. */
const clt_pixel_format *clt_pixels_at(size_t place);
/* The code as text. */
void clt_pixels_name(uint32_t code, char name[5]);
uint32_t clt_pixels_code(const char name[4]);

/* The decoders; each says in its file what its detail is. */
clt_status clt_decode_grey(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                           size_t used, uint16_t *samples, clt_error *error);
clt_status clt_decode_fields(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error);
clt_status clt_decode_packed(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error);
clt_status clt_decode_planes(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error);
clt_status clt_decode_mosaic(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                             size_t used, uint16_t *samples, clt_error *error);
clt_status clt_decode_jpeg(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                           size_t used, uint16_t *samples, clt_error *error);

/* Twice the most that the camera's own rounding moves a sample, in code values; what a compressed picture loses beside
 * is not in it. */
double clt_pixels_step(const clt_pixel_format *format, const clt_picture_layout *layout);

/* What the decoders share: refuses a picture of less than needed bytes. */
clt_status clt_pixels_whole(const clt_pixel_format *format, size_t used, size_t needed, clt_error *error);

/* Y'CbCr of 8 bits to samples of 10 bits. */
typedef struct clt_ycbcr {
  float y_gain, y_black;
  float red_cr, green_cb, green_cr, blue_cb; /* of colour differences about 128 */
} clt_ycbcr;
clt_ycbcr clt_ycbcr_make(const clt_picture_layout *layout);
void clt_ycbcr_convert(const clt_ycbcr *form, int y, int cb, int cr, uint16_t rgb[3]);

#endif
