#include "wide.h"

static float entry(int channel, size_t row, size_t column) {
  return row == column ? 1.0f : 0.01f * (float)(channel + 1) / (float)(1 + row + column);
}

rig_pair wide_open(const char *panel, const char *camera, const char *settings) {
  char text[1000];
  snprintf(text, sizeof text,
           "transport_file = \"t.h5\"; projector = { " WIDE_PANEL "%s }; camera = { " WIDE_CAMERA "%s }; %s", panel,
           camera, settings);
  room made;
  room_make(&made, text);
  room_add_transport(&made, WIDE_WIDTH, WIDE_HEIGHT, 3, entry, 0.0f);
  rig_pair pair = pair_of(room_open(&made));
  room_remove(&made);
  return pair;
}

void wide_codes(float codes[WIDE_VALUES]) {
  for (int k = 0; k < WIDE_VALUES; k++) {
    codes[k] = (float)(k * 7 % 23) / 32.0f;
  }
}

double wide_drive(float code) {
  return rint(65535.0 * (double)code) / 65535.0;
}

double wide_entry(int channel, int i, int j) {
  return (double)entry(channel, (size_t)i, (size_t)j);
}

double wide_light(const double *x, int channel, int cell) {
  double sum = 0.0;
  for (int j = 0; j < WIDE_CELLS; j++) {
    sum += wide_entry(channel, cell, j) * x[channel * WIDE_CELLS + j];
  }
  return sum;
}

void wide_radiance(const float *codes, double radiance[WIDE_VALUES]) {
  double drive[WIDE_VALUES];
  for (int k = 0; k < WIDE_VALUES; k++) {
    drive[k] = wide_drive(codes[k]);
  }
  for (int k = 0; k < WIDE_VALUES; k++) {
    radiance[k] = wide_light(drive, k / WIDE_CELLS, k % WIDE_CELLS);
  }
}

double wide_pixel(const clt_frame *frame, int x, int y, int channel) {
  return frame->samples[(y * frame->width + x) * frame->channels + channel] / 65535.0 / (20.0 * frame->exposure_s);
}

double wide_seen(const clt_frame *frame, int k) {
  int side = frame->width / WIDE_WIDTH, cell = k % WIDE_CELLS;
  return wide_pixel(frame, cell % WIDE_WIDTH * side, cell / WIDE_WIDTH * side, k / WIDE_CELLS);
}
