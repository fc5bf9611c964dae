/* The geometry measured again, where all else of a calibration holds. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"
#include "rig/calibration.h"

#define TIMEOUT_S 2.0
enum { ATTEMPTS = 3 };
/* Part of the panel that must still be seen, of what was. */
#define COVERED_LEAST 0.5

void clt_calibration_shots(const clt_calibrate_options *options, clt_projector *projector, clt_camera *camera,
                           double latency_s, clt_shots *shots) {
  clt_shots_init(shots, projector, camera, latency_s, options->timeout_s > 0 ? options->timeout_s : TIMEOUT_S,
                 options->attempts > 0 ? options->attempts : ATTEMPTS);
}

static clt_status check_devices(const clt_calibration_info *known, const clt_shots *shots, clt_error *error) {
  const clt_projector_info *panel = &shots->panel;
  const clt_camera_info *sensor = &shots->sensor;
  if (panel->width == known->panel_width && panel->height == known->panel_height &&
      sensor->width == known->camera_width && sensor->height == known->camera_height &&
      sensor->channels == known->channels) {
    return CLT_OK;
  }
  return clt_fail(
      error, CLT_BAD_INPUT,
      "the calibration is of a panel of %d x %d pixels and a camera of %d x %d with %d channels, the devices "
      "have %d x %d and %d x %d with %d; run counterlight calibrate",
      known->panel_width, known->panel_height, known->camera_width, known->camera_height, known->channels, panel->width,
      panel->height, sensor->width, sensor->height, sensor->channels);
}

static bool count_pictures(void *context, int done, int total) {
  const clt_calibrate_options *options = context;
  return options->progress == NULL || options->progress(options->context, "structured light", done, total);
}

/* The white panel may be brighter or darker for a camera that stands elsewhere. */
static clt_status find_exposure(clt_shots *shots, double *seconds, clt_findings *findings, clt_error *error) {
  clt_field_bench bench = {0};
  clt_status status = clt_field_bench_init(&bench, shots, error);
  status = status == CLT_OK ? clt_exposure_base(&bench, seconds, findings, error) : status;
  clt_field_bench_finish(&bench);
  return status;
}

static clt_status judge(const clt_calibration *known, const clt_calibration *made, clt_error *error) {
  for (int k = 0; k < made->findings.count; k++) {
    if (made->findings.item[k].serious) {
      return clt_fail(error, CLT_FAILED, "%s", made->findings.item[k].text);
    }
  }
  if (made->info.covered < COVERED_LEAST * known->info.covered) {
    return clt_fail(error, CLT_FAILED,
                    "the camera sees %.0f %% of the panel where it saw %.0f %%: turn it back, clear its view, or run "
                    "counterlight calibrate",
                    100 * made->info.covered, 100 * known->info.covered);
  }
  return CLT_OK;
}

static clt_status measure(const clt_calibration *known, clt_shots *shots, clt_calibrate_options *options,
                          clt_calibration *made, clt_error *error) {
  const clt_calibration_info *info = &known->info;
  clt_geometry geometry = {0};
  clt_geometry_options how = {.response = info->camera, .progress = count_pictures, .context = options};
  clt_status status = check_devices(info, shots, error);
  clt_shots_calibrate(shots, info->black_level, info->full_well, info->read_noise);
  status = status == CLT_OK ? find_exposure(shots, &how.exposure_s, &made->findings, error) : status;
  status = status == CLT_OK ? clt_gray_init(&how.gray, info->panel_width, info->panel_height, error) : status;
  status = status == CLT_OK ? clt_geometry_measure(shots, &how, &geometry, &made->findings, error) : status;
  status = status == CLT_OK ? clt_calibration_take_geometry(made, &geometry, error) : status;
  clt_geometry_finish(&geometry);
  return status == CLT_OK ? judge(known, made, error) : status;
}

clt_status clt_calibrate_geometry(const clt_calibration *known, clt_projector *projector, clt_camera *camera,
                                  const clt_calibrate_options *options, clt_calibration **out, clt_error *error) {
  clt_calibrate_options how = options != NULL ? *options : (clt_calibrate_options){0};
  clt_shots shots;
  clt_calibration *made = clt_alloc(1, sizeof *made);
  *out = NULL;
  if (made == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a calibration");
  }
  made->info = known->info;
  clt_calibration_shots(&how, projector, camera, known->info.complete_s, &shots);
  clt_status status = measure(known, &shots, &how, made, error);
  if (status != CLT_OK) {
    clt_calibration_destroy(made);
    return status;
  }
  *out = made;
  return CLT_OK;
}

clt_status clt_calibration_moved(const clt_calibration *before, const clt_calibration *after, double *pixels,
                                 clt_error *error) {
  const clt_pixel_map *a = &before->map, *b = &after->map;
  size_t count = (size_t)a->width * (size_t)a->height, both = 0;
  if (a->width != b->width || a->height != b->height) {
    return clt_fail(error, CLT_BAD_INPUT, "calibrations of %d x %d and %d x %d camera pixels have no pixels in common",
                    a->width, a->height, b->width, b->height);
  }
  double *away = clt_alloc(count, sizeof *away);
  if (away == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the distances of %zu pixels", count);
  }
  for (size_t i = 0; i < count; i++) {
    if (a->fate[i] == CLT_PIXEL_DECODED && b->fate[i] == CLT_PIXEL_DECODED) {
      away[both++] = hypot((double)a->x[i] - (double)b->x[i], (double)a->y[i] - (double)b->y[i]);
    }
  }
  clt_sort_doubles(away, both);
  *pixels = both > 0 ? away[both / 2] / before->info.pitch : INFINITY;
  free(away);
  return CLT_OK;
}
