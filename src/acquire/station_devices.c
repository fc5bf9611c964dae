#include "acquire/station_devices.h"

#include <stdio.h>
#include <string.h>

#define SIMULATED "simulated"
/* Larger than any panel or sensor that there is, and what the drivers' arithmetic holds. */
enum { SIDE_MOST = 16384 };

static void read_name(clt_section section, const char *key, const char *fallback, char *to, size_t size) {
  snprintf(to, size, "%s", clt_read_text(section, key, fallback, size - 1));
}

static bool read_response(clt_section section, clt_curve *response) {
  const char *text = clt_read_text(section, "response", NULL, 24);
  clt_error problem = {0};
  if (text != NULL && clt_curve_parse(text, response, &problem) != CLT_OK) {
    clt_section_fail(section, "response", "%s", problem.message);
  }
  return text != NULL;
}

static void read_size(clt_section section, int *width, int *height) {
  *width = clt_read_integer(section, "width", 0, 1, SIDE_MOST);
  *height = clt_read_integer(section, "height", 0, 1, SIDE_MOST);
  if ((*width == 0) != (*height == 0)) {
    clt_section_fail(section, NULL, "needs both width and height, or neither");
  }
}

void clt_station_read_projector(clt_section section, clt_station_config *config) {
  clt_projector_config *projector = &config->projector;
  read_name(section, "driver", SIMULATED, projector->driver, sizeof projector->driver);
  read_name(section, "monitor", "auto", projector->monitor, sizeof projector->monitor);
  read_size(section, &projector->width, &projector->height);
  projector->refresh_hz = clt_read_number(section, "refresh_hz", 0, 1, 1000);
  projector->window = clt_read_flag(section, "window", false);
  clt_curve panel = {.kind = CLT_CURVE_LINEAR};
  config->projector_response_given = read_response(section, &panel);
  config->rig.projector = clt_panel_of_curve(&panel);
}

static void read_format(clt_section section, clt_camera_config *camera) {
  read_name(section, "format", "auto", camera->format, sizeof camera->format);
  if (strlen(camera->format) != 4) {
    clt_section_fail(section, "format",
                     "\"%s\" is neither \"auto\" nor a code of four characters (\"YUYV\", \"MJPG\", "
                     "\"GREY\", ...)",
                     camera->format);
  }
}

/* As 0 (off), 50 or 60. */
static void read_power_line(clt_section section, clt_camera_config *camera) {
  camera->power_line_hz = clt_read_integer(section, "power_line_hz", -1, 0, 60);
  if (camera->power_line_hz > 0 && camera->power_line_hz != 50 && camera->power_line_hz != 60) {
    clt_section_fail(section, "power_line_hz", "is %d; legal is 0 (off), 50 or 60", camera->power_line_hz);
  }
}

void clt_station_read_camera(clt_section section, clt_station_config *config) {
  clt_camera_config *camera = &config->camera;
  read_name(section, "driver", SIMULATED, camera->driver, sizeof camera->driver);
  read_name(section, "device", "auto", camera->device, sizeof camera->device);
  read_format(section, camera);
  read_size(section, &camera->width, &camera->height);
  camera->rate_hz = clt_read_number(section, "rate_hz", 0, 0.1, 1000);
  camera->gain = clt_read_number(section, "gain", -1, 0, 1e6);
  camera->white_balance_k = clt_read_number(section, "white_balance_k", 0, 1000, 20000);
  camera->focus = clt_read_number(section, "focus", -1, 0, 1e6);
  read_power_line(section, camera);
  config->camera_response_given = read_response(section, &config->rig.camera);
}
