/* A photograph at the resolution of the camera. */
#ifndef CLT_CLI_PHOTOGRAPH_H
#define CLT_CLI_PHOTOGRAPH_H

#include "counterlight/station.h"

/* Shows a drive, as large as the panel, and merges frames of the rig's exposures into the radiance of every pixel, b0
 * included; infinite deviations are left unsaid. seen is initialised here. */
clt_status cli_photograph(const clt_station *station, const clt_rig_config *rig, const clt_image *drive,
                          clt_image *seen, clt_error *error);

#endif
