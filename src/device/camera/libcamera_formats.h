/* Pixel formats of libcamera, which names them as DRM does, in the names of the decoders (pixels.h). */
#ifndef CLT_DEVICE_CAMERA_LIBCAMERA_FORMATS_H
#define CLT_DEVICE_CAMERA_LIBCAMERA_FORMATS_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The decoder of a format: its code, 0 where there is none, and as text. rank: the higher, the sooner it is taken for
 * "auto" (most bits of the sensor, no compression, no missing colour differences). */
typedef struct clt_libcamera_format {
  uint32_t code;
  char name[5];
  int rank;
} clt_libcamera_format;

/* fourcc and modifier as in libcamera's PixelFormat. Formats with a modifier are packed, and not read. */
clt_libcamera_format clt_libcamera_format_find(uint32_t fourcc, uint64_t modifier);

#ifdef __cplusplus
}
#endif
#endif
