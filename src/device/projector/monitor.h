/* Which monitor, and which of its modes. GLFW is initialised. */
#ifndef CLT_DEVICE_PROJECTOR_MONITOR_H
#define CLT_DEVICE_PROJECTOR_MONITOR_H

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include "counterlight/device.h"

typedef struct clt_monitor {
  GLFWmonitor *handle; /* until GLFW polls events */
  char name[64];       /* of the output ("HDMI-1"); on Wayland maker and model */
  char model[64];      /* as the monitor tells; empty where it does not */
  int x, y;            /* its corner on the desktop */
} clt_monitor;

/* The monitor that a configuration means: "auto" is the first that is not the primary one, or the only one; a name; a
 * part of a name or model, in any case, that fits one monitor alone; "X,Y" of its corner. CLT_GONE with the monitors
 * that there are. */
clt_status clt_monitor_find(const char *which, clt_monitor *monitor, clt_error *error);
/* The mode of the configured size and rate (within 1 Hz: GLFW knows whole ones); what is 0 is as it is now, the rate as
 * near to that as the size allows. CLT_BAD_INPUT with the modes that there are. */
clt_status clt_monitor_mode(const clt_monitor *monitor, const clt_projector_config *config, GLFWvidmode *mode,
                            clt_error *error);

#endif
