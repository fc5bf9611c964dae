#include "device/camera/libcamera_formats.h"

#include "device/camera/pixels.h"

typedef struct twin {
  uint32_t drm, code;
} twin;

#define C CLT_FOURCC
/* Formats that DRM and Video4Linux name differently; all others have one code in both. DRM counts the components of a
 * little-endian word from its highest bit, Video4Linux the bytes in memory. */
static const twin twins[] = {
    {C('R', '8', ' ', ' '), C('G', 'R', 'E', 'Y')}, {C('R', '1', '0', ' '), C('Y', '1', '0', ' ')},
    {C('R', '1', '2', ' '), C('Y', '1', '2', ' ')}, {C('R', '1', '6', ' '), C('Y', '1', '6', ' ')},
    {C('R', 'G', '2', '4'), C('B', 'G', 'R', '3')}, {C('B', 'G', '2', '4'), C('R', 'G', 'B', '3')},
    {C('Y', 'U', '1', '6'), C('4', '2', '2', 'P')}, {C('R', 'G', 'B', '6'), C('R', 'G', '1', '6')},
    {C('R', 'G', '1', '6'), C('R', 'G', 'B', 'P')},
};
#undef C
enum { TWINS = sizeof twins / sizeof twins[0] };
enum { PLACES = 256 }; /* more than there are formats of one depth */

static uint32_t code_of(uint32_t fourcc) {
  for (int k = 0; k < TWINS; k++) {
    if (twins[k].drm == fourcc) {
      return twins[k].code;
    }
  }
  return fourcc;
}

clt_libcamera_format clt_libcamera_format_find(uint32_t fourcc, uint64_t modifier) {
  uint32_t code = modifier == 0 ? code_of(fourcc) : 0;
  const clt_pixel_format *format;
  for (int place = 0; code != 0 && (format = clt_pixels_at((size_t)place)) != NULL; place++) {
    if (format->code == code) {
      clt_libcamera_format found = {.code = code, .rank = format->depth * PLACES - place};
      clt_pixels_name(code, found.name);
      return found;
    }
  }
  return (clt_libcamera_format){0};
}
