/* What calibrate found: files, JSON answer and printed lines. */
#ifndef CLT_CLI_CALIBRATE_REPORT_H
#define CLT_CLI_CALIBRATE_REPORT_H

#include <jansson.h>

#include "cli/command.h"
#include "rig/calibration.h"
#include "rig/geometry/epipolar.h"
#include "rig/geometry/geometry.h"

typedef struct cli_calibration {
  clt_calibration *whole; /* NULL where only the geometry was asked for; else the map below is its own */
  clt_geometry geometry;
  clt_epipolar epipolar;
  double roughness; /* of a whole calibration's map, panel pixels: how far decoded pixels lie from the middle of their
                       neighbours to the left and right, as the deviation of one that stands alone; 0: none decoded */
  clt_findings findings;
} cli_calibration;

/* Leaves map.npy, coverage.png and summary.json in folder, which is made, and of a whole calibration also
 * calibration.h5 and report.html; prints what --json and --quiet ask for. */
clt_status cli_calibration_write(const char *folder, const cli_calibration *found, const cli_arguments *arguments,
                                 clt_error *error);
/* All numbers of a whole calibration. */
json_t *cli_calibration_json(const char *folder, const cli_calibration *found);
/* Parts of it, and of the answer on pictures. */
json_t *cli_geometry_json(const cli_calibration *found);
json_t *cli_findings_json(const clt_findings *findings);

/* report.html of a whole calibration; coverage.png is in the folder. */
clt_status cli_calibration_page(const char *folder, const cli_calibration *found, clt_error *error);
/* Its drawings, as SVG elements. */
void cli_draw_responses(FILE *page, const clt_calibration_info *info);
void cli_draw_latency(FILE *page, const clt_latency *latency);

#endif
