/* Photometry: everything between a code of the panel and a sample of the camera that is no geometry, measured by
 * uniform fields on the devices as they stand. */
#ifndef CLT_RIG_PHOTOMETRY_PHOTOMETRY_H
#define CLT_RIG_PHOTOMETRY_PHOTOMETRY_H

#include "counterlight/panel.h"
#include "counterlight/rig.h"
#include "rig/photometry/camera_response.h"
#include "rig/photometry/exposures.h"
#include "rig/photometry/locks.h"
#include "rig/photometry/projector.h"
#include "rig/photometry/sensor.h"

/* What a rig is opened with afterwards: plain data. */
typedef struct clt_photometry {
  clt_panel panel;
  clt_curve camera;
  double black[CLT_PANEL_CHANNELS]; /* light of the dark panel, ambient included, over that of the white one */
  double black_level;               /* code values */
  double full_well, read_noise;     /* electrons */
  double exposures_s[CLT_EXPOSURES_MAX];
  int exposure_count;
} clt_photometry;

typedef struct clt_photometry_options {
  int levels;     /* of a ramp, 17..65; 0 means 33 */
  int frames;     /* averaged for each field, 1..64; 0 means 6; a multiple of 3 averages flicker out */
  double watch_s; /* for which the locks are watched; 0 means 20, negative not at all */
  double snr;     /* wanted of one pixel at the dark panel's light by the longest exposure; 0 means 40 */
  bool (*progress)(void *context, int done, int total); /* of fields, about; false stops (CLT_CANCELLED). May be NULL */
  void *context;
} clt_photometry_options;

/* What was seen on the way. */
typedef struct clt_photometry_report {
  double base_s; /* exposure at which the fields were measured */
  size_t lit;    /* camera pixels that they were measured with */
  clt_locks locks;
  clt_camera_response camera;
  clt_sensor_noise noise;
  clt_projector_photometry projector;
  clt_flicker flicker;
  clt_exposure_choice exposures;
  long frames;
  clt_findings findings;
} clt_photometry_report;

/* Measures it all. Findings are there after a failure too, as far as it came. CLT_FAILED says what cannot be measured
 * and what to do; CLT_TIMEOUT and CLT_GONE as clt_shots_take. */
clt_status clt_photometry_measure(clt_shots *shots, const clt_photometry_options *options, clt_photometry *out,
                                  clt_photometry_report *report, clt_error *error);

/* Puts what was measured into the settings of a rig. */
void clt_photometry_apply(const clt_photometry *photometry, clt_rig_config *config);

#endif
