/* A simulated room with everything on, for calibration: its devices, and what is true of it. */
#ifndef CLT_TESTS_RIG_ROUGH_ROOM_H
#define CLT_TESTS_RIG_ROUGH_ROOM_H

#include "counterlight/scene.h"
#include "rig/shots.h"
#include "support.h"

enum { ROUGH_WIDTH = 32, ROUGH_HEIGHT = 24, ROUGH_CELLS = ROUGH_WIDTH * ROUGH_HEIGHT };

/* What a room is made of; text is a string of scene-file keys, or NULL. */
typedef struct rough_settings {
  const char *projector, *camera, *others;
} rough_settings;

typedef struct rough_room {
  clt_scene *scene;
  clt_projector *projector;
  clt_camera *camera;
  clt_shots shots;
} rough_room;

/* Drift, flicker, black and crosstalk. */
#define ROUGH_PANEL                                                                                                    \
  "black = 0.002; crosstalk = [1.0, 0.05, 0.02, 0.03, 1.0, 0.05, 0.01, 0.04, 1.0]; "                                   \
  "drift = { per_hour = -0.01; amplitude = 0.005; period_s = 300; }; "
#define ROUGH_LIGHT "ambient = [0.004, 0.003, 0.002]; flicker = { mains_hz = 50; depth = 0.3; }; "
/* What its rows of crosstalk become when each sums to 1. */
static const double rough_crosstalk[3][3] = {
    {1 / 1.07, 0.05 / 1.07, 0.02 / 1.07}, {0.03 / 1.08, 1 / 1.08, 0.05 / 1.08}, {0.01 / 1.05, 0.04 / 1.05, 1 / 1.05}};

/* Opens the scene of a text with its devices. */
static inline void rough_open_text(rough_room *room, const char *text) {
  char folder[64], path[96];
  clt_error error = {0};
  test_folder(folder);
  snprintf(path, sizeof path, "%s/scene.cfg", folder);
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  assert_ok(clt_scene_open(path, &room->scene, &error), error);
  unlink(path);
  rmdir(folder);
  assert_ok(clt_scene_open_projector(room->scene, &room->projector, &error), error);
  assert_ok(clt_scene_open_camera(room->scene, &room->camera, &error), error);
  clt_rig_config config;
  clt_scene_rig_config(room->scene, &config);
  clt_shots_init(&room->shots, room->projector, room->camera, config.latency_s, 10.0, 3);
}

/* A wall that the projector lights unevenly; further keys of the projector, the camera and the scene. */
static inline void rough_open(rough_room *room, unsigned seed, rough_settings settings) {
  char text[2000];
  snprintf(text, sizeof text,
           "seed = %u; grid = { width = %d; height = %d; channels = 3; rays = 2; }; "
           "projector = { position = [0.5, -2.0, 0.3]; target = [0.0, 0.0, 0.0]; %s }; camera = { %s }; %s "
           "materials = ( { name = \"m\"; albedo = [0.7, 0.6, 0.5]; } ); "
           "surfaces = ( { corner = [-4, 0, -4]; u = [8, 0, 0]; v = [0, 0, 8]; material = \"m\"; } );",
           seed, ROUGH_WIDTH, ROUGH_HEIGHT, settings.projector, settings.camera, settings.others);
  rough_open_text(room, text);
}

static inline void rough_close(rough_room *room) {
  room->camera->driver->close(room->camera);
  room->projector->driver->close(room->projector);
  clt_scene_close(room->scene);
}

/* Light of the dark panel over that of the white one in a channel, of all cells. */
static inline double rough_black(const rough_room *room, int channel) {
  clt_error error = {0};
  clt_image drive = {0}, dark = {0}, white = {0};
  double sums[2] = {0, 0};
  assert_ok(clt_image_init(&drive, 3, ROUGH_HEIGHT, ROUGH_WIDTH, &error), error);
  assert_ok(clt_scene_appearance(room->scene, &drive, &dark, &error), error);
  for (int k = 0; k < 3 * ROUGH_CELLS; k++) {
    drive.data[k] = 1;
  }
  assert_ok(clt_scene_appearance(room->scene, &drive, &white, &error), error);
  for (int i = 0; i < ROUGH_CELLS; i++) {
    sums[0] += (double)dark.data[channel * ROUGH_CELLS + i];
    sums[1] += (double)white.data[channel * ROUGH_CELLS + i];
  }
  clt_image_finish(&drive);
  clt_image_finish(&dark);
  clt_image_finish(&white);
  return sums[0] / sums[1];
}

#endif
