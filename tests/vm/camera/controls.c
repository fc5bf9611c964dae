#include <string.h>

#include "camera.h"

/* Units: 1 the camera terminal, 2 the processing unit (USB Video Class 1.0, tables ). */
static const camera_control table[CONTROL_COUNT] = {
    {"auto-exposure", 1, 0x02, 1, 1, 8, 9, 8, 8,
     false}, /* 1 manual, 8 aperture priority; the step is the set of modes */
    {"exposure", 1, 0x04, 4, 1, 5000, 1, 157, 157, false}, /* 100 us */
    {"brightness", 2, 0x02, 2, -64, 64, 1, 0, 0, false},
    {"gain", 2, 0x04, 2, 0, 255, 1, 16, 16, false},
    {"power-line", 2, 0x05, 1, 0, 2, 1, 1, 1, false},
    {"white-balance", 2, 0x0a, 2, 2800, 6500, 1, 4600, 4600, false},
    {"auto-white-balance", 2, 0x0b, 1, 0, 1, 1, 1, 1, false},
};

enum { SET_CUR = 0x01, GET_CUR = 0x81, GET_MIN, GET_MAX, GET_RES, GET_LEN, GET_INFO, GET_DEF };

void controls_init(camera_controls *controls) {
  memcpy(controls->list, table, sizeof table);
}

camera_control *controls_find(camera_controls *controls, const char *name) {
  for (int i = 0; i < CONTROL_COUNT; i++) {
    if (strcmp(controls->list[i].name, name) == 0) {
      return &controls->list[i];
    }
  }
  return NULL;
}

int32_t controls_value(const camera_controls *controls, const char *name) {
  for (int i = 0; i < CONTROL_COUNT; i++) {
    if (strcmp(controls->list[i].name, name) == 0) {
      return controls->list[i].value;
    }
  }
  return 0;
}

static int set(camera_control *control, const uint8_t *data, int length) {
  uint32_t raw = 0;
  if (control->refused || length < control->bytes) {
    return -1;
  }
  memcpy(&raw, data, control->bytes);
  int32_t value = control->bytes == 2 ? (int16_t)raw : (int32_t)raw;
  if (value < control->least || value > control->most) {
    return -1;
  }
  control->value = value;
  return 0;
}

static int get(const camera_control *control, uint8_t request, uint8_t *data, int length) {
  const int32_t values[] = {control->value, control->least,      control->most,    control->step,
                            control->bytes, 3 /* get and set */, control->standard};
  if (request < GET_CUR || request > GET_DEF) {
    return -1;
  }
  int bytes = request == GET_LEN ? 2 : request == GET_INFO ? 1 : control->bytes;
  bytes = length < bytes ? length : bytes;
  memcpy(data, &values[request - GET_CUR], (size_t)bytes);
  return bytes;
}

int controls_request(camera_controls *controls, uint8_t unit, uint8_t selector, uint8_t request, uint8_t *data,
                     int length) {
  for (int i = 0; i < CONTROL_COUNT; i++) {
    camera_control *control = &controls->list[i];
    if (control->unit == unit && control->selector == selector) {
      return request == SET_CUR ? set(control, data, length) : get(control, request, data, length);
    }
  }
  return -1;
}
