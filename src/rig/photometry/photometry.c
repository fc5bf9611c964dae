#include "rig/photometry/photometry.h"

#include <math.h>
#include <string.h>

/* Limits from which a measurement becomes a finding. */
#define RESIDUAL_LIMIT 0.003
#define ADDITIVITY_LIMIT 0.02
#define FALL_LIMIT 0.01
#define DRIFT_LIMIT 0.02
#define MISFIT_LIMIT 4.0
#define BLACK_LIMIT 0.05

static void judge_camera(const clt_photometry_report *report, clt_findings *findings) {
  if (report->camera.residual > RESIDUAL_LIMIT) {
    clt_findings_add(findings, true,
                     "samples are no function of light times exposure (off by %.1f %%): gain or exposure is automatic, "
                     "or the picture is processed; lock both and switch processing off",
                     100 * report->camera.residual);
  }
  if (report->noise.misfit > MISFIT_LIMIT) {
    clt_findings_add(findings, false,
                     "the noise does not grow with light as photons do (%.0f times its uncertainty off); switch noise "
                     "reduction and sharpening off",
                     report->noise.misfit);
  }
}

static void judge_projector(const clt_photometry_report *report, int channels, clt_findings *findings) {
  const clt_projector_photometry *projector = &report->projector;
  if (fabs(projector->additivity) > ADDITIVITY_LIMIT && channels > 1) {
    clt_findings_add(findings, true,
                     "white is %.1f %% %s than red, green and blue together: switch off the projector's brilliant "
                     "colour, white boost and dynamic contrast",
                     100 * fabs(projector->additivity), projector->additivity > 0 ? "brighter" : "darker");
  }
  if (projector->largest_fall > FALL_LIMIT) {
    clt_findings_add(findings, true,
                     "a higher code gave %.1f %% less light: switch off the projector's picture processing (dynamic "
                     "contrast, iris)",
                     100 * projector->largest_fall);
  }
  if (projector->drift > DRIFT_LIMIT) {
    clt_findings_add(findings, false, "the lamp drifted by %.1f %% in %.0f s; let it warm up for 20 minutes",
                     100 * projector->drift, projector->seconds);
  }
  double black = fmax(projector->black[0], fmax(projector->black[1], projector->black[2]));
  if (black > BLACK_LIMIT) {
    clt_findings_add(findings, false, "black is %.1f %% of white: darken the room", 100 * black);
  }
  if (report->flicker.hz > 0) {
    clt_findings_add(
        findings, false,
        "the room's light flickers by %.0f %% at %.0f Hz; exposures are whole periods of it where they can "
        "be",
        100 * report->flicker.depth, report->flicker.hz);
  }
}

typedef enum step { BASE, GROUPS, LOCKS, BLACK_LEVEL, RESPONSE, NOISE, RAMPS, FLICKER, STEPS } step;

/* Fields that are still to come with a step and all after it, about: those of the locks and the ramps by their options.
 */
static void expect(clt_field_bench *bench, const clt_photometry_options *options, step next) {
  const int fields[STEPS] = {[BASE] = 8,
                             [GROUPS] = 2,
                             [LOCKS] = clt_locks_fields(options->watch_s),
                             [BLACK_LEVEL] = 2,
                             [RESPONSE] = CLT_BRACKET_FIELDS * CLT_BRACKET_EXPOSURES,
                             [NOISE] = CLT_NOISE_LEVELS + CLT_NOISE_DARKS,
                             [RAMPS] = clt_projector_fields(bench->channels, options->levels),
                             [FLICKER] = CLT_FLICKER_FRAMES + 1};
  bench->expected = bench->done;
  for (step k = next; k < STEPS; k++) {
    bench->expected += fields[k];
  }
}

/* The camera: locks, black level, response, noise. */
static clt_status measure_camera(clt_field_bench *bench, const clt_photometry_options *options, clt_photometry *out,
                                 clt_photometry_report *report, clt_error *error) {
  clt_findings *findings = &report->findings;
  expect(bench, options, BASE);
  clt_status status = clt_exposure_base(bench, &report->base_s, findings, error);
  status = status == CLT_OK ? clt_field_find_groups(bench, report->base_s, options->frames, error) : status;
  report->lit = bench->lit;
  expect(bench, options, LOCKS);
  if (status == CLT_OK && options->watch_s > 0) {
    status = clt_locks_check(bench, report->base_s, options->watch_s, &report->locks, findings, error);
  }
  expect(bench, options, BLACK_LEVEL);
  status = status == CLT_OK ? clt_sensor_black_level(bench, options->frames, &out->black_level, error) : status;
  if (status == CLT_OK) {
    clt_field_set_response(bench, out->black_level, &(clt_curve){.kind = CLT_CURVE_LINEAR});
    status = clt_camera_response_measure(bench, report->base_s, options->frames, &report->camera, error);
  }
  if (status == CLT_OK) {
    out->camera = report->camera.curve;
    clt_field_set_response(bench, out->black_level, &out->camera);
    expect(bench, options, NOISE);
    status = clt_sensor_noise_measure(bench, report->base_s, options->frames, &report->noise, error);
  }
  out->full_well = report->noise.full_well;
  out->read_noise = report->noise.read_noise;
  return status;
}

/* The exposures for what the projector and the room were found to be. */
static clt_status choose_exposures(clt_field_bench *bench, const clt_photometry_options *options, clt_photometry *out,
                                   clt_photometry_report *report, clt_error *error) {
  static const double white[CLT_FIELD_CHANNELS] = {1, 1, 1};
  const clt_camera_info *sensor = &bench->shots->sensor;
  clt_field field;
  expect(bench, options, FLICKER);
  clt_status status =
      clt_flicker_measure(bench, fmax(0.25 * report->base_s, sensor->exposure_min_s), &report->flicker, error);
  status = status == CLT_OK ? clt_field_see(bench, white, report->base_s, options->frames, &field, error) : status;
  if (status != CLT_OK) {
    return status;
  }
  double full = (1 << sensor->bits) - 1;
  double brightest =
      clt_curve_decode(&out->camera, (field.brightest * full - out->black_level) / (full - out->black_level));
  double mean = 0, darkest = INFINITY;
  for (int c = 0; c < bench->channels; c++) {
    mean = field.light[c] / field.seconds;
    darkest = fmin(darkest, fmax(out->black[c], 1e-4) * mean);
  }
  clt_exposure_needs needs = {.brightest = brightest / field.seconds,
                              .darkest = darkest,
                              .snr = options->snr,
                              .full_well = out->full_well,
                              .read_noise = out->read_noise,
                              .refresh_s = bench->shots->panel.refresh_s,
                              .flicker_hz = report->flicker.hz,
                              .least_s = sensor->exposure_min_s,
                              .most_s = sensor->exposure_max_s};
  clt_exposures_choose(&needs, &report->exposures);
  out->exposure_count = report->exposures.count;
  memcpy(out->exposures_s, report->exposures.seconds, sizeof out->exposures_s);
  return CLT_OK;
}

static clt_photometry_options complete(const clt_photometry_options *options) {
  clt_photometry_options whole = *options;
  whole.levels = whole.levels > 0 ? whole.levels : 33;
  whole.frames = whole.frames > 0 ? whole.frames : 6;
  whole.watch_s = whole.watch_s != 0 ? whole.watch_s : 20;
  whole.snr = whole.snr > 0 ? whole.snr : 40;
  return whole;
}

clt_status clt_photometry_measure(clt_shots *shots, const clt_photometry_options *options, clt_photometry *out,
                                  clt_photometry_report *report, clt_error *error) {
  clt_photometry_options whole = complete(options);
  clt_field_bench bench = {0};
  long before = shots->frames;
  *out = (clt_photometry){0};
  *report = (clt_photometry_report){0};
  if ((shots->sensor.channels != 1 && shots->sensor.channels != CLT_FIELD_CHANNELS) ||
      shots->panel.channels != shots->sensor.channels) {
    return clt_fail(error, CLT_BAD_INPUT, "the projector has %d channels, the camera %d; both need 1, or both 3",
                    shots->panel.channels, shots->sensor.channels);
  }
  clt_status status = clt_field_bench_init(&bench, shots, error);
  bench.progress = whole.progress;
  bench.context = whole.context;
  status = status == CLT_OK ? measure_camera(&bench, &whole, out, report, error) : status;
  if (status == CLT_OK) {
    judge_camera(report, &report->findings);
    expect(&bench, &whole, RAMPS);
    status = clt_projector_measure(&bench, report->base_s, whole.levels, whole.frames, &report->projector, error);
  }
  if (status == CLT_OK) {
    out->panel = report->projector.panel;
    memcpy(out->black, report->projector.black, sizeof out->black);
    status = choose_exposures(&bench, &whole, out, report, error);
  }
  if (status == CLT_OK) {
    judge_projector(report, bench.channels, &report->findings);
  }
  report->frames = shots->frames - before;
  clt_field_bench_finish(&bench);
  return status;
}

void clt_photometry_apply(const clt_photometry *photometry, clt_rig_config *config) {
  config->projector = photometry->panel;
  config->camera = photometry->camera;
  config->black_level = photometry->black_level;
  config->full_well = photometry->full_well;
  config->read_noise = photometry->read_noise;
  config->exposure_count = photometry->exposure_count;
  memcpy(config->exposures_s, photometry->exposures_s, sizeof config->exposures_s);
}
