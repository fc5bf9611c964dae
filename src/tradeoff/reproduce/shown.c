#include "tradeoff/reproduce/shown.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/memory.h"
#include "base/order.h"

enum { GAP = 2 };                    /* black cells between two pictures */
static const double CLIPPED = 0.005; /* of a picture: a highlight is brighter than white */

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

/* The value that only CLIPPED of the picture exceeds. */
static double find_white(const double *values, size_t count, double *sorted) {
  memcpy(sorted, values, count * sizeof *sorted);
  clt_sort_doubles(sorted, count);
  return fmax(sorted[(size_t)((1 - CLIPPED) * (double)(count - 1))], 1e-30);
}

clt_status clt_shown_strip(const clt_shown *shown, const double *values, int count, clt_image *strip,
                           clt_error *error) {
  size_t width = (size_t)shown->info.width, picture = shown->info.cols * (size_t)shown->info.channels;
  double *sorted = clt_alloc(picture, sizeof *sorted);
  clt_status status = sorted != NULL ? clt_image_init(strip, shown->info.channels, shown->info.height,
                                                      count * (shown->info.width + GAP) - GAP, error)
                                     : clt_fail(error, CLT_FAILED, "not enough memory for %d pictures", count);
  for (int k = 0; k < count && status == CLT_OK; k++) {
    const double *panel = values + (size_t)k * picture;
    double white = find_white(panel, picture, sorted);
    for (size_t i = 0; i < picture; i++) {
      size_t column = i % width + (size_t)k * (width + GAP);
      strip->data[i / width * (size_t)strip->width + column] = (float)fmin(fmax(panel[i] / white, 0.0), 1.0);
    }
  }
  free(sorted);
  return status;
}
