#include "tradeoff/reproduce/shown.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/file.h"
#include "base/memory.h"

clt_status clt_shown_open(const clt_reproduce_options *options, const char *name, clt_shown *shown, clt_error *error) {
  char file[64], path[CLT_PATH_MAX];
  *shown = (clt_shown){0};
  snprintf(file, sizeof file, "%s.cfg", name);
  clt_status status = clt_file_join(options->scenes, file, path, error);
  if (status == CLT_OK) {
    status = clt_scene_open(path, &shown->scene, error);
  }
  if (status == CLT_OK) {
    shown->transport = clt_scene_transport(shown->scene);
    shown->info = clt_transport_describe(shown->transport);
    status = clt_certify(shown->transport, &shown->certificate, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  size_t values = shown->info.cols * (size_t)shown->info.channels;
  shown->drive = clt_alloc(3 * values, sizeof *shown->drive);
  if (shown->drive == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: not enough memory for %zu values", path, values);
  }
  shown->light = shown->drive + values;
  shown->answer = shown->light + values;
  return CLT_OK;
}

void clt_shown_close(clt_shown *shown) {
  clt_certificate_destroy(shown->certificate);
  clt_scene_close(shown->scene);
  free(shown->drive);
  *shown = (clt_shown){0};
}

clt_status clt_shown_strip(const clt_shown *shown, const double *values, int count, clt_image *strip,
                           clt_error *error) {
  int width = shown->info.width, height = shown->info.height, channels = shown->info.channels;
  size_t picture = shown->info.cols * (size_t)channels;
  clt_status status = clt_image_init(strip, channels, height, count * width, error);
  for (int k = 0; k < count && status == CLT_OK; k++) {
    double most = 1e-30;
    for (size_t i = 0; i < picture; i++) {
      most = fmax(most, values[(size_t)k * picture + i]);
    }
    for (size_t i = 0; i < picture; i++) {
      size_t row = i / (size_t)width, column = i % (size_t)width + (size_t)(k * width);
      strip->data[row * (size_t)(count * width) + column] = (float)fmax(values[(size_t)k * picture + i] / most, 0.0);
    }
  }
  return status;
}
