#include "counterlight/image.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { SIDE_MAX = 32768, CHANNELS_MAX = 4 };

clt_status clt_image_init(clt_image *image, int channels, int height, int width, clt_error *error) {
  *image = (clt_image){0};
  if (channels < 1 || channels > CHANNELS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "a picture has 1 to %d channels, not %d", CHANNELS_MAX, channels);
  }
  if (height < 1 || height > SIDE_MAX || width < 1 || width > SIDE_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "a picture has 1 to %d pixels a side, not %d x %d", SIDE_MAX, width, height);
  }
  float *data = clt_alloc((size_t)channels * (size_t)height * (size_t)width, sizeof *data);
  if (data == NULL) {
    return clt_fail(error, CLT_FAILED, "memory is short for a picture of %d x %d pixels and %d channels", width, height,
                    channels);
  }
  *image = (clt_image){.channels = channels, .height = height, .width = width, .data = data};
  return CLT_OK;
}

void clt_image_finish(clt_image *image) {
  if (image != NULL) {
    free(image->data);
    *image = (clt_image){0};
  }
}

size_t clt_image_size(const clt_image *image) {
  return (size_t)image->channels * (size_t)image->height * (size_t)image->width;
}

clt_status clt_image_convert(const clt_image *in, int channels, clt_image *out, clt_error *error) {
  *out = (clt_image){0};
  bool averages = in->channels == 3 && channels == 1;
  if (in->channels != channels && in->channels != 1 && !averages) {
    return clt_fail(error, CLT_BAD_INPUT, "a picture of %d channels cannot become one of %d; give one of 1 or %d",
                    in->channels, channels, channels);
  }
  clt_status status = clt_image_init(out, channels, in->height, in->width, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t plane = (size_t)in->height * (size_t)in->width;
  if (averages) {
    const float *red = in->data, *green = red + plane, *blue = green + plane;
    for (size_t i = 0; i < plane; i++) {
      out->data[i] = (float)(0.2126 * red[i] + 0.7152 * green[i] + 0.0722 * blue[i]); /* Rec. 709 luminance */
    }
    return CLT_OK;
  }
  for (int c = 0; c < channels; c++) {
    const float *from = in->channels == 1 ? in->data : in->data + (size_t)c * plane;
    memcpy(out->data + (size_t)c * plane, from, plane * sizeof *from);
  }
  return CLT_OK;
}
