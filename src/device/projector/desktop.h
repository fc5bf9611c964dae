/* What GLFW does not ask of the desktop: models of monitors, staying awake, what the display says of its refreshes. All
 * of it is X11's; elsewhere, and with a GLFW built for Wayland only, the answers are "not known". */
#ifndef CLT_DEVICE_PROJECTOR_DESKTOP_H
#define CLT_DEVICE_PROJECTOR_DESKTOP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct GLFWmonitor;

/* True where GLFW talks to an X server. */
bool clt_desktop_is_x11(void);
/* What the X server refuses is logged from now on, or again ends the process as Xlib has it: a monitor that goes while
 * GLFW sets its mode is no reason to end. */
void clt_desktop_bear_refusals(bool bear);
/* The model that a monitor tells in its EDID ("Beam 9000"); empty where it tells none. */
void clt_desktop_model(struct GLFWmonitor *monitor, char *model, size_t size);
/* Holds off the screen saver and the switching off of monitors (DPMS), or no longer. The X server forgets it by itself
 * when the process ends. */
void clt_desktop_keep_awake(bool awake);
/* Waits until the server has done what it was sent. */
void clt_desktop_finish(void);
/* True where the display tells when swaps take place (GLX_OML_sync_control), for the window whose context is current.
 */
bool clt_desktop_stamps(void);
/* Waits for the last swap: when the refresh that showed it started (CLOCK_MONOTONIC), and its number. False where the
 * display does not tell after all. */
bool clt_desktop_last_swap(int64_t *started_ns, int64_t *number);

/* The monitor's name in an EDID block of size bytes (VESA E-EDID 1.4, section 3.10.3.4); empty where there is none. */
void clt_edid_model(const unsigned char *edid, size_t bytes, char *model, size_t size);

#endif
