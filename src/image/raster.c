/* The formats behind OpenCV: planar linear floats to and from its interleaved rasters. */
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/memory.h"
#include "image/format.h"
#include "image/opencv_shim.h"

/* light[code] = decode(code / full scale) for every code value; NULL where memory is short. */
static float *light_of_codes(const clt_curve *curve, int depth) {
  size_t codes = (size_t)1 << depth;
  float *light = clt_alloc(codes, sizeof *light);
  for (size_t code = 0; light != NULL && code < codes; code++) {
    light[code] = (float)clt_curve_decode(curve, (double)code / (double)(codes - 1));
  }
  return light;
}

/* Sample k of a raster as light: through the table for code values (depth 8 and 16), as it is for floats. */
static float sample_light(const clt_raster *raster, const float *light, size_t k) {
  switch (raster->depth) {
  case 8:
    return light[((const uint8_t *)raster->samples)[k]];
  case 16:
    return light[((const uint16_t *)raster->samples)[k]];
  default:
    return ((const float *)raster->samples)[k];
  }
}

/* Frees the raster's samples whatever comes. */
static clt_status take_raster(const char *path, clt_raster *raster, const clt_curve *curve, clt_image *image,
                              clt_error *error) {
  clt_status status = CLT_OK;
  float *light = NULL;
  if (raster->depth < 32 && (light = light_of_codes(curve, raster->depth)) == NULL) {
    status = clt_fail(error, CLT_FAILED, "%s: memory is short for the tone curve", path);
    goto finish;
  }
  status = clt_image_init(image, raster->channels, raster->height, raster->width, error);
  if (status != CLT_OK) {
    clt_fail_within(error, "%s: ", path);
    goto finish;
  }
  size_t channels = (size_t)raster->channels, plane = clt_image_size(image) / channels;
  for (size_t c = 0; c < channels; c++) {
    for (size_t i = 0; i < plane; i++) {
      image->data[c * plane + i] = sample_light(raster, light, i * channels + c);
    }
  }
finish:
  free(light);
  free(raster->samples);
  return status;
}

/* A raster of the image's size without samples' values. CLT_BAD_INPUT where these formats cannot hold its channels. */
static clt_status init_raster(const char *path, const clt_image *image, int depth, clt_raster *raster,
                              clt_error *error) {
  if (image->channels != 1 && image->channels != 3) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: holds pictures of 1 or 3 channels, not %d; write .npy", path,
                    image->channels);
  }
  *raster = (clt_raster){.width = image->width, .height = image->height, .channels = image->channels, .depth = depth};
  raster->samples = clt_alloc(clt_image_size(image), (size_t)depth / CHAR_BIT);
  if (raster->samples == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: memory is short for the picture", path);
  }
  return CLT_OK;
}

static clt_status decode_file(const char *path, const clt_bytes *file, bool grey, const clt_curve *curve,
                              clt_image *image, clt_error *error) {
  clt_raster raster;
  clt_status status = clt_opencv_decode(path, file->bytes, file->size, grey, &raster, error);
  return status == CLT_OK ? take_raster(path, &raster, curve, image, error) : status;
}

static clt_status read_png(const char *path, const clt_curve *curve, clt_image *image, clt_error *error) {
  clt_bytes file;
  bool grey = false;
  clt_status status = clt_bytes_load(path, &file, error);
  if (status == CLT_OK) {
    status = clt_png_check(path, &file, &grey, error);
  }
  if (status == CLT_OK) {
    status = decode_file(path, &file, grey, curve, image, error);
  }
  free(file.bytes);
  return status;
}

static clt_status read_jpeg(const char *path, const clt_curve *curve, clt_image *image, clt_error *error) {
  clt_bytes file;
  clt_status status = clt_bytes_load(path, &file, error);
  if (status == CLT_OK) {
    status = clt_jpeg_check(path, &file, error);
  }
  if (status == CLT_OK) {
    status = decode_file(path, &file, false, curve, image, error);
  }
  free(file.bytes);
  return status;
}

/* Eight bits a sample: round(255 encode(clip(light))). */
static clt_status write_codes(const char *path, const char *ending, const clt_curve *curve, const clt_image *image,
                              clt_error *error) {
  clt_raster raster;
  clt_status status = init_raster(path, image, 8, &raster, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t channels = (size_t)image->channels, plane = clt_image_size(image) / channels;
  uint8_t *samples = raster.samples;
  for (size_t c = 0; c < channels; c++) {
    for (size_t i = 0; i < plane; i++) {
      samples[i * channels + c] = (uint8_t)lround(255 * clt_curve_encode(curve, image->data[c * plane + i]));
    }
  }
  unsigned char *bytes = NULL;
  size_t size = 0;
  status = clt_opencv_encode(path, ending, &raster, &bytes, &size, error);
  if (status == CLT_OK) {
    status = clt_file_write(path, bytes, size, error);
  }
  free(bytes);
  free(raster.samples);
  return status;
}

static clt_status write_png(const char *path, const clt_curve *curve, const clt_image *image, clt_error *error) {
  return write_codes(path, ".png", curve, image, error);
}

static clt_status write_jpeg(const char *path, const clt_curve *curve, const clt_image *image, clt_error *error) {
  return write_codes(path, ".jpg", curve, image, error);
}

static clt_status read_exr(const char *path, const clt_curve *curve, clt_image *image, clt_error *error) {
  clt_bytes file;
  clt_status status = clt_bytes_load(path, &file, error);
  if (status != CLT_OK) {
    return status;
  }
  bool begins_as_exr = file.size >= 4 && memcmp(file.bytes, "\x76\x2f\x31\x01", 4) == 0;
  free(file.bytes);
  if (!begins_as_exr) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is no EXR picture; its ending must say what it is", path);
  }
  clt_raster raster;
  status = clt_opencv_read_exr(path, &raster, error);
  return status == CLT_OK ? take_raster(path, &raster, curve, image, error) : status;
}

static clt_status write_exr(const char *path, const clt_curve *curve, const clt_image *image, clt_error *error) {
  (void)curve;
  char temporary[CLT_PATH_MAX];
  clt_raster raster = {0};
  clt_status status = init_raster(path, image, 32, &raster, error);
  if (status == CLT_OK) {
    status = clt_file_begin(path, temporary, error);
  }
  if (status != CLT_OK) {
    goto finish;
  }
  size_t channels = (size_t)image->channels, plane = clt_image_size(image) / channels;
  float *samples = raster.samples;
  for (size_t c = 0; c < channels; c++) {
    for (size_t i = 0; i < plane; i++) {
      samples[i * channels + c] = image->data[c * plane + i];
    }
  }
  status = clt_opencv_write_exr(temporary, &raster, error);
  if (status == CLT_OK) {
    status = clt_file_commit(temporary, path, error);
  } else {
    clt_file_abandon(temporary);
  }
finish:
  free(raster.samples);
  return status;
}

const clt_image_format clt_format_png = {{".png", NULL}, false, read_png, write_png};
const clt_image_format clt_format_jpeg = {{".jpg", ".jpeg"}, false, read_jpeg, write_jpeg};
const clt_image_format clt_format_exr = {{".exr", NULL}, true, read_exr, write_exr};
