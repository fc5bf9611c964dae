/* calibrate on devices, or on the recording of such a calibration. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"
#include "cli/calibrate.h"
#include "counterlight/replay.h"

static bool show_progress(void *context, const char *phase, int done, int total) {
  cli_calibrate *t = context;
  return cli_progress_count(&t->progress, phase, done, total);
}

/* The devices that frames come from, and what the file says of them. */
static clt_status open_devices(cli_calibrate *t, char *source, size_t room, clt_error *error) {
  cli_progress_note(&t->progress, "opening the devices");
  if (t->replay != NULL) {
    snprintf(source, room, "replay of %s", t->replay);
    return clt_replay_open(t->replay, &t->projector, &t->camera, error);
  }
  clt_status status = clt_station_open(&t->config, &t->station, error);
  if (status) {
    return status;
  }
  snprintf(source, room, "%s projector, %s camera", t->config.projector.driver, t->config.camera.driver);
  if (t->station.scene != NULL) {
    clt_rig_config rig;
    clt_scene_rig_config(t->station.scene, &rig);
    snprintf(source, room, "%s", rig.source);
  }
  return t->record != NULL
             ? clt_recording_open(t->record, t->station.projector, t->station.camera, &t->projector, &t->camera, error)
             : CLT_OK;
}

/* Of a pixel less the mean of two others, all of deviation s, the deviation is s sqrt(3/2); half of the absolute values
 * of a Gaussian are under 0.6745 of its deviation. */
static double map_roughness(const clt_pixel_map *map) {
  size_t width = (size_t)map->width, pixels = width * (size_t)map->height, count = 0;
  double *away = clt_alloc(pixels > 0 ? pixels : 1, sizeof *away), median = 0;
  for (size_t i = 1; away != NULL && i + 1 < pixels; i++) {
    bool inner = i % width > 0 && i % width + 1 < width;
    if (inner && map->fate[i - 1] == CLT_PIXEL_DECODED && map->fate[i] == CLT_PIXEL_DECODED &&
        map->fate[i + 1] == CLT_PIXEL_DECODED) {
      away[count++] =
          fabs((double)map->x[i] - 0.5 * ((double)map->x[i - 1] + (double)map->x[i + 1])) / (0.6745 * sqrt(1.5));
    }
  }
  if (count > 0) {
    clt_sort_doubles(away, count);
    median = away[count / 2];
  }
  free(away);
  return median;
}

clt_status cli_calibrate_whole(cli_calibrate *t, clt_error *error) {
  char source[CLT_MESSAGE_MAX / 4];
  clt_status status = open_devices(t, source, sizeof source, error);
  if (status) {
    return status;
  }
  t->options.progress = show_progress;
  t->options.context = t;
  t->options.timeout_s = t->config.rig.timeout_s;
  t->options.attempts = t->config.rig.attempts;
  bool stand_in = t->projector != NULL;
  status = clt_calibrate(stand_in ? t->projector : t->station.projector, stand_in ? t->camera : t->station.camera,
                         &t->options, source, &t->found.whole, error);
  if (status) {
    return status;
  }
  const clt_calibration *whole = t->found.whole;
  t->found.geometry = (clt_geometry){.map = whole->map,
                                     .decode = whole->report->decode,
                                     .regions = whole->report->regions,
                                     .drift = whole->report->drift};
  t->found.roughness = map_roughness(&whole->map);
  t->found.findings = whole->findings;
  return CLT_OK;
}
