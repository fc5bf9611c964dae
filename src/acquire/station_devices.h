/* The sections "projector" and "camera" of a configuration (docs/configuration.md). */
#ifndef CLT_ACQUIRE_STATION_DEVICES_H
#define CLT_ACQUIRE_STATION_DEVICES_H

#include "base/settings.h"
#include "counterlight/station.h"

/* Fill the device's settings and the rig's response of it; an absent section gives the defaults. */
void clt_station_read_projector(clt_section section, clt_station_config *config);
void clt_station_read_camera(clt_section section, clt_station_config *config);

#endif
