/* A scene for the tests of effects: 6 x 4 cells, 3 channels, light between all cells. Its frames carry no noise and no
 * response, so that what is seen is light. */
#ifndef CLT_TESTS_SIM_WIDE_H
#define CLT_TESTS_SIM_WIDE_H

#include "rig_pair.h"

#define WIDE_PANEL "response = \"linear\"; bits = 16; black = 0.0; "
#define WIDE_CAMERA "bits = 16; responsivity = 20.0; photon_noise = false; read_noise = 0.0; black_level = 0; "
enum { WIDE_WIDTH = 6, WIDE_HEIGHT = 4, WIDE_CELLS = 24, WIDE_VALUES = 72 };
#define WIDE_SETTLED 50000000 /* ns: more than the latency */

/* Further keys of the projector, the camera and the scene, which has the ambient light 0.002 unless they say otherwise.
 */
rig_pair wide_open(const char *panel, const char *camera, const char *settings);
void wide_codes(float codes[WIDE_VALUES]);
/* Drive of a code. */
double wide_drive(float code);
/* T_ij of a channel. */
double wide_entry(int channel, int i, int j);
/* T x in double at a cell of a channel, for drive x of the whole panel. */
double wide_light(const double *x, int channel, int cell);
/* Radiance under codes by `T drive`, channels * cells values. */
void wide_radiance(const float *codes, double radiance[WIDE_VALUES]);
/* Radiance that a sample of a frame stands for. */
double wide_pixel(const clt_frame *frame, int x, int y, int channel);
/* The same in the cell of value k. */
double wide_seen(const clt_frame *frame, int k);

#endif
