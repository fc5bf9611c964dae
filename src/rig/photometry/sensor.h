/* The sensor by itself: its sample without light, and its noise. */
#ifndef CLT_RIG_PHOTOMETRY_SENSOR_H
#define CLT_RIG_PHOTOMETRY_SENSOR_H

#include "rig/photometry/field.h"

/* The sample without light, code values: of the dark panel by the two shortest exposures, extrapolated to none. The
 * mean without outliers; where noise is cut off at 0, the middle between two quantiles that are not. */
clt_status clt_sensor_black_level(clt_field_bench *bench, int frames, double *black_level, clt_error *error);

/* That the noise is measured with, at most: brightnesses, and exposures of the dark panel. */
enum { CLT_NOISE_LEVELS = 5, CLT_NOISE_DARKS = 14 };

typedef struct clt_sensor_noise {
  double full_well;  /* electrons at full scale: 1 / slope of variance against mean */
  double read_noise; /* electrons rms */
  double misfit;     /* rms departure of the variances from the line, relative to their own uncertainty */
  int points;        /* variances on the line */
} clt_sensor_noise;

/* The photon transfer curve (Janesick 2007): half the variance of the difference of successive frames, pixel by pixel,
 * in decoded light h, is h / full_well + (read_noise / full_well)^2 + quantisation. Fields from dark to white at
 * exposures up to seconds; the line is fitted with weights by the variances themselves, and without outliers. The
 * bench's response and groups are there. CLT_FAILED where variance does not grow with light. */
clt_status clt_sensor_noise_measure(clt_field_bench *bench, double seconds, int frames, clt_sensor_noise *out,
                                    clt_error *error);

#endif
