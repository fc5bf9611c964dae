/* value = 16 + 219 (light + noise) of full scale, rounded; light = radiance * seconds * SENSITIVITY * gain / 16:
 * linear, so that a response that is not is a matter of the camera's configuration. YUYV as ITU-R BT.601 has it, in
 * which uvcvideo's camera says that it is. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "../process.h"
#include "camera.h"

static const double SENSITIVITY = 20;                       /* of full scale, by a radiance of 1 in a second */
static const double FULL_WELL = 20000, READ_ELECTRONS = 12; /* electrons */
static const double EXPOSURE_UNIT_S = 1e-4, STANDARD_GAIN = 16;

bool sensor_open(camera_sensor *sensor, const camera_options *options) {
  *sensor = (camera_sensor){.options = options, .noise = options->seed * 2654435761U + 1};
  size_t values = (size_t)options->width * (size_t)options->height * LIGHT_CHANNELS;
  sensor->seen = calloc(values, sizeof *sensor->seen);
  if (options->light != NULL && !light_open(&sensor->light, options->light)) {
    return false;
  }
  const light_header *header = sensor->light.header;
  if (header != NULL && (header->width != (uint32_t)options->width || header->height != (uint32_t)options->height)) {
    fprintf(stderr, "camera: %s has %u x %u pixels, the camera %d x %d\n", options->light, header->width,
            header->height, options->width, options->height);
    return false;
  }
  return sensor->seen != NULL;
}

void sensor_close(camera_sensor *sensor) {
  light_close(&sensor->light);
  free(sensor->seen);
}

/* xorshift64*: uniform in 0..1. */
static double uniform(camera_sensor *sensor) {
  uint64_t state = sensor->noise;
  state ^= state >> 12;
  state ^= state << 25;
  state ^= state >> 27;
  sensor->noise = state;
  return (double)(state * UINT64_C(2685821657736338717) >> 11) * 0x1p-53;
}

/* Nearly normal, of variance 1: the sum of four uniform numbers. */
static double normal(camera_sensor *sensor) {
  return (uniform(sensor) + uniform(sensor) + uniform(sensor) + uniform(sensor) - 2) * sqrt(3);
}

/* A moving ramp, where no light comes from outside. */
static void draw_pattern(camera_sensor *sensor) {
  int width = sensor->options->width, height = sensor->options->height;
  for (int y = 0; y < height; y++) {
    for (int x = 0; x < width; x++) {
      float value = (float)((x + y + 4 * (int)sensor->frames) % 256) / 255;
      for (int c = 0; c < LIGHT_CHANNELS; c++) {
        sensor->seen[((size_t)y * (size_t)width + (size_t)x) * LIGHT_CHANNELS + (size_t)c] = value;
      }
    }
  }
}

/* Light of a sample with its noise, 0..1. */
static double sample(camera_sensor *sensor, double light) {
  double electrons = fmin(fmax(light, 0), 1) * FULL_WELL;
  electrons += normal(sensor) * sqrt(electrons + READ_ELECTRONS * READ_ELECTRONS);
  return fmin(fmax(electrons / FULL_WELL, 0), 1);
}

static uint8_t code(double value) {
  return (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : lrint(value));
}

/* Two pixels: Y of each, U and V of their mean. */
static void encode(double rgb[2][LIGHT_CHANNELS], uint8_t *yuyv) {
  double u = 0, v = 0;
  for (int k = 0; k < 2; k++) {
    double y = 0.299 * rgb[k][0] + 0.587 * rgb[k][1] + 0.114 * rgb[k][2];
    yuyv[2 * k] = code(16 + 219 * y);
    u += 0.5 * (rgb[k][2] - y) / 1.772;
    v += 0.5 * (rgb[k][0] - y) / 1.402;
  }
  yuyv[1] = code(128 + 224 * u);
  yuyv[3] = code(128 + 224 * v);
}

void sensor_expose(camera_sensor *sensor, const camera_controls *controls, double sensitivity, uint8_t *yuyv) {
  int64_t end_ns = process_now_ns();
  double exposure_s = controls_value(controls, "exposure") * EXPOSURE_UNIT_S, scale = sensitivity;
  sensor->frames++;
  if (sensor->light.header != NULL) {
    light_mean(&sensor->light, end_ns - (int64_t)(exposure_s * 1e9), end_ns, sensor->seen);
    scale *= exposure_s * SENSITIVITY * controls_value(controls, "gain") / STANDARD_GAIN;
  } else {
    draw_pattern(sensor);
  }
  size_t pairs = (size_t)sensor->options->width * (size_t)sensor->options->height / 2;
  for (size_t p = 0; p < pairs; p++) {
    double rgb[2][LIGHT_CHANNELS];
    for (size_t k = 0; k < 2; k++) {
      for (size_t c = 0; c < LIGHT_CHANNELS; c++) {
        double light = scale * (double)sensor->seen[(2 * p + k) * LIGHT_CHANNELS + c];
        rgb[k][c] = sensor->light.header != NULL ? sample(sensor, light) : light;
      }
    }
    encode(rgb, yuyv + 4 * p);
  }
}
