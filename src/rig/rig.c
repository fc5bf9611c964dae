#include "counterlight/rig.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "counterlight/transport.h"
#include "rig/calibration.h"
#include "rig/internal.h"
#include "rig/timing/patch.h"

static double find_longest(const clt_camera_rig *rig) {
  double longest = 0;
  for (int k = 0; k < rig->config.exposure_count; k++) {
    longest = fmax(longest, rig->config.exposures_s[k]);
  }
  return longest;
}

static void describe_rig(const clt_rig *base, clt_rig_info *info) {
  const clt_camera_rig *rig = (const clt_camera_rig *)base;
  *info = (clt_rig_info){.width = rig->config.width,
                         .height = rig->config.height,
                         .channels = rig->shots.sensor.channels,
                         .response = rig->response,
                         .source = rig->config.source,
                         .patterns = rig->shots.shown,
                         .frames = rig->shots.frames,
                         .doubted = rig->doubted,
                         .repeated = rig->shots.stuck,
                         .strange = rig->strange,
                         .torn = rig->torn,
                         .seconds = (double)rig->shots.last_ns * 1e-9,
                         .panel = &rig->config.projector,
                         .panel_bits = rig->shots.panel.bits,
                         .rounding = clt_merge_rounding(&rig->merge, find_longest(rig))};
}

static void close_rig(clt_rig *base) {
  clt_camera_rig *rig = (clt_camera_rig *)base;
  if (rig != NULL) {
    clt_merge_finish(&rig->merge);
    clt_agreement_finish(&rig->agreement);
    clt_footprints_finish(&rig->footprints);
    free(rig->codes);
    free(rig);
  }
}

static const clt_rig_operations camera_rig_operations = {describe_rig, clt_camera_rig_observe, close_rig};

static clt_status check_sizes(const clt_camera_rig *rig, clt_error *error) {
  const clt_rig_config *config = &rig->config;
  const clt_projector_info *panel = &rig->shots.panel;
  const clt_camera_info *sensor = &rig->shots.sensor;
  if (config->width < 1 || config->height < 1 || config->width > CLT_GRID_SIDE_MAX ||
      config->height > CLT_GRID_SIDE_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "a grid of %d x %d cells; each side is 1 to %d", config->width,
                    config->height, CLT_GRID_SIDE_MAX);
  }
  if (panel->width % config->width != 0 || panel->height % config->height != 0) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the panel's %d x %d pixels are no whole multiple of the grid's %d x %d cells; choose a grid that "
                    "divides it",
                    panel->width, panel->height, config->width, config->height);
  }
  if (panel->channels != sensor->channels) {
    return clt_fail(error, CLT_BAD_INPUT, "the projector has %d channels, the camera %d; they must match",
                    panel->channels, sensor->channels);
  }
  if (sensor->bits < 1 || sensor->bits > 16 || !(sensor->responsivity > 0) || !(sensor->full_well > 0)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the camera has %d bits, responsivity %g, full well %g; legal are 1 to 16 bits and values above 0",
                    sensor->bits, sensor->responsivity, sensor->full_well);
  }
  return CLT_OK;
}

static clt_status check_timing(const clt_camera_rig *rig, clt_error *error) {
  const clt_rig_config *config = &rig->config;
  if (config->exposure_count < 1 || config->exposure_count > CLT_EXPOSURES_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%d exposures; legal are 1 to %d", config->exposure_count, CLT_EXPOSURES_MAX);
  }
  for (int k = 0; k < config->exposure_count; k++) {
    double seconds = config->exposures_s[k];
    if (!(seconds >= rig->shots.sensor.exposure_min_s && seconds <= rig->shots.sensor.exposure_max_s)) {
      return clt_fail(error, CLT_BAD_INPUT, "an exposure of %g ms; the camera takes %g to %g ms", seconds * 1e3,
                      rig->shots.sensor.exposure_min_s * 1e3, rig->shots.sensor.exposure_max_s * 1e3);
    }
    if (k > 0 && !(seconds > config->exposures_s[k - 1])) {
      return clt_fail(error, CLT_BAD_INPUT, "exposures of %g and %g ms in this order; they must ascend",
                      config->exposures_s[k - 1] * 1e3, seconds * 1e3);
    }
  }
  if (!(config->latency_s >= 0) || !(config->timeout_s > 0) || config->attempts < 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "latency %g ms, timeout %g ms, %d attempts; the latency is at least 0, the timeout above 0, and "
                    "there is at least one attempt",
                    config->latency_s * 1e3, config->timeout_s * 1e3, config->attempts);
  }
  return CLT_OK;
}

/* By the calibration's pixel map, or whole pixels a cell. */
static clt_status lay_footprints(clt_camera_rig *rig, clt_error *error) {
  const clt_rig_config *config = &rig->config;
  const clt_camera_info *sensor = &rig->shots.sensor;
  const clt_projector_info *panel = &rig->shots.panel;
  clt_footprint_report report;
  if (config->calibration == NULL && sensor->own_pixels) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "this camera has pixels of its own: calibrate first (counterlight calibrate); which of its %d x %d "
                    "pixels see which cell is not known",
                    sensor->width, sensor->height);
  }
  if (config->calibration == NULL) {
    return clt_footprints_align(config->width, config->height, sensor->width, sensor->height, &rig->footprints, error);
  }
  const clt_pixel_map *map = &config->calibration->map;
  if (map->width != sensor->width || map->height != sensor->height || map->panel_width != panel->width ||
      map->panel_height != panel->height) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the calibration is of %d x %d camera and %d x %d panel pixels, the devices have %d x %d and "
                    "%d x %d; calibrate again",
                    map->width, map->height, map->panel_width, map->panel_height, sensor->width, sensor->height,
                    panel->width, panel->height);
  }
  return clt_footprints_map(map, config->calibration->info.pitch, config->width, config->height, &rig->footprints, NULL,
                            &report, error);
}

static clt_status prepare_rig(clt_camera_rig *rig, clt_error *error) {
  const clt_rig_config *config = &rig->config;
  clt_status status = check_sizes(rig, error);
  if (status == CLT_OK) {
    status = check_timing(rig, error);
  }
  if (status == CLT_OK) {
    status = clt_patch_check(&config->patch, config->width, config->height, error);
  }
  if (status == CLT_OK) {
    status = lay_footprints(rig, error);
  }
  if (status == CLT_OK) {
    status = clt_merge_init(&rig->merge, &rig->shots.sensor, &config->camera, &rig->footprints, config->exposure_count,
                            error);
  }
  if (status == CLT_OK && config->verify && config->exposure_count > 1) {
    status = clt_agreement_init(&rig->agreement, config->width, config->height, rig->shots.sensor.channels, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  clt_curve_format(&config->projector.response[0], rig->response, sizeof rig->response);
  const clt_projector_info *panel = &rig->shots.panel;
  size_t pixels = (size_t)panel->width * (size_t)panel->height;
  rig->codes = clt_alloc(pixels * (size_t)panel->channels, sizeof *rig->codes);
  return rig->codes != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for a panel of %zu pixels", pixels);
}

clt_status clt_rig_open(const clt_rig_config *config, clt_projector *projector, clt_camera *camera, clt_rig **out,
                        clt_error *error) {
  clt_camera_rig *rig = clt_alloc(1, sizeof *rig);
  if (rig == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a rig");
  }
  rig->base.operations = &camera_rig_operations;
  rig->config = *config;
  clt_shots_init(&rig->shots, projector, camera, config->latency_s, config->timeout_s, config->attempts);
  if (config->full_well > 0) {
    clt_shots_calibrate(&rig->shots, config->black_level, config->full_well, config->read_noise);
  }
  clt_status status = prepare_rig(rig, error);
  if (status != CLT_OK) {
    close_rig(&rig->base);
    return status;
  }
  *out = &rig->base;
  return CLT_OK;
}
