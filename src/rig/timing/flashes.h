/* Latency and jitter from flashes: full fields, dark or bright by chance, and when the camera sees them.
 *
 * A frame that was exposed while the light changed holds a share of both fields, so that time is read finer than frames
 * come. With flash i on the panel at shown_i and its light complete tau later, frame f of exposure [a, a + t] shows
 *   m_f = sum_i level_i * |[shown_i + tau, shown_(i+1) + tau] within [a, a + t]| / t,
 * and tau is where the squares of the differences to what was seen are least: the maximum of the likelihood under equal
 * Gaussian errors, found among all delays up to a bound and refined around the best. Each change alone then gives its
 * own delay by the frames around it, which is the histogram and the jitter. Where a camera closes its shutter between
 * frames, and changes always come meanwhile, a range of delays fits equally well; its middle is taken. */
#ifndef CLT_RIG_TIMING_FLASHES_H
#define CLT_RIG_TIMING_FLASHES_H

#include "rig/finding.h"
#include "rig/shots.h"

enum { CLT_LATENCY_BINS = 40 };

typedef struct clt_latency_options {
  int flashes;       /* 8..512; 0 means 64 */
  double longest_s;  /* delay looked for; 0 means 0.5 */
  double exposure_s; /* at which the bright field is not saturated; 0: the camera's frame time */
  unsigned seed;     /* of the flashes */
  bool (*progress)(void *context, int done,
                   int total); /* after every flash; false stops (CLT_CANCELLED). May be NULL */
  void *context;
} clt_latency_options;

typedef struct clt_latency {
  double seconds;                  /* from a refresh's start until its light: the estimate */
  double jitter_s;                 /* standard deviation of single changes */
  double earliest_s, latest_s;     /* of single changes */
  double complete_s;               /* for clt_rig_config.latency_s: the latest and a margin of a quarter of a refresh */
  double uncertain_s;              /* half of the range of delays that fit equally well: gaps between exposures */
  double misfit;                   /* rms of the frames' departure, of the step from dark to bright */
  int changes;                     /* that frames around them timed to a quarter of a frame */
  int histogram[CLT_LATENCY_BINS]; /* of single changes; from bin_first_s, each bin_s wide */
  double bin_first_s, bin_s;
  long frames;
  long lost;       /* numbers missing between successive frames */
  long duplicates; /* frames with the samples of the one before */
  long wrong;      /* frames that fit no delay: late in content, or torn */
  double frame_s;  /* from frame to frame, median */
} clt_latency;

/* Shows flashes and takes every frame meanwhile. CLT_FAILED where the camera does not see them, or nothing fits: the
 * message has the numbers. */
clt_status clt_latency_measure(clt_shots *shots, const clt_latency_options *options, clt_latency *out,
                               clt_findings *findings, clt_error *error);

#endif
