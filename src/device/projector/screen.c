#include "device/projector/screen.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "device/projector/desktop.h"

/* A monitor that tells no size of a window, and how often a monitor is looked at. */
enum { WINDOW_WIDTH = 960, WINDOW_HEIGHT = 540 };
static const double look_s = 1.0;
/* A ramp entry may be off by rounding in the server. */
enum { RAMP_MOST = 65535, RAMP_SLACK = 257 };

static clt_status fail_glfw(clt_error *error, const char *what, const char *advice) {
  const char *why = NULL;
  glfwGetError(&why);
  return clt_fail(error, CLT_FAILED, "%s: %s; %s", what, why != NULL ? why : "GLFW does not say why", advice);
}

static void resized(GLFWwindow *window, int width, int height) {
  clt_screen *screen = glfwGetWindowUserPointer(window);
  screen->width = width;
  screen->height = height;
}

/* Ten bits a channel are worth asking for where what is asked for is what goes out: a Wayland compositor may take ten
 * and show eight. */
static void hint(const clt_screen *screen) {
  int bits = clt_desktop_is_x11() ? 10 : 8;
  const int hints[][2] = {{GLFW_CONTEXT_VERSION_MAJOR, 3},
                          {GLFW_CONTEXT_VERSION_MINOR, 3},
                          {GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE},
                          {GLFW_RED_BITS, bits},
                          {GLFW_GREEN_BITS, bits},
                          {GLFW_BLUE_BITS, bits},
                          {GLFW_ALPHA_BITS, 0},
                          {GLFW_DEPTH_BITS, 0},
                          {GLFW_STENCIL_BITS, 0},
                          {GLFW_SRGB_CAPABLE, GLFW_FALSE},
                          {GLFW_REFRESH_RATE, screen->mode.refreshRate > 0 ? screen->mode.refreshRate : GLFW_DONT_CARE},
                          {GLFW_AUTO_ICONIFY, GLFW_FALSE},
                          {GLFW_CENTER_CURSOR, GLFW_FALSE},
                          {GLFW_FOCUS_ON_SHOW, screen->config.window}};
  for (size_t i = 0; i < sizeof hints / sizeof hints[0]; i++) {
    glfwWindowHint(hints[i][0], hints[i][1]);
  }
  glfwWindowHintString(GLFW_X11_CLASS_NAME, "counterlight");
}

static void take_place(clt_screen *screen, const clt_monitor *monitor) {
  screen->x = monitor->x;
  screen->y = monitor->y;
  snprintf(screen->name, sizeof screen->name, "%s", monitor->name);
}

static bool is_neutral(const GLFWgammaramp *ramp) {
  for (unsigned i = 0; i < ramp->size; i++) {
    int neutral = (int)((double)RAMP_MOST * i / (ramp->size - 1) + 0.5);
    if (abs(ramp->red[i] - neutral) > RAMP_SLACK || abs(ramp->green[i] - neutral) > RAMP_SLACK ||
        abs(ramp->blue[i] - neutral) > RAMP_SLACK) {
      return false;
    }
  }
  return true;
}

/* GLFW keeps the ramp from before the first change and puts it back when it ends. Where ramps cannot be read (Wayland)
 * they cannot be set either. */
static void neutralise(clt_screen *screen, GLFWmonitor *monitor, bool first) {
  const GLFWgammaramp *ramp = glfwGetGammaRamp(monitor);
  if (ramp == NULL || ramp->size < 2 || is_neutral(ramp)) {
    return;
  }
  if (!first && !screen->reset_ramp) {
    clt_log(CLT_LOG_WARNING,
            "monitor %s: something else set its gamma ramp, which is neutral again; switch off night light "
            "and colour profiles",
            screen->name);
    screen->reset_ramp = true;
  }
  glfwSetGamma(monitor, 1.0F);
}

static clt_status open_on_monitor(clt_screen *screen, clt_error *error) {
  clt_monitor monitor;
  clt_status status = clt_monitor_find(screen->config.monitor, &monitor, error);
  status = status == CLT_OK ? clt_monitor_mode(&monitor, &screen->config, &screen->mode, error) : status;
  if (status != CLT_OK) {
    return status;
  }
  take_place(screen, &monitor);
  hint(screen);
  screen->window = glfwCreateWindow(screen->mode.width, screen->mode.height, "counterlight", monitor.handle, NULL);
  if (screen->window != NULL) {
    glfwSetInputMode(screen->window, GLFW_CURSOR, GLFW_CURSOR_HIDDEN);
    neutralise(screen, monitor.handle, true);
    clt_desktop_keep_awake(true);
  }
  return CLT_OK;
}

static clt_status open_on_desk(clt_screen *screen, clt_error *error) {
  clt_monitor monitor;
  clt_status status = clt_monitor_find(screen->config.monitor, &monitor, error);
  if (status != CLT_OK) {
    return status;
  }
  const GLFWvidmode *mode = glfwGetVideoMode(monitor.handle);
  screen->mode = mode != NULL ? *mode : (GLFWvidmode){0};
  screen->mode.width = screen->config.width > 0 ? screen->config.width : WINDOW_WIDTH;
  screen->mode.height = screen->config.height > 0 ? screen->config.height : WINDOW_HEIGHT;
  take_place(screen, &monitor);
  hint(screen);
  screen->window = glfwCreateWindow(screen->mode.width, screen->mode.height, "counterlight", NULL, NULL);
  if (screen->window != NULL) {
    int left = 0, top = 0;
    glfwGetMonitorWorkarea(monitor.handle, &left, &top, NULL, NULL);
    glfwSetWindowPos(screen->window, left, top);
  }
  return CLT_OK;
}

clt_status clt_screen_open(const clt_projector_config *config, clt_screen *screen, clt_error *error) {
  *screen = (clt_screen){.config = *config};
  if (glfwGetCurrentContext() != NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "another projector of driver glfw is open in this process; there can be one");
  }
  glfwInitHint(GLFW_JOYSTICK_HAT_BUTTONS, GLFW_FALSE);
  if (!glfwInit()) {
    return fail_glfw(error, "no display",
                     "is an X server or a Wayland compositor running, and DISPLAY or "
                     "WAYLAND_DISPLAY set?");
  }
  clt_desktop_bear_refusals(true);
  clt_status status = config->window ? open_on_desk(screen, error) : open_on_monitor(screen, error);
  if (status == CLT_OK && screen->window == NULL) {
    status = fail_glfw(error, "no window with OpenGL 3.3", "is a GL driver installed (counterlight doctor)?");
  }
  if (status != CLT_OK) {
    glfwTerminate();
    clt_desktop_bear_refusals(false);
    return status;
  }
  glfwMakeContextCurrent(screen->window);
  glfwSetWindowUserPointer(screen->window, screen);
  glfwSetFramebufferSizeCallback(screen->window, resized);
  glfwGetFramebufferSize(screen->window, &screen->width, &screen->height);
  screen->looked_ns = clt_clock_ns();
  return CLT_OK;
}

/* Leaving the monitor first makes GLFW tell the desktop all over again. */
static void put_back(clt_screen *screen, const clt_monitor *monitor) {
  int rate = screen->mode.refreshRate > 0 ? screen->mode.refreshRate : GLFW_DONT_CARE;
  glfwSetWindowMonitor(screen->window, NULL, monitor->x, monitor->y, screen->mode.width, screen->mode.height, 0);
  glfwSetWindowMonitor(screen->window, monitor->handle, 0, 0, screen->mode.width, screen->mode.height, rate);
  glfwShowWindow(screen->window);
  take_place(screen, monitor);
  neutralise(screen, monitor->handle, true);
}

/* The same connector, or, where the configuration names a projector and not a place, wherever that one is now. */
static bool find_again(const clt_screen *screen, clt_monitor *monitor) {
  bool anywhere = strcmp(screen->config.monitor, "auto") != 0;
  return clt_monitor_find(screen->name, monitor, NULL) == CLT_OK ||
         (anywhere && clt_monitor_find(screen->config.monitor, monitor, NULL) == CLT_OK);
}

/* GLFW makes an ordinary window of one whose monitor goes: that would stand on somebody's desk. */
static void look_for_monitor(clt_screen *screen) {
  clt_monitor monitor;
  if (!screen->away) {
    screen->away = true;
    glfwHideWindow(screen->window);
    clt_log(CLT_LOG_WARNING, "monitor %s is gone; the picture waits until it comes back", screen->name);
  }
  if (find_again(screen, &monitor)) {
    put_back(screen, &monitor);
    screen->away = false;
    clt_log(CLT_LOG_NOTICE, "monitor %s is back, and the picture with it", screen->name);
  }
}

static void look_at_monitor(clt_screen *screen, GLFWmonitor *handle) {
  clt_monitor monitor = {.handle = handle};
  const GLFWvidmode *mode = glfwGetVideoMode(handle);
  glfwGetMonitorPos(handle, &monitor.x, &monitor.y);
  snprintf(monitor.name, sizeof monitor.name, "%s", screen->name);
  bool other_mode = mode != NULL && (mode->width != screen->mode.width || mode->height != screen->mode.height);
  if (monitor.x != screen->x || monitor.y != screen->y || other_mode) {
    clt_log(CLT_LOG_NOTICE, "monitor %s was moved or changed; the picture follows", screen->name);
    put_back(screen, &monitor);
  }
  neutralise(screen, handle, false);
  if (glfwGetWindowAttrib(screen->window, GLFW_ICONIFIED)) {
    glfwRestoreWindow(screen->window);
  }
}

void clt_screen_tend(clt_screen *screen) {
  glfwPollEvents();
  if (screen->config.window) {
    return;
  }
  GLFWmonitor *handle = glfwGetWindowMonitor(screen->window);
  if (handle == NULL) {
    look_for_monitor(screen);
  } else if (clt_clock_since(screen->looked_ns) >= look_s) {
    look_at_monitor(screen, handle);
    screen->looked_ns = clt_clock_ns();
  }
}

void clt_screen_close(clt_screen *screen) {
  if (screen->window == NULL) {
    return;
  }
  clt_desktop_keep_awake(false);
  glfwDestroyWindow(screen->window);
  glfwTerminate();
  clt_desktop_bear_refusals(false);
  screen->window = NULL;
}
