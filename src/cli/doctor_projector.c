/* Monitors and the renderer. */
#include "cli/doctor.h"

#ifdef CLT_HAVE_GLFW

#include <string.h>

#include "device/projector/list.h"

static json_t *monitor_json(const clt_glfw_monitor *monitor) {
  return json_pack("{s:s, s:s, s:i, s:i, s:i, s:i, s:i, s:b, s:b}", "name", monitor->name, "model", monitor->model, "x",
                   monitor->x, "y", monitor->y, "width", monitor->width, "height", monitor->height, "refresh_hz",
                   monitor->refresh_hz, "primary", monitor->primary, "chosen", monitor->chosen);
}

static void look_at_monitor(doctor *self, const clt_glfw_monitor *monitor) {
  doctor_find(self, DOCTOR_GOOD, NULL, "monitor \"%s\"%s%s at %d,%d: %d x %d at %d Hz%s%s", monitor->name,
              monitor->model[0] != '\0' ? ", " : "", monitor->model, monitor->x, monitor->y, monitor->width,
              monitor->height, monitor->refresh_hz, monitor->primary ? ", primary" : "",
              monitor->chosen ? ", the one to project on" : "");
  if (monitor->chosen && monitor->refresh_hz == 0) {
    doctor_find(self, DOCTOR_NOTE, "set `refresh_hz` in the section projector",
                "\"%s\" does not say how often it refreshes", monitor->name);
  }
  if (monitor->chosen && monitor->primary) {
    doctor_find(self, DOCTOR_WARNING, "plug the projector in, or name its monitor, and keep the desktop on another",
                "\"%s\" is the primary monitor: what the desktop shows would lie over the picture", monitor->name);
  }
}

static void look_at_mode(doctor *self, const clt_glfw_monitor *monitor) {
  const clt_projector_config *asked = &self->config.projector;
  if (doctor_uses(self, "glfw") && monitor->chosen && !asked->window && asked->width > 0 &&
      (asked->width != monitor->width || asked->height != monitor->height)) {
    doctor_find(self, DOCTOR_NOTE, "the driver changes it while it runs; the projector's own size is the best",
                "\"%s\" is at %d x %d now, the configuration asks for %d x %d", monitor->name, monitor->width,
                monitor->height, asked->width, asked->height);
  }
}

static void look_at_renderer(doctor *self, const clt_glfw_display *display) {
  if (display->renderer[0] == '\0') {
    doctor_find(self, doctor_level_of(self, "glfw", DOCTOR_WARNING), "install the graphics card's OpenGL driver",
                "OpenGL 3.3 is not to be had: %s", display->reason);
    return;
  }
  doctor_find(self, display->software ? DOCTOR_WARNING : DOCTOR_GOOD,
              display->software ? "install the graphics card's driver, and see that this user may open /dev/dri/*: the "
                                  "processor draws now, which takes time from solving"
                                : NULL,
              "OpenGL %s by %s", display->version, display->renderer);
}

void doctor_look_at_projector(doctor *self) {
  static const clt_projector_config by_itself = {.monitor = "auto"};
  clt_glfw_display display;
  clt_error error = {0};
  json_t *list = json_array();
  json_object_set_new(self->document, "monitors", list);
  clt_status status = clt_glfw_list(self->configured ? &self->config.projector : &by_itself, &display, &error);
  json_object_set_new(self->document, "display",
                      json_pack("{s:s, s:s, s:s, s:s, s:b}", "glfw", display.library, "renderer", display.renderer,
                                "vendor", display.vendor, "opengl", display.version, "software", display.software));
  if (status != CLT_OK) {
    doctor_find(self, doctor_level_of(self, "glfw", DOCTOR_NOTE),
                "run it on the projector's desktop, or with its DISPLAY set", "%s", error.message);
    return;
  }
  for (int k = 0; k < display.count; k++) {
    json_array_append_new(list, monitor_json(&display.monitors[k]));
    look_at_monitor(self, &display.monitors[k]);
    look_at_mode(self, &display.monitors[k]);
  }
  if (display.choice != CLT_OK) {
    doctor_find(self, doctor_level_of(self, "glfw", DOCTOR_WARNING), "plug it in, or correct `monitor`", "%s",
                display.choice_reason);
  }
  look_at_renderer(self, &display);
  clt_glfw_display_finish(&display);
}

#else

void doctor_look_at_projector(doctor *self) {
  json_object_set_new(self->document, "monitors", json_array());
  doctor_find(self, doctor_level_of(self, "glfw", DOCTOR_NOTE), "build with -Dglfw=enabled",
              "the driver glfw is not in this build");
}

#endif
