#include "device/projector/list.h"

#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "device/projector/desktop.h"
#include "device/projector/monitor.h"

static void keep(char *to, size_t size, const char *text) {
  snprintf(to, size, "%s", text != NULL ? text : "");
}

/* Mesa's and the kernel's drivers that draw with the processor. */
bool clt_glfw_is_software(const char *renderer) {
  static const char *const names[] = {"llvmpipe", "softpipe", "swrast", "Software Rasterizer"};
  for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
    if (strstr(renderer, names[k]) != NULL) {
      return true;
    }
  }
  return false;
}

/* The drawing of a window that is never shown. */
static void ask_renderer(clt_glfw_display *display) {
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  GLFWwindow *window = glfwCreateWindow(64, 64, "counterlight", NULL, NULL);
  if (window == NULL) {
    const char *reason = NULL;
    glfwGetError(&reason);
    keep(display->reason, sizeof display->reason, reason);
    return;
  }
  glfwMakeContextCurrent(window);
  keep(display->renderer, sizeof display->renderer, (const char *)glGetString(GL_RENDERER));
  keep(display->vendor, sizeof display->vendor, (const char *)glGetString(GL_VENDOR));
  keep(display->version, sizeof display->version, (const char *)glGetString(GL_VERSION));
  display->gl_major = epoxy_gl_version() / 10;
  display->gl_minor = epoxy_gl_version() % 10;
  display->software = clt_glfw_is_software(display->renderer);
  glfwMakeContextCurrent(NULL);
  glfwDestroyWindow(window);
}

static void describe(GLFWmonitor *handle, clt_glfw_monitor *monitor) {
  const GLFWvidmode *mode = glfwGetVideoMode(handle);
  keep(monitor->name, sizeof monitor->name, glfwGetMonitorName(handle));
  clt_desktop_model(handle, monitor->model, sizeof monitor->model);
  glfwGetMonitorPos(handle, &monitor->x, &monitor->y);
  if (mode != NULL) {
    monitor->width = mode->width;
    monitor->height = mode->height;
    monitor->refresh_hz = mode->refreshRate;
  }
  monitor->primary = handle == glfwGetPrimaryMonitor();
}

static clt_status ask_monitors(const clt_projector_config *config, clt_glfw_display *display, clt_error *error) {
  clt_monitor chosen = {0};
  clt_error problem = {0};
  int count = 0;
  GLFWmonitor **handles = glfwGetMonitors(&count);
  display->monitors = calloc(count > 0 ? (size_t)count : 1, sizeof *display->monitors);
  if (display->monitors == NULL) {
    return clt_fail(error, CLT_FAILED, "memory is short for a list of monitors");
  }
  display->choice = clt_monitor_find(config->monitor, &chosen, &problem);
  keep(display->choice_reason, sizeof display->choice_reason, problem.message);
  for (; display->count < count; display->count++) {
    describe(handles[display->count], &display->monitors[display->count]);
    display->monitors[display->count].chosen = display->choice == CLT_OK && handles[display->count] == chosen.handle;
  }
  return CLT_OK;
}

clt_status clt_glfw_list(const clt_projector_config *config, clt_glfw_display *display, clt_error *error) {
  *display = (clt_glfw_display){0};
  keep(display->library, sizeof display->library, glfwGetVersionString());
  if (glfwInit() == GLFW_FALSE) {
    const char *reason = NULL;
    glfwGetError(&reason);
    return clt_fail(error, CLT_GONE, "there is no display: %s; set DISPLAY or WAYLAND_DISPLAY, or start a desktop",
                    reason != NULL ? reason : "GLFW does not say why");
  }
  clt_status status = ask_monitors(config, display, error);
  if (status == CLT_OK) {
    ask_renderer(display);
  }
  glfwTerminate();
  return status;
}

void clt_glfw_display_finish(clt_glfw_display *display) {
  free(display->monitors);
  *display = (clt_glfw_display){0};
}
