/* Which exposures to take, from what is seen. */
#ifndef CLT_RIG_PHOTOMETRY_EXPOSURES_H
#define CLT_RIG_PHOTOMETRY_EXPOSURES_H

#include "rig/finding.h"
#include "rig/merge.h"
#include "rig/photometry/field.h"

/* The longest exposure of 1, 2, 3, 4, 6, 8, 12, ... refresh periods (at most a second) that leaves the white panel
 * unsaturated; less than a period, with a finding, where a whole one is too bright. */
clt_status clt_exposure_base(clt_field_bench *bench, double *base_s, clt_findings *findings, clt_error *error);

/* Light that varies with the mains, as the dark panel shows it. */
typedef struct clt_flicker {
  double hz;    /* 100 or 120; 0: none was seen */
  double depth; /* amplitude over the dark panel's mean */
} clt_flicker;
enum { CLT_FLICKER_FRAMES = 24 };
/* Fits sines of 100 and 120 Hz to the mean light of so many short frames in a row. Flicker that the frame rate divides
 * (100 Hz at 50 or 100 frames a second) stands still and is not seen. */
clt_status clt_flicker_measure(clt_field_bench *bench, double seconds, clt_flicker *out, clt_error *error);

/* What the choice rests on. Rates are fractions of full scale a second. */
typedef struct clt_exposure_needs {
  double brightest; /* rate of the brightest pixels under the white panel */
  double darkest;   /* least rate that is to be told from noise: of the dark panel */
  double snr;       /* wanted there, of one pixel */
  double full_well, read_noise;
  double refresh_s;
  double flicker_hz;      /* 0: none */
  double least_s, most_s; /* that the camera takes */
} clt_exposure_needs;

typedef struct clt_exposure_choice {
  double seconds[CLT_EXPOSURES_MAX];
  int count;
  double ratio; /* between neighbours, before rounding to whole periods */
  double snr;   /* that the longest gives at the darkest */
  char reason[CLT_EXPOSURES_MAX][160];
} clt_exposure_choice;

/* The shortest exposure keeps the brightest at 0.8 of full scale; the longest gives the darkest the wanted signal to
 * noise, e t W / sqrt(e t W + r^2); between, the ratio at which light that just saturates one exposure still has a
 * signal to noise of 30 in the next shorter. All are whole refresh periods, and whole periods of the flicker too where
 * they are long enough. */
void clt_exposures_choose(const clt_exposure_needs *needs, clt_exposure_choice *choice);

#endif
