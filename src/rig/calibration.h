/* The calibration from inside, and what was seen on the way to it. */
#ifndef CLT_RIG_CALIBRATION_H
#define CLT_RIG_CALIBRATION_H

#include "counterlight/calibration.h"
#include "rig/geometry/geometry.h"
#include "rig/photometry/photometry.h"
#include "rig/timing/flashes.h"

/* What only the report shows; a calibration that comes from a file has none. */
typedef struct clt_calibration_report {
  clt_latency latency;
  clt_photometry_report photometry;
  clt_decode_report decode;
  clt_regions regions;
  clt_drift drift;
  double seconds;        /* wall time */
  long pictures, frames; /* shown, used */
  long retaken;          /* frames that were refused */
} clt_calibration_report;

struct clt_calibration {
  clt_calibration_info info;
  clt_pixel_map map;
  clt_findings findings;
  clt_calibration_report *report; /* NULL where it was loaded */
};

/* Shots with the options' timeout and attempts, or 2 s and 3. */
void clt_calibration_shots(const clt_calibrate_options *options, clt_projector *projector, clt_camera *camera,
                           double latency_s, clt_shots *shots);
/* Moves the map into the calibration, with pitch, coverage and date. CLT_FAILED where no pixel was decoded, with the
 * last finding. */
clt_status clt_calibration_take_geometry(clt_calibration *made, clt_geometry *geometry, clt_error *error);

/* Share of the panel's pixels that some decoded camera pixel sees, each taken as a square of pitch panel pixels. */
clt_status clt_calibration_cover(const clt_pixel_map *map, double pitch, double *covered, clt_error *error);

#endif
