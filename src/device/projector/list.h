/* What monitors and what renderer the desktop has: for a person who writes a configuration, and for
 * `counterlight doctor`. There only where the feature glfw is built (CLT_HAVE_GLFW). */
#ifndef CLT_DEVICE_PROJECTOR_LIST_H
#define CLT_DEVICE_PROJECTOR_LIST_H

#include <stdbool.h>

#include "counterlight/device.h"

typedef struct clt_glfw_monitor {
  char name[64];  /* what to write as `monitor` */
  char model[64]; /* as the monitor tells; empty where it does not */
  int x, y;       /* its corner on the desktop */
  int width, height;
  int refresh_hz; /* 0: the display does not say */
  bool primary;
  bool chosen; /* the one that the configuration would take */
} clt_glfw_monitor;

/* Owned by the struct; a zeroed one is empty. */
typedef struct clt_glfw_display {
  char library[96];                             /* GLFW's version and what it can talk to */
  char renderer[128], vendor[128], version[64]; /* of OpenGL; empty where no context came: reason */
  char reason[CLT_MESSAGE_MAX];
  int gl_major, gl_minor;
  bool software;     /* the processor draws, not a graphics card */
  clt_status choice; /* CLT_OK where a monitor is chosen, or why none is: choice_reason */
  char choice_reason[CLT_MESSAGE_MAX];
  int count;
  clt_glfw_monitor *monitors; /* in the desktop's order */
} clt_glfw_display;

/* Asks the desktop, from the main thread and while no projector is open; nothing is shown. CLT_GONE without a
 * display. */
clt_status clt_glfw_list(const clt_projector_config *config, clt_glfw_display *display, clt_error *error);
void clt_glfw_display_finish(clt_glfw_display *display);
/* True for OpenGL's renderer (GL_RENDERER) where the processor draws. */
bool clt_glfw_is_software(const char *renderer);

#endif
