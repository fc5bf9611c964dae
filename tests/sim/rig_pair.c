#include "rig_pair.h"

double pair_gain(int cell) {
  return 1.0 + 0.1 * cell;
}

static float diagonal(int channel, size_t row, size_t column) {
  (void)channel;
  return row == column ? (float)pair_gain((int)row) : 0.0f;
}

rig_pair pair_open(const char *settings) {
  char text[800];
  snprintf(text, sizeof text, "transport_file = \"t.h5\"; ambient = 0.0; %s",
           settings != NULL ? settings : "projector = { response = \"linear\"; bits = 16; black = 0.0; };");
  room made;
  room_make(&made, text);
  room_add_transport(&made, 4, 3, 1, diagonal, 0.0f);
  clt_scene *scene = room_open(&made);
  room_remove(&made);
  return pair_of(scene);
}

rig_pair pair_of(clt_scene *scene) {
  rig_pair pair = {.scene = scene};
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_scene_open_projector(pair.scene, &pair.projector, &error), error);
  assert_ok(clt_scene_open_camera(pair.scene, &pair.camera, &error), error);
  pair.camera->driver->describe(pair.camera, &pair.sensor);
  return pair;
}

void pair_close(rig_pair *pair) {
  pair->camera->driver->close(pair->camera);
  pair->projector->driver->close(pair->projector);
  clt_scene_close(pair->scene);
}

int64_t pair_show(rig_pair *pair, const float *codes) {
  clt_error error = {.status = CLT_OK};
  int64_t shown_ns = -1;
  assert_ok(pair->projector->driver->present(pair->projector, codes, &shown_ns, &error), error);
  return shown_ns;
}

int64_t pair_show_level(rig_pair *pair, float code) {
  float codes[PAIR_CELLS];
  for (int k = 0; k < PAIR_CELLS; k++) {
    codes[k] = code;
  }
  return pair_show(pair, codes);
}

clt_frame pair_frame(rig_pair *pair, int64_t not_before) {
  clt_error error = {.status = CLT_OK};
  clt_frame frame;
  assert_ok(pair->camera->driver->next(pair->camera, not_before, 1e5, &frame, &error), error);
  assert_true(frame.exposed_ns >= not_before);
  return frame;
}

void pair_expose(rig_pair *pair, double seconds) {
  clt_error error = {.status = CLT_OK};
  assert_ok(pair->camera->driver->set_exposure(pair->camera, seconds, &error), error);
  int tries = 0;
  while (pair_frame(pair, 0).exposure_s != seconds) {
    assert_true(tries++ < 12);
  }
}

double pair_signal(const rig_pair *pair, const clt_frame *frame, int cell) {
  int side = frame->width / 4;
  double sum = 0.0;
  for (int y = 0; y < side; y++) {
    for (int x = 0; x < side; x++) {
      sum += frame->samples[(cell / 4 * side + y) * frame->width + cell % 4 * side + x];
    }
  }
  double full = (1 << frame->bits) - 1;
  return (sum / (side * side) - pair->sensor.black_level) / (full - pair->sensor.black_level);
}
