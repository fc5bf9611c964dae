/* Measuring again what each camera pixel sees, and the calibration that follows. */
#ifndef CLT_DAEMON_GEOMETRY_H
#define CLT_DAEMON_GEOMETRY_H

#include "daemon/letters.h"

/* The file in the state directory that keeps a calibration whose geometry was measured again; "" where the path is too
 * long. */
void geometry_file(const char *state, char path[CLT_PATH_MAX]);
/* Puts that file in the place of station's calibration where it is at least as new. An installer's later one counts. */
void geometry_choose(const char *state, clt_station_config *station);

/* Measures the geometry on station's camera and `projector`. The station's calibration and rig are replaced by new ones
 * and the calibration kept in job->calibration (a file that cannot be written is a warning), or both stay where the new
 * geometry is worse (clt_calibrate_geometry): found says which, and why. Else as the devices fail. */
clt_status geometry_renew(const measure_job *job, clt_station *station, clt_projector *projector,
                          bool (*progress)(void *context, const clt_progress *made), void *context,
                          geometry_renewal *found, clt_error *error);

#endif
