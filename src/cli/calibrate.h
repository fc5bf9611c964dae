/* What both ways of `counterlight calibrate` share: the whole calibration on devices, and the geometry of pictures. */
#ifndef CLT_CLI_CALIBRATE_H
#define CLT_CLI_CALIBRATE_H

#include "cli/calibrate_report.h"
#include "cli/progress.h"
#include "counterlight/calibration.h"
#include "counterlight/station.h"

typedef struct cli_calibrate {
  const char *replay, *record, *reference; /* NULL where they were not given */
  char folder[CLT_PATH_MAX];
  clt_stereo stereo; /* of the reference */
  int panel_width, panel_height;
  clt_curve response; /* of pictures' camera */
  bool response_given;
  double exposure_s;             /* of the recorded frames to take; 0: the longest */
  clt_calibrate_options options; /* of the whole calibration */
  clt_station_config config;
  clt_station station;
  clt_projector *projector; /* replayed or recorded */
  clt_camera *camera;
  cli_calibration found;
  cli_progress progress;
} cli_calibrate;

/* Decodes the structured light of a replay into found. */
clt_status cli_calibrate_geometry(cli_calibrate *task, clt_error *error);
/* Calibrates on the station's devices, or on the recording of a whole calibration, into found.whole. */
clt_status cli_calibrate_whole(cli_calibrate *task, clt_error *error);

/* The lens of a calibration; false where none was measured. */
bool cli_calibration_lens(const clt_calibration_info *info, clt_lens *lens);
/* Takes over the lens of the calibration that is in the folder already, where that is of a camera of the same size, and
 * says so in the findings. CLT_FAILED where the path is too long. */
clt_status cli_calibrate_keep_lens(cli_calibrate *task, clt_error *error);
/* The lens by photographs of a chessboard, into a calibration that is there. An exit code. */
int cli_calibrate_lens(const cli_command *command, const cli_arguments *arguments);

#endif
