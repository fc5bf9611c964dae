/* Motion JPEG: every picture is one JPEG, often without its Huffman tables, followed by bytes that mean nothing. */
#include <stdlib.h>

#include "device/camera/pixels.h"
#include "image/opencv_shim.h"

/* The decoder would fill what is missing with grey: a picture is whole when its end marker is there. */
static size_t whole_size(const uint8_t *bytes, size_t used) {
  while (used >= 2 && !(bytes[used - 2] == 0xff && bytes[used - 1] == 0xd9)) {
    used--;
  }
  return used >= 4 && bytes[0] == 0xff && bytes[1] == 0xd8 ? used : 0;
}

static clt_status copy(const clt_raster *raster, const clt_picture_layout *layout, uint16_t *samples,
                       clt_error *error) {
  if (raster->width != layout->width || raster->height != layout->height || raster->depth != 8) {
    return clt_fail(error, CLT_TIMEOUT, "a JPEG picture of %d x %d pixels came where %d x %d were announced",
                    raster->width, raster->height, layout->width, layout->height);
  }
  size_t pixels = (size_t)layout->width * (size_t)layout->height;
  const uint8_t *from = raster->samples;
  for (size_t k = 0; k < pixels; k++) {
    for (size_t c = 0; c < 3; c++) {
      samples[3 * k + c] = from[raster->channels == 3 ? 3 * k + c : k];
    }
  }
  return CLT_OK;
}

clt_status clt_decode_jpeg(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes,
                           size_t used, uint16_t *samples, clt_error *error) {
  (void)format;
  size_t whole = whole_size(bytes, used);
  if (whole == 0) {
    return clt_fail(error, CLT_TIMEOUT,
                    "a JPEG picture of %zu bytes has no end; if that goes on, check the camera's cable and its port",
                    used);
  }
  clt_raster raster;
  clt_status status = clt_opencv_decode("a picture of the camera", bytes, whole, false, &raster, error);
  if (status == CLT_BAD_INPUT) {
    status = clt_fail(error, CLT_TIMEOUT, "a JPEG picture of %zu bytes is damaged; check the camera's cable", used);
  }
  status = status == CLT_OK ? copy(&raster, layout, samples, error) : status;
  free(raster.samples);
  return status;
}
