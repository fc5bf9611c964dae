/* A small scene with its devices open: 4 x 3 cells, one channel, T = diag(1 + 0.1 i). */
#ifndef CLT_TESTS_SIM_RIG_PAIR_H
#define CLT_TESTS_SIM_RIG_PAIR_H

#include "room.h"

enum { PAIR_CELLS = 12 };

typedef struct rig_pair {
  clt_scene *scene;
  clt_projector *projector;
  clt_camera *camera;
  clt_camera_info sensor;
} rig_pair;

/* settings: further lines of the scene file. Without any: no ambient, no panel black, linear 16-bit panel. */
rig_pair pair_open(const char *settings);
/* The same around a scene of any size, which pair_close closes. */
rig_pair pair_of(clt_scene *scene);
void pair_close(rig_pair *pair);

/* Shows codes (the same in every cell for pair_show_level); returns when the refresh starts. */
int64_t pair_show(rig_pair *pair, const float *codes);
int64_t pair_show_level(rig_pair *pair, float code);
/* The next frame from not_before on; fails the test where none comes. */
clt_frame pair_frame(rig_pair *pair, int64_t not_before);
/* Sets an exposure and takes frames until it holds. */
void pair_expose(rig_pair *pair, double seconds);

/* Mean over a cell's pixels of (sample - black level) / (full scale - black level). */
double pair_signal(const rig_pair *pair, const clt_frame *frame, int cell);
/* Radiance of cell i under full drive. */
double pair_gain(int cell);

#endif
