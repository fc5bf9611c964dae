/* The table of formats, and single samples as they are. */
#include "device/camera/pixels.h"

#include <string.h>

#include "device/camera/pixels_detail.h"

/* Entries of the table, without their braces. */
#define GREY(code, depth, swapped)                                                                                     \
  code, 1, depth, depth, 1, false, false, clt_decode_grey, &(const clt_grey_detail) {                                  \
    ((depth) + 7) / 8, swapped                                                                                         \
  }
#define FIELDS(code, depth, differences, ...)                                                                          \
  code, 3, depth, (differences) ? 10 : 8, 1, false, differences, clt_decode_fields, &(const clt_field_detail)__VA_ARGS__
#define PACKED(code, ...) code, 3, 8, 10, 1, false, true, clt_decode_packed, &(const clt_packed_detail)__VA_ARGS__
#define PLANES(code, ...) code, 3, 8, 10, 1, false, true, clt_decode_planes, &(const clt_plane_detail)__VA_ARGS__
#define MOSAIC(code, depth, x, y)                                                                                      \
  code, 3, depth, (depth) > 14 ? 16 : (depth) + 2, 2, false, false, clt_decode_mosaic, &(const clt_mosaic_detail) {    \
    x, y                                                                                                               \
  }
#define C CLT_FOURCC

/* In the order of preference among formats of one depth and as many channels: no arithmetic, no missing colour
 * differences, no losses. Fields are {bytes, big-endian, {shifts}, {bits}} in the order R, G, B or Y, Cb, Cr. */
static const clt_pixel_format formats[] = {
    {FIELDS(C('R', 'G', 'B', '3'), 8, false, {3, false, {0, 8, 16}, {8, 8, 8}})},
    {FIELDS(C('B', 'G', 'R', '3'), 8, false, {3, false, {16, 8, 0}, {8, 8, 8}})},
    {FIELDS(C('X', 'R', '2', '4'), 8, false, {4, false, {16, 8, 0}, {8, 8, 8}})},
    {FIELDS(C('A', 'R', '2', '4'), 8, false, {4, false, {16, 8, 0}, {8, 8, 8}})},
    {FIELDS(C('B', 'G', 'R', '4'), 8, false, {4, false, {16, 8, 0}, {8, 8, 8}})},
    {FIELDS(C('B', 'X', '2', '4'), 8, false, {4, false, {8, 16, 24}, {8, 8, 8}})},
    {FIELDS(C('B', 'A', '2', '4'), 8, false, {4, false, {8, 16, 24}, {8, 8, 8}})},
    {FIELDS(C('R', 'G', 'B', '4'), 8, false, {4, false, {8, 16, 24}, {8, 8, 8}})},
    {FIELDS(C('X', 'B', '2', '4'), 8, false, {4, false, {0, 8, 16}, {8, 8, 8}})},
    {FIELDS(C('A', 'B', '2', '4'), 8, false, {4, false, {0, 8, 16}, {8, 8, 8}})},
    {FIELDS(C('R', 'X', '2', '4'), 8, false, {4, false, {24, 16, 8}, {8, 8, 8}})},
    {FIELDS(C('R', 'A', '2', '4'), 8, false, {4, false, {24, 16, 8}, {8, 8, 8}})},
    {FIELDS(C('Y', 'U', 'V', '3'), 8, true, {3, false, {0, 8, 16}, {8, 8, 8}})},
    {FIELDS(C('Y', 'U', 'V', '4'), 8, true, {4, false, {8, 16, 24}, {8, 8, 8}})},
    {FIELDS(C('A', 'Y', 'U', 'V'), 8, true, {4, false, {8, 16, 24}, {8, 8, 8}})},
    {FIELDS(C('X', 'Y', 'U', 'V'), 8, true, {4, false, {8, 16, 24}, {8, 8, 8}})},
    {FIELDS(C('V', 'U', 'Y', 'A'), 8, true, {4, false, {16, 8, 0}, {8, 8, 8}})},
    {FIELDS(C('V', 'U', 'Y', 'X'), 8, true, {4, false, {16, 8, 0}, {8, 8, 8}})},
    {FIELDS(C('Y', 'U', 'V', 'A'), 8, true, {4, false, {0, 8, 16}, {8, 8, 8}})},
    {FIELDS(C('Y', 'U', 'V', 'X'), 8, true, {4, false, {0, 8, 16}, {8, 8, 8}})},
    {PLANES(C('N', 'V', '2', '4'), {1, 1, true, false})},
    {PLANES(C('N', 'V', '4', '2'), {1, 1, true, true})},
    {PACKED(C('Y', 'U', 'Y', 'V'), {{0, 2}, 1, 3})},
    {PACKED(C('U', 'Y', 'V', 'Y'), {{1, 3}, 0, 2})},
    {PACKED(C('Y', 'V', 'Y', 'U'), {{0, 2}, 3, 1})},
    {PACKED(C('V', 'Y', 'U', 'Y'), {{1, 3}, 2, 0})},
    {PLANES(C('4', '2', '2', 'P'), {2, 1, false, false})},
    {PLANES(C('N', 'V', '1', '6'), {2, 1, true, false})},
    {PLANES(C('N', 'V', '6', '1'), {2, 1, true, true})},
    {PLANES(C('N', 'V', '1', '2'), {2, 2, true, false})},
    {PLANES(C('N', 'V', '2', '1'), {2, 2, true, true})},
    {PLANES(C('Y', 'U', '1', '2'), {2, 2, false, false})},
    {PLANES(C('Y', 'V', '1', '2'), {2, 2, false, true})},
    {MOSAIC(C('B', 'Y', 'R', '2'), 16, 1, 1)},
    {MOSAIC(C('G', 'B', '1', '6'), 16, 0, 1)},
    {MOSAIC(C('G', 'R', '1', '6'), 16, 1, 0)},
    {MOSAIC(C('R', 'G', '1', '6'), 16, 0, 0)},
    {MOSAIC(C('B', 'G', '1', '2'), 12, 1, 1)},
    {MOSAIC(C('G', 'B', '1', '2'), 12, 0, 1)},
    {MOSAIC(C('B', 'A', '1', '2'), 12, 1, 0)},
    {MOSAIC(C('R', 'G', '1', '2'), 12, 0, 0)},
    {MOSAIC(C('B', 'G', '1', '0'), 10, 1, 1)},
    {MOSAIC(C('G', 'B', '1', '0'), 10, 0, 1)},
    {MOSAIC(C('B', 'A', '1', '0'), 10, 1, 0)},
    {MOSAIC(C('R', 'G', '1', '0'), 10, 0, 0)},
    {MOSAIC(C('B', 'A', '8', '1'), 8, 1, 1)},
    {MOSAIC(C('G', 'B', 'R', 'G'), 8, 0, 1)},
    {MOSAIC(C('G', 'R', 'B', 'G'), 8, 1, 0)},
    {MOSAIC(C('R', 'G', 'G', 'B'), 8, 0, 0)},
    {C('M', 'J', 'P', 'G'), 3, 8, 8, 1, true, false, clt_decode_jpeg, NULL},
    {C('J', 'P', 'E', 'G'), 3, 8, 8, 1, true, false, clt_decode_jpeg, NULL},
    {GREY(C('Y', '1', '6', ' '), 16, false)},
    {GREY(C('Y', '1', '6', ' ') | 1u << 31, 16, true)},
    {GREY(C('Y', '1', '2', ' '), 12, false)},
    {GREY(C('Y', '1', '0', ' '), 10, false)},
    {GREY(C('G', 'R', 'E', 'Y'), 8, false)},
    {FIELDS(C('B', 'G', 'R', 'H'), 6, false, {4, true, {14, 20, 26}, {6, 6, 6}})},
    {FIELDS(C('R', 'G', 'B', 'P'), 5, false, {2, false, {11, 5, 0}, {5, 6, 5}})},
    {FIELDS(C('R', 'G', 'B', 'R'), 5, false, {2, true, {11, 5, 0}, {5, 6, 5}})},
    {FIELDS(C('R', 'G', 'B', 'O'), 5, false, {2, false, {10, 5, 0}, {5, 5, 5}})},
    {FIELDS(C('X', 'R', '1', '5'), 5, false, {2, false, {10, 5, 0}, {5, 5, 5}})},
    {FIELDS(C('A', 'R', '1', '5'), 5, false, {2, false, {10, 5, 0}, {5, 5, 5}})},
    {FIELDS(C('X', 'B', '1', '5'), 5, false, {2, false, {0, 5, 10}, {5, 5, 5}})},
    {FIELDS(C('A', 'B', '1', '5'), 5, false, {2, false, {0, 5, 10}, {5, 5, 5}})},
    {FIELDS(C('R', 'X', '1', '5'), 5, false, {2, false, {11, 6, 1}, {5, 5, 5}})},
    {FIELDS(C('R', 'A', '1', '5'), 5, false, {2, false, {11, 6, 1}, {5, 5, 5}})},
    {FIELDS(C('B', 'X', '1', '5'), 5, false, {2, false, {1, 6, 11}, {5, 5, 5}})},
    {FIELDS(C('B', 'A', '1', '5'), 5, false, {2, false, {1, 6, 11}, {5, 5, 5}})},
    {FIELDS(C('R', 'G', 'B', 'Q'), 5, false, {2, true, {10, 5, 0}, {5, 5, 5}})},
    {FIELDS(C('X', 'R', '1', '5') | 1u << 31, 5, false, {2, true, {10, 5, 0}, {5, 5, 5}})},
    {FIELDS(C('A', 'R', '1', '5') | 1u << 31, 5, false, {2, true, {10, 5, 0}, {5, 5, 5}})},
    {FIELDS(C('Y', 'U', 'V', 'P'), 5, true, {2, false, {11, 5, 0}, {5, 6, 5}})},
    {FIELDS(C('Y', 'U', 'V', 'O'), 5, true, {2, false, {10, 5, 0}, {5, 5, 5}})},
    {FIELDS(C('R', '4', '4', '4'), 4, false, {2, false, {8, 4, 0}, {4, 4, 4}})},
    {FIELDS(C('X', 'R', '1', '2'), 4, false, {2, false, {8, 4, 0}, {4, 4, 4}})},
    {FIELDS(C('A', 'R', '1', '2'), 4, false, {2, false, {8, 4, 0}, {4, 4, 4}})},
    {FIELDS(C('X', 'B', '1', '2'), 4, false, {2, false, {0, 4, 8}, {4, 4, 4}})},
    {FIELDS(C('A', 'B', '1', '2'), 4, false, {2, false, {0, 4, 8}, {4, 4, 4}})},
    {FIELDS(C('R', 'X', '1', '2'), 4, false, {2, false, {12, 8, 4}, {4, 4, 4}})},
    {FIELDS(C('R', 'A', '1', '2'), 4, false, {2, false, {12, 8, 4}, {4, 4, 4}})},
    {FIELDS(C('B', 'X', '1', '2'), 4, false, {2, false, {4, 8, 12}, {4, 4, 4}})},
    {FIELDS(C('G', 'A', '1', '2'), 4, false, {2, false, {4, 8, 12}, {4, 4, 4}})},
    {FIELDS(C('Y', '4', '4', '4'), 4, true, {2, false, {8, 4, 0}, {4, 4, 4}})},
    {FIELDS(C('R', 'G', 'B', '1'), 3, false, {1, false, {5, 2, 0}, {3, 3, 2}})},
};
#undef C
enum { FORMATS = sizeof formats / sizeof formats[0] };

const clt_pixel_format *clt_pixels_at(size_t place) {
  return place < FORMATS ? &formats[place] : NULL;
}

const clt_pixel_format *clt_pixels_find(uint32_t code) {
  for (size_t k = 0; k < FORMATS; k++) {
    if (formats[k].code == code) {
      return &formats[k];
    }
  }
  return NULL;
}

/* The highest bit marks the big-endian twin of a format. */
void clt_pixels_name(uint32_t code, char name[5]) {
  for (int k = 0; k < 4; k++) {
    name[k] = (char)(code >> 8 * k & 0x7f);
  }
  name[4] = '\0';
}

uint32_t clt_pixels_code(const char name[4]) {
  return CLT_FOURCC((uint8_t)name[0], (uint8_t)name[1], (uint8_t)name[2], (uint8_t)name[3]);
}

clt_status clt_pixels_whole(const clt_pixel_format *format, size_t used, size_t needed, clt_error *error) {
  char name[5];
  clt_pixels_name(format->code, name);
  return used >= needed ? CLT_OK
                        : clt_fail(error, CLT_TIMEOUT,
                                   "a picture in %s came with %zu bytes of %zu; if that goes on, check the camera's "
                                   "cable and its port",
                                   name, used, needed);
}

/* Samples of 8 to 16 bits are passed on as they are, also where the driver calls their range limited: cameras of one
 * channel are called so by default whether it is true or not, and a calibration measures their black anyhow. */
clt_status clt_decode_grey(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                           size_t used, uint16_t *samples, clt_error *error) {
  const clt_grey_detail *detail = format->detail;
  size_t row = (size_t)layout->width * (size_t)detail->bytes;
  clt_status status = clt_pixels_whole(format, used, layout->stride * ((size_t)layout->height - 1) + row, error);
  for (int y = 0; status == CLT_OK && y < layout->height; y++) {
    const uint8_t *from = bytes + (size_t)y * layout->stride;
    for (int x = 0; x < layout->width; x++, samples++) {
      *samples = detail->bytes == 1 ? from[x]
                 : detail->swapped  ? (uint16_t)(from[2 * x] << 8 | from[2 * x + 1])
                                    : (uint16_t)(from[2 * x + 1] << 8 | from[2 * x]);
    }
  }
  return status;
}
