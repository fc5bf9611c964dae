/* A scripted projector and camera in simulated time: the camera sees the panel one to one, each grid cell magnified to
 * k x k pixels; radiance = gain * light + ambient. Nothing here shares code with the simulator. */
#ifndef CLT_TESTS_RIG_FAKE_DEVICES_H
#define CLT_TESTS_RIG_FAKE_DEVICES_H

#include <stdbool.h>

#include "counterlight/rig.h"
#include "support.h"

enum { FAKE_CELLS_MAX = 64, FAKE_K = 2, FAKE_CHANNELS = 3, FAKE_SCRIPT_MAX = 64 };

/* What happens to the camera's frame of a number, counted from 0. */
typedef enum fake_event { FAKE_GOOD, FAKE_DROPPED, FAKE_SILENCE, FAKE_GONE } fake_event;

typedef struct fake_world fake_world;
typedef struct fake_projector {
  clt_projector base;
  fake_world *world;
} fake_projector;
typedef struct fake_camera {
  clt_camera base;
  fake_world *world;
} fake_camera;

struct fake_world {
  fake_projector projector;
  fake_camera camera;
  clt_projector_info panel;
  clt_camera_info sensor;
  clt_curve projector_curve, camera_curve;
  double gain, ambient;
  double lag_s;       /* from the refresh until the light has changed */
  int exposure_delay; /* frames that keep the exposure time of before */
  bool deaf;          /* ignores every exposure time asked for */
  double unit_s;      /* to whole ones of which exposure times are rounded; 0: none */
  fake_event script[FAKE_SCRIPT_MAX];
  int64_t now_ns, frame_ns, changed_ns;
  float before[FAKE_CELLS_MAX * FAKE_CHANNELS], after[FAKE_CELLS_MAX * FAKE_CHANNELS]; /* light of panel pixels */
  double exposure_s, wanted_s;
  int wait; /* frames until the wanted exposure holds */
  uint32_t sequence;
  int presented, delivered;
  uint16_t samples[FAKE_CELLS_MAX * FAKE_K * FAKE_K * FAKE_CHANNELS];
};

static inline void fake_describe_projector(const clt_projector *projector, clt_projector_info *info) {
  *info = ((const fake_projector *)projector)->world->panel;
}

static inline void fake_describe_camera(const clt_camera *camera, clt_camera_info *info) {
  *info = ((const fake_camera *)camera)->world->sensor;
}

static inline clt_status fake_present(clt_projector *projector, const float *codes, int64_t *shown_ns,
                                      clt_error *error) {
  (void)error;
  fake_world *world = ((fake_projector *)projector)->world;
  int64_t refresh = (int64_t)(world->panel.refresh_s * 1e9);
  *shown_ns = (world->now_ns / refresh + 1) * refresh;
  memcpy(world->before, world->after, sizeof world->before);
  for (int i = 0; i < world->panel.width * world->panel.height * world->panel.channels; i++) {
    world->after[i] = (float)clt_curve_decode(&world->projector_curve, codes[i]);
  }
  world->changed_ns = *shown_ns + (int64_t)(world->lag_s * 1e9);
  world->presented++;
  return CLT_OK;
}

static inline clt_status fake_set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  (void)error;
  fake_world *world = ((fake_camera *)camera)->world;
  seconds = world->unit_s > 0 ? world->unit_s * round(seconds / world->unit_s) : seconds;
  if (!world->deaf && seconds != world->wanted_s) {
    world->wanted_s = seconds;
    world->wait = world->exposure_delay;
  }
  return CLT_OK;
}

/* Samples of an exposure from start on; light that changes meanwhile is mixed by time. */
static inline void fake_expose(fake_world *world, int64_t start_ns) {
  double length = world->exposure_s * 1e9, full = (1 << world->sensor.bits) - 1, black = world->sensor.black_level;
  double old = fmin(fmax((double)(world->changed_ns - start_ns) / length, 0), 1);
  int width = world->sensor.width, channels = world->sensor.channels, panel = world->panel.width;
  for (int p = 0; p < width * world->sensor.height; p++) {
    int cell = p / width / FAKE_K * panel + p % width / FAKE_K;
    for (int c = 0; c < channels; c++) {
      int at = c * panel * world->panel.height + cell;
      double light = old * world->before[at] + (1 - old) * world->after[at];
      double radiance = world->gain * light + world->ambient;
      double v = clt_curve_encode(&world->camera_curve, world->sensor.responsivity * radiance * world->exposure_s);
      world->samples[p * channels + c] = (uint16_t)lrint(black + v * (full - black));
    }
  }
}

static inline clt_status fake_next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                                   clt_error *error) {
  fake_world *world = ((fake_camera *)camera)->world;
  int64_t deadline = world->now_ns + (int64_t)(timeout_s * 1e9);
  for (;;) {
    int64_t start = (int64_t)world->sequence * world->frame_ns;
    fake_event event = world->sequence < FAKE_SCRIPT_MAX ? world->script[world->sequence] : FAKE_GOOD;
    world->sequence++;
    if (event == FAKE_GONE) {
      return clt_fail(error, CLT_GONE, "the camera was unplugged");
    }
    if (world->wait > 0) {
      world->wait--;
    } else {
      world->exposure_s = world->wanted_s;
    }
    if (event == FAKE_SILENCE || start + (int64_t)(world->exposure_s * 1e9) > deadline) {
      world->now_ns = event == FAKE_SILENCE ? start : deadline;
      return clt_fail(error, CLT_TIMEOUT, "no frame within %g s", timeout_s);
    }
    world->now_ns = start + (int64_t)(world->exposure_s * 1e9);
    if (event == FAKE_GOOD && start >= not_before_ns) {
      fake_expose(world, start);
      world->delivered++;
      *frame = (clt_frame){world->sensor.width, world->sensor.height, world->sensor.channels,
                           world->sensor.bits,  world->samples,       start,
                           world->exposure_s,   world->sequence - 1};
      return CLT_OK;
    }
  }
}

/* A world of width x height panel pixels that is its own grid, 12 bits, linear, ready for clt_rig_open. */
static inline void fake_world_init(fake_world *world, int width, int height) {
  static const clt_projector_driver projector_driver = {
      .name = "fake", .describe = fake_describe_projector, .present = fake_present};
  static const clt_camera_driver camera_driver = {"fake", fake_describe_camera, fake_set_exposure, fake_next, NULL};
  *world = (fake_world){.panel = {width, height, FAKE_CHANNELS, 8, 1 / 60.0, false},
                        .sensor = {.width = width * FAKE_K,
                                   .height = height * FAKE_K,
                                   .channels = FAKE_CHANNELS,
                                   .bits = 12,
                                   .frame_s = 1 / 30.0,
                                   .exposure_min_s = 1e-4,
                                   .exposure_max_s = 1 / 30.0,
                                   .black_level = 64,
                                   .responsivity = 20,
                                   .full_well = 10000,
                                   .read_noise = 5},
                        .gain = 1,
                        .ambient = 0.01,
                        .lag_s = 0.02,
                        .exposure_delay = 2,
                        .frame_ns = 1000000000 / 30,
                        .exposure_s = 1.0 / 60,
                        .wanted_s = 1.0 / 60};
  world->projector = (fake_projector){{&projector_driver}, world};
  world->camera = (fake_camera){{&camera_driver}, world};
}

/* The settings that fit it: two exposures. */
static inline clt_rig_config fake_rig_config(const fake_world *world) {
  return (clt_rig_config){.width = world->panel.width,
                          .height = world->panel.height,
                          .exposures_s = {1 / 240.0, 1 / 60.0},
                          .exposure_count = 2,
                          .latency_s = world->lag_s,
                          .timeout_s = 0.5,
                          .attempts = 2,
                          .source = "a fake"};
}

#endif
