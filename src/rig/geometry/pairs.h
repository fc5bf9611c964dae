/* The frames of a Gray code sequence, reduced as they come: differences of each pair, and what tells the noise. */
#ifndef CLT_RIG_GEOMETRY_PAIRS_H
#define CLT_RIG_GEOMETRY_PAIRS_H

#include <stddef.h>
#include <stdint.h>

#include "counterlight/device.h"
#include "counterlight/image.h"
#include "rig/geometry/patterns.h"

/* Light is linear, less the black level, in steps of full scale / CLT_PAIRS_FULL; of three channels it is their
 * luminance (Rec. 709), for cameras have most green pixels and compressed pictures keep red and blue at half the
 * resolution. */
enum { CLT_PAIRS_FULL = 16383, CLT_PROBES_MAX = 65536 };

/* Zeroed it is valid and empty. */
typedef struct clt_pairs {
  clt_gray gray;
  clt_camera_info sensor;
  int pairs;
  size_t pixels;
  float *light;        /* of every code value */
  float share[3];      /* of a channel in the light */
  int16_t *difference; /* [pair * pixels + i], picture less inverse */
  uint16_t *picture;   /* light of the pair's picture, until its inverse comes */
  float *sum;          /* of all frames */
  uint8_t *saturated;  /* 1 where a sample of any frame reached full scale */
  /* Samples of every frame at probe pixels, a regular grid: probe[(frame * probes + p) * channels + c]. */
  int probes, stride, across; /* probe p stands at x = p % across * stride, y = p / across * stride */
  uint16_t *probe;
} clt_pairs;

/* response: what the camera's samples stand for; picture files are usually sRGB, raw frames linear. */
clt_status clt_pairs_init(clt_pairs *pairs, const clt_gray *gray, const clt_camera_info *sensor,
                          const clt_curve *response, clt_error *error);
void clt_pairs_finish(clt_pairs *pairs); /* accepts an empty one */
/* Takes the frame of picture index in; pictures come in the order of the sequence, and frames have the sensor's size.
 */
void clt_pairs_add(clt_pairs *pairs, int index, const clt_frame *frame);

/* Variance of a difference (and of a sum) of two frames of a pixel: constant + slope * (sum of the two), in light. */
typedef struct clt_pair_noise {
  double constant, slope;
} clt_pair_noise;
/* Light of a pair of frames together, at a probe: of one channel, or of all (channel < 0). */
double clt_pairs_probe(const clt_pairs *pairs, int pair, int probe, int channel);
/* From pairs of wide stripes that follow each other, whose sums differ by noise alone: a line through the median
 * absolute deviations of the probes, by brightness. */
clt_status clt_pairs_noise(const clt_pairs *pairs, clt_pair_noise *noise, clt_error *error);

#endif
