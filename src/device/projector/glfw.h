/* The projector on a monitor: a window by GLFW 3.3, drawn by OpenGL 3.3. */
#ifndef CLT_DEVICE_PROJECTOR_GLFW_H
#define CLT_DEVICE_PROJECTOR_GLFW_H

#include "counterlight/device.h"

/* Opens the driver "glfw": full screen on the configured monitor, or a window on its desktop. One a process, and every
 * call from open to close on the thread that opened, which is the process's main one: GLFW insists on that. Events are
 * taken inside present, which also puts the picture back where the monitor went and came back; while it is away,
 * present succeeds at the same pace. present returns at the refresh that shows the picture, or one or two before where
 * the display tells no times (docs/projector.md). CLT_GONE: no display, or not that monitor. */
clt_status clt_glfw_open_projector(const clt_projector_config *config, clt_projector **out, clt_error *error);

#endif
