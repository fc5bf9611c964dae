#include "device/projector/desktop.h"

/* epoxy's headers go before any other that knows of GL. */
#include <epoxy/gl.h>
#include <epoxy/glx.h>

#define GLFW_INCLUDE_NONE
#define GLFW_EXPOSE_NATIVE_X11
#include <GLFW/glfw3.h>
#include <GLFW/glfw3native.h>
#include <X11/extensions/scrnsaver.h>
#include <X11/extensions/Xrandr.h>
#include <X11/Xatom.h>

#include "base/clock.h"
#include "base/log.h"

/* A GLFW for Wayland only, which has the same soname, lacks these. */
#pragma weak glfwGetX11Display
#pragma weak glfwGetX11Monitor

static Display *x_display(void) {
  return glfwGetX11Display != NULL ? glfwGetX11Display() : NULL;
}

bool clt_desktop_is_x11(void) {
  return x_display() != NULL;
}

static int ignore(Display *display, XErrorEvent *event) {
  (void)display;
  (void)event;
  return 0;
}

static int tell(Display *display, XErrorEvent *event) {
  char why[80];
  XGetErrorText(display, event->error_code, why, sizeof why);
  clt_log(CLT_LOG_WARNING, "the X server refused request %d.%d: %s; did a monitor change just then?",
          event->request_code, event->minor_code, why);
  return 0;
}

void clt_desktop_bear_refusals(bool bear) {
  XSetErrorHandler(bear ? tell : NULL);
}

/* A monitor may go while it is asked: Xlib's own handler would end the process. */
void clt_desktop_model(struct GLFWmonitor *monitor, char *model, size_t size) {
  Display *display = x_display();
  unsigned char *value = NULL;
  unsigned long items = 0, left = 0;
  Atom type = None;
  int format = 0;
  model[0] = '\0';
  if (display == NULL) {
    return;
  }
  XSync(display, False);
  XErrorHandler before = XSetErrorHandler(ignore);
  Atom edid = XInternAtom(display, "EDID", False);
  int outcome = XRRGetOutputProperty(display, glfwGetX11Monitor(monitor), edid, 0, 128, False, False, AnyPropertyType,
                                     &type, &format, &items, &left, &value);
  XSync(display, False);
  XSetErrorHandler(before);
  if (outcome == Success && value != NULL && type == XA_INTEGER && format == 8) {
    clt_edid_model(value, items, model, size);
  }
  if (value != NULL) {
    XFree(value);
  }
}

void clt_desktop_keep_awake(bool awake) {
  Display *display = x_display();
  int event, error;
  if (display != NULL && XScreenSaverQueryExtension(display, &event, &error)) {
    XScreenSaverSuspend(display, awake);
    XFlush(display);
  }
}

void clt_desktop_finish(void) {
  Display *display = x_display();
  if (display != NULL) {
    XSync(display, False);
  }
}

bool clt_desktop_stamps(void) {
  Display *display = x_display();
  return display != NULL && glXGetCurrentDrawable() != None &&
         epoxy_has_glx_extension(display, DefaultScreen(display), "GLX_OML_sync_control");
}

bool clt_desktop_last_swap(int64_t *started_ns, int64_t *number) {
  /* The extension leaves open which clock its microseconds are of: a time that is not of just now is of another. */
  const int64_t recent_ns = 1000000000;
  int64_t started_us = 0, swaps = 0;
  *number = 0;
  if (!glXWaitForSbcOML(x_display(), glXGetCurrentDrawable(), 0, &started_us, number, &swaps) || *number == 0) {
    return false;
  }
  *started_ns = started_us * 1000;
  int64_t age_ns = clt_clock_ns() - *started_ns;
  return age_ns > -recent_ns && age_ns < recent_ns;
}
