/* Measuring T through a rig, as acquire and demo do it. */
#include "cli/measure.h"

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
  config->acquire.journal = cli_value(command, arguments, "resume");
  return status ? status : cli_integer(command, arguments, "repeats", 1, 256, &config->acquire.repeats, error);
}

clt_status cli_measure(const clt_station_config *config, const clt_station *station, cli_progress *progress,
                       clt_transport **out, clt_error *error) {
  clt_acquire_options options = config->acquire;
  options.scheme = config->scheme[0] ? config->scheme : NULL;
  options.progress = cli_progress_acquire;
  options.context = progress;
  clt_status status = clt_acquire(station->rig, &options, out, error);
  return status == CLT_CANCELLED ? clt_fail(error, CLT_CANCELLED, "interrupted; nothing was written") : status;
}
