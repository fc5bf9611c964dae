/* HDR merge: the frames of one pattern at several exposures to the radiance of every cell.
 *
 * With v = (sample - black level) / (full scale - black level) and h = decode(v) the fraction of full scale that light
 * reached, a sample taken for t seconds estimates the rate e = responsivity * radiance by h / t. Its variance is
 *   (e t / W + (s_r / W)^2 + (h'(v) q)^2 / 12) / t^2
 * (photons, reading, quantisation; W full well in electrons, s_r read noise in electrons, q a step of the camera as one
 * of v), evaluated at the merged e and not at the sample, so that a dark fluctuation gets no more weight than a bright
 * one (Granados et al. 2010). Saturated exposures are left out, and so are dead ones, dark where two others show light.
 */
#ifndef CLT_RIG_MERGE_H
#define CLT_RIG_MERGE_H

#include "counterlight/device.h"
#include "counterlight/image.h"
#include "rig/footprint.h"

enum { CLT_EXPOSURES_MAX = 8 };

/* What one exposure tells of one cell and channel. */
typedef struct clt_merge_sum {
  float light; /* mean of h over the unsaturated samples, by the footprint's weights */
  float count; /* their number, of weights alike; 0: the exposure is saturated, or the cell is not seen */
  float raw;   /* mean code value of all samples */
} clt_merge_sum;

/* Workspace of the merge, allocated once. Zeroed it is valid and empty. */
typedef struct clt_merge {
  clt_camera_info camera;
  const clt_footprints *footprints; /* not owned; outlives the merge */
  int exposures;
  double seconds[CLT_EXPOSURES_MAX]; /* what the frames really had */
  float *light;                      /* h of every code value */
  float *step;                       /* of the camera at every code value, in h */
  float saturated;                   /* least code value that is left out */
  float full;                        /* an exposure is left out for a cell whose mean code value reaches this */
  clt_merge_sum *sums;               /* [(exposure * channels + c) * cells + i] */
} clt_merge;

clt_status clt_merge_init(clt_merge *merge, const clt_camera_info *camera, const clt_curve *response,
                          const clt_footprints *footprints, int exposures, clt_error *error);
void clt_merge_finish(clt_merge *merge);

/* Takes the frame of one exposure in (0 <= exposure < exposures); its size is the camera's. */
void clt_merge_add(clt_merge *merge, int exposure, const clt_frame *frame);
/* Merges what was taken in: mean radiance of every cell over its footprint (negative values are kept) and its standard
 * deviation; both images have the grid's size. Where no exposure is left the deviation is infinite and the radiance is
 * the largest that the exposures prove (0 where the cell is not seen). */
void clt_merge_radiance(const clt_merge *merge, clt_image *radiance, clt_image *deviation);

/* Variance of the rate that one exposure of t seconds gives a value, were the rate e, over lights alike: noise, and
 * rounding that the samples share where noise is too small to dither it. */
double clt_merge_variance(const clt_merge *merge, const clt_merge_sum *sum, double t, double e);
/* The part of it that is less the more samples there are. */
double clt_merge_noise(const clt_merge *merge, const clt_merge_sum *sum, double t, double e);
/* Standard deviation, in radiance, of the part that they share, without light, by an exposure of t seconds. */
double clt_merge_rounding(const clt_merge *merge, double t);
/* The most by which that rate is off for a reason that all samples of the cell share, so that their number is no help:
 * rounding to steps of the camera, which noise of s steps dithers to at most exp(-2 pi^2 s^2) / 2 steps (Widrow and
 * Kollar, Quantization Noise, 2008), in the sample and in the black level; and noise that is cut off at code 0, whose
 * mean is too high by s (phi(z) - z Q(z)) where the light lies z deviations above. */
double clt_merge_bias(const clt_merge *merge, const clt_merge_sum *sum, double t, double e);

#endif
