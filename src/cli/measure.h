/* Measuring T through a rig, as acquire and demo do it. */
#ifndef CLT_CLI_MEASURE_H
#define CLT_CLI_MEASURE_H

#include "cli/command.h"
#include "cli/progress.h"
#include "counterlight/station.h"
#include "counterlight/transport.h"

/* Changes config by the command's --scheme --threshold --error --seconds --resume --repeats (those that it has and that
 * were given). */
clt_status cli_measure_options(const cli_command *command, const cli_arguments *arguments, clt_station_config *config,
                               clt_error *error);
/* The same by --calibration --record --replay. */
clt_status cli_station_options(const cli_command *command, const cli_arguments *arguments, clt_station_config *config,
                               clt_error *error);
/* Opens the station and its rig. A camera with pixels of its own and no calibration is calibrated before (the station
 * then holds the calibration); CLT_FAILED where that finds something seriously wrong. On failure the station is to be
 * closed too. */
clt_status cli_station_open(const clt_station_config *config, cli_progress *progress, clt_station *station,
                            clt_error *error);
/* Measures T through the station's rig as config says, drawing progress. *out is the caller's. CLT_CANCELLED where
 * Ctrl-C came. */
clt_status cli_measure(const clt_station_config *config, const clt_station *station, cli_progress *progress,
                       clt_transport **out, clt_error *error);

#endif
