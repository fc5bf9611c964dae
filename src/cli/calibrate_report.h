/* What calibrate found: files, JSON answer and printed lines. */
#ifndef CLT_CLI_CALIBRATE_REPORT_H
#define CLT_CLI_CALIBRATE_REPORT_H

#include "cli/command.h"
#include "rig/geometry/epipolar.h"
#include "rig/geometry/geometry.h"

typedef struct cli_calibration {
  clt_geometry geometry;
  clt_epipolar epipolar;
  clt_findings findings;
} cli_calibration;

/* Leaves map.npy, coverage.png and summary.json in folder, which is made, and prints what --json and --quiet ask for.
 */
clt_status cli_calibration_write(const char *folder, const cli_calibration *found, const cli_arguments *arguments,
                                 clt_error *error);

#endif
