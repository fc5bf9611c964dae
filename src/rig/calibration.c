#include "rig/calibration.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/memory.h"

/* Before the latency is known: longer than any projector's and driver's together. */
#define LATENCY_AT_FIRST_S 0.5

/* A calibration under way. */
typedef struct measuring {
  clt_calibrate_options options;
  const char *phase;
  clt_shots shots;
  clt_photometry photometry;
  clt_geometry geometry;
  clt_calibration *made;
} measuring;

static bool report(void *context, int done, int total) {
  const measuring *m = context;
  return m->options.progress == NULL || m->options.progress(m->options.context, m->phase, done, total);
}

static clt_status begin_phase(measuring *m, const char *phase, clt_error *error) {
  m->phase = phase;
  return report(m, 0, 0) ? CLT_OK : clt_fail(error, CLT_CANCELLED, "the calibration was stopped before its %s", phase);
}

/* By an exposure that does not saturate, of at most a frame. */
static clt_status measure_latency(measuring *m, clt_error *error) {
  clt_latency *latency = &m->made->report->latency;
  clt_field_bench bench = {0};
  double seconds = 0;
  clt_findings ignored = {0}; /* photometry says them again */
  clt_status status = begin_phase(m, "latency", error);
  status = status == CLT_OK ? clt_field_bench_init(&bench, &m->shots, error) : status;
  status = status == CLT_OK ? clt_exposure_base(&bench, &seconds, &ignored, error) : status;
  clt_field_bench_finish(&bench);
  if (status != CLT_OK) {
    return status;
  }
  const clt_latency_options how = {
      .exposure_s = fmin(seconds, m->shots.sensor.frame_s), .seed = m->options.seed, .progress = report, .context = m};
  status = clt_latency_measure(&m->shots, &how, latency, &m->made->findings, error);
  m->shots.latency_s = status == CLT_OK ? latency->complete_s : m->shots.latency_s;
  return status;
}

static clt_status measure_photometry(measuring *m, clt_error *error) {
  const clt_photometry_options how = {.levels = m->options.levels,
                                      .frames = m->options.frames,
                                      .watch_s = m->options.watch_s,
                                      .progress = report,
                                      .context = m};
  clt_photometry_report *found = &m->made->report->photometry;
  clt_status status = begin_phase(m, "photometry", error);
  status = status == CLT_OK ? clt_photometry_measure(&m->shots, &how, &m->photometry, found, error) : status;
  for (int k = 0; k < found->findings.count; k++) {
    clt_findings_add(&m->made->findings, found->findings.item[k].serious, "%s", found->findings.item[k].text);
  }
  if (status == CLT_OK) {
    clt_shots_calibrate(&m->shots, m->photometry.black_level, m->photometry.full_well, m->photometry.read_noise);
  }
  return status;
}

static clt_status measure_geometry(measuring *m, clt_error *error) {
  clt_geometry_options how = {.exposure_s = m->made->report->photometry.base_s,
                              .response = m->photometry.camera,
                              .progress = report,
                              .context = m};
  clt_status status = begin_phase(m, "structured light", error);
  status = status == CLT_OK ? clt_gray_init(&how.gray, m->shots.panel.width, m->shots.panel.height, error) : status;
  return status == CLT_OK ? clt_geometry_measure(&m->shots, &how, &m->geometry, &m->made->findings, error) : status;
}

/* The panel pixels lo <= k < hi that lie half or more within pitch / 2 of a coordinate. */
static void reach(double at, double pitch, int size, int *low, int *high) {
  *low = (int)fmax(floor(at - 0.5 * pitch + 0.5), 0);
  *high = (int)fmin(floor(at + 0.5 * pitch + 0.5), size);
  if (*high <= *low && at >= 0 && at < size) {
    *low = (int)at;
    *high = *low + 1;
  }
}

clt_status clt_calibration_cover(const clt_pixel_map *map, double pitch, double *covered, clt_error *error) {
  size_t pixels = (size_t)map->width * (size_t)map->height;
  size_t panel = (size_t)map->panel_width * (size_t)map->panel_height, count = 0;
  uint8_t *seen = clt_alloc(panel, sizeof *seen);
  if (seen == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the coverage of %zu panel pixels", panel);
  }
  for (size_t i = 0; i < pixels; i++) {
    int left, right, top, bottom;
    if (map->fate[i] != CLT_PIXEL_DECODED) {
      continue;
    }
    reach((double)map->x[i], pitch, map->panel_width, &left, &right);
    reach((double)map->y[i], pitch, map->panel_height, &top, &bottom);
    for (int y = top; y < bottom && right > left; y++) {
      memset(seen + (size_t)y * (size_t)map->panel_width + (size_t)left, 1, (size_t)(right - left));
    }
  }
  for (size_t k = 0; k < panel; k++) {
    count += seen[k];
  }
  free(seen);
  *covered = (double)count / (double)panel;
  return CLT_OK;
}

clt_status clt_calibration_take_geometry(clt_calibration *made, clt_geometry *geometry, clt_error *error) {
  clt_calibration_info *info = &made->info;
  info->pitch = geometry->decode.pitch;
  info->decoded = geometry->decode.count[CLT_PIXEL_DECODED];
  info->calibrated = (int64_t)time(NULL);
  made->map = geometry->map;
  geometry->map = (clt_pixel_map){0};
  if (info->decoded == 0) {
    return clt_fail(error, CLT_FAILED, "%s",
                    made->findings.count > 0 ? made->findings.item[made->findings.count - 1].text
                                             : "no camera pixel was decoded");
  }
  return clt_calibration_cover(&made->map, info->pitch, &info->covered, error);
}

/* Moves what was measured into the calibration. */
static clt_status conclude(measuring *m, clt_error *error) {
  clt_calibration *made = m->made;
  clt_calibration_info *info = &made->info;
  const clt_photometry *photometry = &m->photometry;
  const clt_latency *latency = &made->report->latency;
  *info = (clt_calibration_info){.panel_width = m->shots.panel.width,
                                 .panel_height = m->shots.panel.height,
                                 .camera_width = m->shots.sensor.width,
                                 .camera_height = m->shots.sensor.height,
                                 .channels = m->shots.sensor.channels,
                                 .panel = photometry->panel,
                                 .camera = photometry->camera,
                                 .black_level = photometry->black_level,
                                 .full_well = photometry->full_well,
                                 .read_noise = photometry->read_noise,
                                 .exposure_count = photometry->exposure_count,
                                 .latency_s = latency->seconds,
                                 .jitter_s = latency->jitter_s,
                                 .complete_s = latency->complete_s};
  memcpy(info->black, photometry->black, sizeof info->black);
  memcpy(info->exposures_s, photometry->exposures_s, sizeof info->exposures_s);
  made->report->decode = m->geometry.decode;
  made->report->regions = m->geometry.regions;
  made->report->drift = m->geometry.drift;
  made->report->pictures = m->shots.shown;
  made->report->frames = m->shots.frames;
  made->report->retaken = m->shots.retaken;
  return clt_calibration_take_geometry(made, &m->geometry, error);
}

static clt_status measure(measuring *m, clt_error *error) {
  clt_status (*const steps[])(measuring *, clt_error *) = {measure_latency, measure_photometry, measure_geometry,
                                                           conclude};
  clt_status status = CLT_OK;
  for (size_t k = 0; k < sizeof steps / sizeof steps[0] && status == CLT_OK; k++) {
    status = steps[k](m, error);
  }
  clt_geometry_finish(&m->geometry);
  return status;
}

clt_status clt_calibrate(clt_projector *projector, clt_camera *camera, const clt_calibrate_options *options,
                         const char *source, clt_calibration **out, clt_error *error) {
  measuring m = {.options = options != NULL ? *options : (clt_calibrate_options){0}};
  int64_t started_ns = clt_clock_ns();
  m.made = clt_alloc(1, sizeof *m.made);
  if (m.made == NULL || (m.made->report = clt_alloc(1, sizeof *m.made->report)) == NULL) {
    clt_calibration_destroy(m.made);
    return clt_fail(error, CLT_FAILED, "out of memory for a calibration");
  }
  clt_calibration_shots(&m.options, projector, camera, LATENCY_AT_FIRST_S, &m.shots);
  clt_status status = measure(&m, error);
  if (status != CLT_OK) {
    clt_calibration_destroy(m.made);
    return status;
  }
  m.made->report->seconds = clt_clock_since(started_ns);
  snprintf(m.made->info.source, sizeof m.made->info.source, "%s", source != NULL ? source : "");
  *out = m.made;
  return CLT_OK;
}

void clt_calibration_destroy(clt_calibration *calibration) {
  if (calibration != NULL) {
    clt_pixel_map_finish(&calibration->map);
    free(calibration->report);
    free(calibration);
  }
}

clt_calibration_info clt_calibration_describe(const clt_calibration *calibration) {
  return calibration->info;
}

const char *clt_calibration_finding(const clt_calibration *calibration, int index, bool *serious) {
  if (index < 0 || index >= calibration->findings.count) {
    return NULL;
  }
  *serious = calibration->findings.item[index].serious;
  return calibration->findings.item[index].text;
}

void clt_calibration_apply(const clt_calibration *calibration, clt_rig_config *config) {
  const clt_calibration_info *info = &calibration->info;
  config->projector = info->panel;
  config->camera = info->camera;
  config->black_level = info->black_level;
  config->full_well = info->full_well;
  config->read_noise = info->read_noise;
  config->exposure_count = info->exposure_count;
  memcpy(config->exposures_s, info->exposures_s, sizeof config->exposures_s);
  config->latency_s = info->complete_s;
  config->calibration = calibration;
}
