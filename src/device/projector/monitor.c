#include "device/projector/monitor.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "device/projector/desktop.h"

enum { TOLD = 320 }; /* characters of a list in a message */

static void describe(GLFWmonitor *handle, clt_monitor *monitor) {
  *monitor = (clt_monitor){.handle = handle};
  snprintf(monitor->name, sizeof monitor->name, "%s", glfwGetMonitorName(handle));
  clt_desktop_model(handle, monitor->model, sizeof monitor->model);
  glfwGetMonitorPos(handle, &monitor->x, &monitor->y);
}

static CLT_PRINTF(2, 3) void append(char list[TOLD], const char *format, ...) {
  size_t used = strlen(list);
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(list + used, TOLD - used, format, arguments);
  va_end(arguments);
}

/* "HDMI-1 (Beam 9000) 1920x1080 at 1920,0; ..." */
static void list_monitors(char list[TOLD]) {
  int count = 0;
  GLFWmonitor **handles = glfwGetMonitors(&count);
  list[0] = '\0';
  for (int i = 0; i < count; i++) {
    clt_monitor monitor;
    describe(handles[i], &monitor);
    const GLFWvidmode *mode = glfwGetVideoMode(handles[i]);
    append(list, "%s%s", i > 0 ? "; " : "", monitor.name);
    if (monitor.model[0] != '\0') {
      append(list, " (%s)", monitor.model);
    }
    append(list, " %dx%d at %d,%d", mode != NULL ? mode->width : 0, mode != NULL ? mode->height : 0, monitor.x,
           monitor.y);
  }
}

/* How well a monitor fits: 0 not at all, 1 a part of its name or model, 2 its name or corner. */
static int fits(const clt_monitor *monitor, const char *which) {
  int x, y, end = 0;
  if (strcmp(which, monitor->name) == 0) {
    return 2;
  }
  if (sscanf(which, "%d,%d%n", &x, &y, &end) == 2 && which[end] == '\0') {
    return x == monitor->x && y == monitor->y ? 2 : 0;
  }
  return which[0] != '\0' && (strcasestr(monitor->model, which) != NULL || strcasestr(monitor->name, which) != NULL);
}

/* The first that is not the primary one, which GLFW lists first. */
static bool find_auto(clt_monitor *monitor) {
  int count = 0;
  GLFWmonitor **handles = glfwGetMonitors(&count);
  if (count > 0) {
    describe(handles[count > 1], monitor);
  }
  return count > 0;
}

static bool find_named(const char *which, clt_monitor *monitor, int *candidates) {
  int count = 0, best = 0;
  GLFWmonitor **handles = glfwGetMonitors(&count);
  *candidates = 0;
  for (int i = 0; i < count; i++) {
    clt_monitor seen;
    describe(handles[i], &seen);
    int fit = fits(&seen, which);
    if (fit > best) {
      *monitor = seen;
      best = fit;
      *candidates = 0;
    }
    *candidates += fit > 0 && fit == best;
  }
  return best == 2 || *candidates == 1;
}

clt_status clt_monitor_find(const char *which, clt_monitor *monitor, clt_error *error) {
  char list[TOLD];
  int candidates = 0;
  bool any = strcmp(which, "auto") == 0;
  if (any ? find_auto(monitor) : find_named(which, monitor, &candidates)) {
    return CLT_OK;
  }
  list_monitors(list);
  if (list[0] == '\0') {
    return clt_fail(error, CLT_GONE, "no monitor is connected; switch the projector on and look at its cable");
  }
  return clt_fail(error, CLT_GONE, "%s monitor \"%s\"; there are: %s", candidates > 1 ? "more than one" : "there is no",
                  which, list);
}

static void list_modes(const GLFWvidmode *modes, int count, char list[TOLD]) {
  list[0] = '\0';
  for (int i = count - 1; i >= 0; i--) {
    append(list, "%s%dx%d %d Hz", list[0] != '\0' ? ", " : "", modes[i].width, modes[i].height, modes[i].refreshRate);
  }
}

/* A monitor that knows no rate has 0. */
static bool rate_fits(int rate, double wanted_hz) {
  return rate == 0 || !(wanted_hz > 0) || fabs(rate - wanted_hz) <= 1;
}

clt_status clt_monitor_mode(const clt_monitor *monitor, const clt_projector_config *config, GLFWvidmode *mode,
                            clt_error *error) {
  int count = 0;
  const GLFWvidmode *now = glfwGetVideoMode(monitor->handle);
  const GLFWvidmode *modes = glfwGetVideoModes(monitor->handle, &count);
  if (now == NULL || modes == NULL) {
    return clt_fail(error, CLT_GONE, "monitor %s has no mode; is it switched on?", monitor->name);
  }
  int width = config->width > 0 ? config->width : now->width;
  int height = config->height > 0 ? config->height : now->height;
  double rate = config->refresh_hz > 0 ? config->refresh_hz : now->refreshRate;
  const GLFWvidmode *best = NULL;
  for (int i = 0; i < count; i++) { /* in ascending order of size, then of rate */
    bool nearer = best == NULL || fabs(modes[i].refreshRate - rate) <= fabs(best->refreshRate - rate);
    if (modes[i].width == width && modes[i].height == height && rate_fits(modes[i].refreshRate, config->refresh_hz) &&
        nearer) {
      best = &modes[i];
    }
  }
  if (best == NULL) {
    char list[TOLD];
    list_modes(modes, count, list);
    return clt_fail(error, CLT_BAD_INPUT, "monitor %s has no mode %dx%d at %g Hz; it has: %s", monitor->name, width,
                    height, rate, list);
  }
  *mode = *best;
  return CLT_OK;
}
