/* The demo's light path: measure, solve, project, photograph, judge. The scene's own transport and radiance come in
 * only after the drive is made, as the reference that the report quotes; nothing feeds back. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "base/order.h"
#include "cli/demo.h"
#include "cli/measure.h"
#include "cli/target.h"

static clt_status open_station(demo *d, clt_error *error) {
  int64_t start = clt_clock_ns();
  clt_status status = cli_station_open(&d->config, &d->progress, &d->station, error);
  if (status) {
    return status;
  }
  clt_rig_info info;
  d->station.rig->operations->describe(d->station.rig, &info);
  d->grid = (cli_grid){info.width, info.height, info.channels};
  d->timings.scene = clt_clock_since(start);
  d->panel = clt_station_rig_config(&d->config, &d->station).projector;
  return CLT_OK;
}

static clt_status load_picture(demo *d, clt_error *error) {
  return d->target_path ? cli_picture_read(d->target_path, NULL, &d->grid, &d->picture, error)
                        : cli_target_draw(&d->grid, &d->picture, error);
}

static clt_status measure(demo *d, clt_error *error) {
  int64_t start = clt_clock_ns();
  clt_status status = cli_measure(&d->config, &d->station, &d->progress, &d->transport, error);
  d->timings.acquire = clt_clock_since(start);
  return status;
}

static clt_status solve(demo *d, clt_error *error) {
  int64_t start = clt_clock_ns();
  double white[CLT_CHANNELS_MAX];
  cli_progress_note(&d->progress, "solving");
  clt_status status = clt_certify(d->transport, &d->certificate, error);
  d->timings.certify = clt_clock_since(start);
  if (!status) {
    status = clt_target(d->transport, d->certificate, &d->picture, &d->white, &d->target, white, error);
  }
  return status ? status
                : clt_compensate(d->transport, d->certificate, &d->picture, &d->white, &(clt_solve_options){0}, false,
                                 &d->drive, &d->result, error);
}

static clt_status draw_error_map(const demo *d, demo_sight *sight, clt_error *error) {
  clt_status status = clt_image_init(&sight->error_map, 1, d->grid.height, d->grid.width, error);
  if (status) {
    return status;
  }
  size_t cells = (size_t)d->grid.width * (size_t)d->grid.height;
  for (size_t i = 0; i < cells; i++) {
    double sum = 0;
    for (int c = 0; c < d->grid.channels; c++) {
      size_t at = (size_t)c * cells + i;
      double off = (sight->gain * sight->radiance.data[at] - d->target.data[at]) / d->result.white[c];
      sum += off * off;
    }
    sight->error_map.data[i] = (float)sqrt(sum / d->grid.channels);
  }
  return CLT_OK;
}

/* The mean of several observations: noise of the photograph is no error of the compensation. */
static clt_status observe_mean(const demo *d, const clt_image *drive, clt_image *mean, clt_error *error) {
  const cli_grid *g = &d->grid;
  clt_image seen = {0}, deviation = {0};
  clt_status status = clt_image_init(mean, g->channels, g->height, g->width, error);
  if (!status) {
    status = clt_image_init(&seen, g->channels, g->height, g->width, error);
  }
  if (!status) {
    status = clt_image_init(&deviation, g->channels, g->height, g->width, error);
  }
  size_t count = clt_image_size(mean);
  for (int k = 0; !status && k < DEMO_OBSERVATIONS; k++) {
    status = d->station.rig->operations->observe(d->station.rig, drive, &seen, &deviation, error);
    for (size_t i = 0; !status && i < count; i++) {
      mean->data[i] += seen.data[i] / DEMO_OBSERVATIONS;
    }
  }
  clt_image_finish(&seen);
  clt_image_finish(&deviation);
  return status;
}

/* Projects a drive and photographs it through the rig. fit_gain: judged at its best brightness. */
static clt_status photograph(const demo *d, const clt_image *drive, bool fit_gain, demo_sight *sight,
                             clt_error *error) {
  clt_image exact = {0};
  clt_status status = observe_mean(d, drive, &sight->radiance, error);
  if (!status) {
    status = clt_scene_appearance(d->station.scene, drive, &exact, error);
  }
  if (!status) {
    sight->gain = fit_gain ? clt_best_gain(d->certificate, &sight->radiance, &d->target) : 1;
    sight->error = clt_appearance_error(d->certificate, &sight->radiance, &d->target, fit_gain);
    sight->exact_error = clt_appearance_error(d->certificate, &exact, &d->target, fit_gain);
    status = draw_error_map(d, sight, error);
  }
  clt_image_finish(&exact);
  return status;
}

static clt_status photograph_both(demo *d, clt_error *error) {
  int64_t start = clt_clock_ns();
  clt_image plain = {0};
  cli_progress_note(&d->progress, "photographing");
  clt_status status = clt_image_convert(&d->picture, d->grid.channels, &plain, error);
  if (status) {
    return status;
  }
  size_t count = clt_image_size(&plain);
  for (size_t i = 0; i < count; i++) {
    plain.data[i] = fminf(fmaxf(plain.data[i], 0), 1);
  }
  status = photograph(d, &plain, true, &d->before, error);
  if (!status) {
    status = photograph(d, &d->drive, false, &d->after, error);
  }
  clt_image_finish(&plain);
  d->timings.photograph = clt_clock_since(start);
  return status;
}

/* The least error that any drive in 0..1 could reach in this room: the bounded optimum on the scene's exact transport,
 * for the same wanted radiance (a picture with white 1). A reference for the report. */
static clt_status find_limit(demo *d, clt_error *error) {
  int64_t start = clt_clock_ns();
  clt_certificate *certificate = NULL;
  clt_compensation best;
  clt_image drive = {0};
  const clt_transport *exact = clt_scene_transport(d->station.scene);
  clt_white white = {.kind = CLT_WHITE_VALUE, .value = 1};
  cli_progress_note(&d->progress, "computing the limit");
  clt_status status = clt_certify(exact, &certificate, error);
  if (!status) {
    status =
        clt_compensate(exact, certificate, &d->target, &white, &(clt_solve_options){0}, true, &drive, &best, error);
  }
  if (!status) {
    d->error_limit = best.error_limit;
  }
  clt_image_finish(&drive);
  clt_certificate_destroy(certificate);
  d->timings.reference = clt_clock_since(start);
  return status;
}

/* The 99.5th percentile of the map before: a few outliers do not darken the rest. */
static clt_status choose_map_top(demo *d, clt_error *error) {
  size_t cells = clt_image_size(&d->before.error_map);
  float *sorted = clt_alloc(cells, sizeof *sorted);
  if (!sorted) {
    return clt_fail(error, CLT_FAILED, "out of memory for %zu cells", cells);
  }
  memcpy(sorted, d->before.error_map.data, cells * sizeof *sorted);
  clt_sort_floats(sorted, cells);
  double top = sorted[(size_t)(0.995 * (double)(cells - 1))];
  d->map_top = top > 0 ? top : 1;
  free(sorted);
  return CLT_OK;
}

clt_status demo_run(demo *d, clt_error *error) {
  static clt_status (*const steps[])(demo *, clt_error *) = {
      open_station, load_picture, measure, solve, photograph_both, find_limit, choose_map_top, demo_race_methods};
  int64_t start = clt_clock_ns();
  clt_status status = CLT_OK;
  for (size_t i = 0; !status && i < sizeof steps / sizeof *steps; i++) {
    status = steps[i](d, error);
    if (!status) {
      status = cli_check_interrupt(error);
    }
  }
  d->timings.total = clt_clock_since(start);
  return status;
}

void demo_finish(demo *d) {
  clt_image *const images[] = {&d->picture,          &d->target,         &d->drive,          &d->before.radiance,
                               &d->before.error_map, &d->after.radiance, &d->after.error_map};
  for (size_t i = 0; i < sizeof images / sizeof *images; i++) {
    clt_image_finish(images[i]);
  }
  clt_certificate_destroy(d->certificate);
  clt_transport_destroy(d->transport);
  clt_station_close(&d->station);
}
