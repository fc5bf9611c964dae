/* The projector's window: kept on its monitor, whatever happens to that. Its GL context is current from open to close.
 */
#ifndef CLT_DEVICE_PROJECTOR_SCREEN_H
#define CLT_DEVICE_PROJECTOR_SCREEN_H

#include "device/projector/monitor.h"

typedef struct clt_screen {
  clt_projector_config config;
  GLFWwindow *window;
  char name[64];     /* of the monitor; survives its going */
  GLFWvidmode mode;  /* that it is to have */
  int width, height; /* of the window's picture at present, pixels */
  int x, y;          /* of the monitor, when the window was put there */
  bool away;         /* the monitor is gone */
  bool reset_ramp;   /* somebody else's gamma ramp was undone before */
  int64_t looked_ns; /* when the monitor was last looked at */
} clt_screen;

/* Opens the window as the configuration says. */
clt_status clt_screen_open(const clt_projector_config *config, clt_screen *screen, clt_error *error);
/* Takes events; puts the window back where its monitor came back, moved or lost its mode; once a second makes sure of
 * the monitor's place, the neutral gamma ramp and the window's being up. What it finds is logged once. */
void clt_screen_tend(clt_screen *screen);
/* Closes the window and GLFW; the monitor's mode and gamma ramp are as before. Also for one that did not open. */
void clt_screen_close(clt_screen *screen);

#endif
