/* Measuring T through a rig, as acquire and demo do it. */
#include "cli/measure.h"

#include <stdio.h>
#include <string.h>

clt_status cli_measure_options(const cli_command *command, const cli_arguments *arguments, clt_station_config *config,
                               clt_error *error) {
  const char *scheme = cli_value(command, arguments, "scheme");
  if (scheme) {
    if (strlen(scheme) >= sizeof config->scheme) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "--scheme: there is no scheme '%.40s'; take auto, brute, hadamard, hierarchical or blocks",
                      scheme);
    }
    strcpy(config->scheme, scheme);
  }
  clt_status status = cli_number(command, arguments, "threshold", 0, 0.5, &config->acquire.threshold, error);
  if (!status) {
    status = cli_number(command, arguments, "error", 0, 0.5, &config->acquire.error, error);
  }
  if (!status) {
    status = cli_number(command, arguments, "seconds", 0, 1e9, &config->acquire.seconds, error);
  }
  if (!status) {
    status = cli_integer(command, arguments, "watch", 0, 1000000, &config->acquire.watch, error);
  }
  if (!status) {
    status = cli_number(command, arguments, "patience", 0, 1e6, &config->acquire.patience_s, error);
  }
  config->acquire.journal = cli_value(command, arguments, "resume");
  if (!status) {
    status = cli_integer(command, arguments, "repeats", 1, 256, &config->acquire.repeats, error);
  }
  return status ? status : cli_station_options(command, arguments, config, error);
}

/* An option that names a file or folder of the station. */
static clt_status take_place(const cli_command *command, const cli_arguments *arguments, const char *option,
                             char place[CLT_PATH_MAX], clt_error *error) {
  const char *given = cli_value(command, arguments, option);
  if (given != NULL && strlen(given) >= CLT_PATH_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "--%s: the path is longer than %d characters", option, CLT_PATH_MAX - 1);
  }
  if (given != NULL) {
    strcpy(place, given);
  }
  return CLT_OK;
}

clt_status cli_station_options(const cli_command *command, const cli_arguments *arguments, clt_station_config *config,
                               clt_error *error) {
  const char *const names[] = {"calibration", "record", "replay"};
  char *const places[] = {config->calibration, config->record, config->replay};
  clt_status status = CLT_OK;
  for (size_t k = 0; k < sizeof names / sizeof names[0] && !status; k++) {
    status = take_place(command, arguments, names[k], places[k], error);
  }
  if (!status && (config->record[0] != '\0') + (config->replay[0] != '\0') + (config->acquire.journal != NULL) > 1) {
    status = clt_fail(error, CLT_BAD_INPUT,
                      "--record, --replay and --resume exclude each other: a recording is one whole acquisition");
  }
  return status;
}

static bool show_phase(void *context, const char *phase, int done, int total) {
  char note[96];
  int used = snprintf(note, sizeof note, "calibrating, %s", phase);
  if (total > 0) {
    snprintf(note + used, sizeof note - (size_t)used, ", picture %d of %d", done, total);
  }
  cli_progress_note(context, note);
  return !cli_interrupted();
}

static clt_status calibrate(const clt_station_config *config, cli_progress *progress, clt_station *station,
                            clt_error *error) {
  const clt_calibrate_options options = {.progress = show_phase, .context = progress};
  const clt_rig_config rig = clt_station_rig_config(config, station);
  clt_status status =
      clt_calibrate(station->projector, station->camera, &options, rig.source, &station->calibration, error);
  if (status == CLT_CANCELLED) {
    return clt_fail(error, CLT_CANCELLED, "interrupted; nothing was written");
  }
  bool serious = false;
  const char *finding = NULL;
  for (int k = 0; !status && !serious && (finding = clt_calibration_finding(station->calibration, k, &serious)); k++) {
  }
  if (!status && serious) {
    return clt_fail(error, CLT_FAILED, "calibrating the camera's pixels: %s", finding);
  }
  return status ? clt_fail_within(error, "calibrating the camera's pixels: ") : CLT_OK;
}

clt_status cli_station_open(const clt_station_config *config, cli_progress *progress, clt_station *station,
                            clt_error *error) {
  cli_progress_note(progress, "opening the devices");
  clt_status status = clt_station_open(config, station, error);
  if (status) {
    return status;
  }
  clt_camera_info sensor;
  station->camera->driver->describe(station->camera, &sensor);
  if (sensor.own_pixels && station->calibration == NULL) {
    status = calibrate(config, progress, station, error);
  }
  return status ? status : clt_station_open_rig(config, station, NULL, error);
}

clt_status cli_measure(const clt_station_config *config, const clt_station *station, cli_progress *progress,
                       clt_transport **out, clt_error *error) {
  clt_acquire_options options = config->acquire;
  options.scheme = config->scheme[0] ? config->scheme : NULL;
  options.recorded = config->replay[0] != '\0';
  options.progress = cli_progress_acquire;
  options.context = progress;
  clt_status status = clt_acquire(station->rig, &options, out, error);
  return status == CLT_CANCELLED ? clt_fail(error, CLT_CANCELLED, "interrupted; nothing was written") : status;
}
