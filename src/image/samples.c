#include "image/samples.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/file.h"
#include "base/memory.h"
#include "image/format.h"
#include "image/opencv_shim.h"

/* Refuses what is no whole picture of its ending; *grey as clt_png_check tells. */
static clt_status check_file(const char *path, clt_bytes *file, bool *grey, clt_error *error) {
  const char *ending = strrchr(path, '.');
  if (ending != NULL && strcasecmp(ending, ".png") == 0) {
    return clt_png_check(path, file, grey, error);
  }
  if (ending != NULL && (strcasecmp(ending, ".jpg") == 0 || strcasecmp(ending, ".jpeg") == 0)) {
    return clt_jpeg_check(path, file, error);
  }
  return clt_fail(error, CLT_BAD_INPUT, "%s: a camera's picture ends in .png, .jpg or .jpeg", path);
}

/* Frees the raster's samples. */
static clt_status take_raster(const char *path, clt_raster *raster, clt_samples *out, clt_error *error) {
  size_t values = (size_t)raster->width * (size_t)raster->height * (size_t)raster->channels;
  *out = (clt_samples){raster->width, raster->height, raster->channels, raster->depth, NULL};
  if (raster->depth == 16) {
    out->samples = raster->samples;
    return CLT_OK;
  }
  out->samples = clt_alloc(values, sizeof *out->samples);
  for (size_t k = 0; out->samples != NULL && k < values; k++) {
    out->samples[k] = ((const uint8_t *)raster->samples)[k];
  }
  free(raster->samples);
  return out->samples != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "%s: memory is short for its samples", path);
}

clt_status clt_samples_read(const char *path, clt_samples *samples, clt_error *error) {
  clt_bytes file;
  clt_raster raster;
  bool grey = false;
  *samples = (clt_samples){0};
  clt_status status = clt_bytes_load(path, &file, error);
  if (status == CLT_OK) {
    status = check_file(path, &file, &grey, error);
  }
  if (status == CLT_OK) {
    status = clt_opencv_decode(path, file.bytes, file.size, grey, &raster, error);
  }
  free(file.bytes);
  if (status == CLT_OK) {
    status = take_raster(path, &raster, samples, error);
  }
  if (status != CLT_OK) {
    clt_samples_finish(samples);
  }
  return status;
}

clt_status clt_samples_write(const char *path, const clt_samples *samples, clt_error *error) {
  const clt_raster raster = {samples->width, samples->height, samples->channels, 16, samples->samples};
  unsigned char *bytes = NULL;
  size_t size = 0;
  clt_status status = clt_opencv_encode(path, ".png", &raster, &bytes, &size, error);
  if (status == CLT_OK) {
    status = clt_file_write(path, bytes, size, error);
  }
  free(bytes);
  return status;
}

void clt_samples_finish(clt_samples *samples) {
  free(samples->samples);
  *samples = (clt_samples){0};
}
