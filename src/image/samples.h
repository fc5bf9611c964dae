/* Camera samples in picture files: code values as they are, neither decoded nor scaled. */
#ifndef CLT_IMAGE_SAMPLES_H
#define CLT_IMAGE_SAMPLES_H

#include <stdint.h>

#include "counterlight/status.h"

/* samples[(y * width + x) * channels + c]; channels 1 or 3 (R, G, B). Owned by the struct; a zeroed one is empty. */
typedef struct clt_samples {
  int width, height, channels;
  int bits; /* of the file: 8 or 16 */
  uint16_t *samples;
} clt_samples;

/* Reads a .png, .jpg or .jpeg. CLT_BAD_INPUT as clt_image_read. On failure samples is empty. */
clt_status clt_samples_read(const char *path, clt_samples *samples, clt_error *error);
/* Replaces path by a 16 bit PNG. */
clt_status clt_samples_write(const char *path, const clt_samples *samples, clt_error *error);
void clt_samples_finish(clt_samples *samples);

#endif
