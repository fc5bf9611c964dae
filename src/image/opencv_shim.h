/* OpenCV's picture codecs for C. The shim is silent: OpenCV's own messages are held back, what went wrong is in error.
 * Calls are serialised. */
#ifndef CLT_IMAGE_OPENCV_SHIM_H
#define CLT_IMAGE_OPENCV_SHIM_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Interleaved samples: samples[(y * width + x) * channels + c], row 0 at the top; channels 1, or 3 in the order R, G,
 * B. depth 8 and 16: uint8_t and uint16_t code values; 32: float. samples is malloc'ed and the owner's to free(). */
typedef struct clt_raster {
  int width, height, channels, depth;
  void *samples;
} clt_raster;

/* Decodes a PNG or JPEG file's bytes; alpha is dropped, an EXIF orientation followed. grey: as one channel. path is for
 * messages. CLT_BAD_INPUT where the bytes are no picture. On failure raster is empty. */
clt_status clt_opencv_decode(const char *path, const unsigned char *bytes, size_t size, bool grey, clt_raster *raster,
                             clt_error *error);
/* Encodes as ".png" or ".jpg" (quality 95). *bytes is malloc'ed and the caller's to free(). path is for messages. */
clt_status clt_opencv_encode(const char *path, const char *ending, const clt_raster *raster, unsigned char **bytes,
                             size_t *size, clt_error *error);
/* Reads and writes an EXR file (depth 32); half floats are widened. */
clt_status clt_opencv_read_exr(const char *path, clt_raster *raster, clt_error *error);
clt_status clt_opencv_write_exr(const char *path, const clt_raster *raster, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
