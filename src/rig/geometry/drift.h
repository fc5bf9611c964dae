/* Whether the camera held still: a picture and its inverse light the panel evenly together, so that their sums must not
 * change from pair to pair. */
#ifndef CLT_RIG_GEOMETRY_DRIFT_H
#define CLT_RIG_GEOMETRY_DRIFT_H

#include "rig/finding.h"
#include "rig/geometry/pairs.h"

/* Sums of each pair over those of the whole sequence, medians over lit probes; 1 where nothing moves. */
typedef struct clt_drift {
  int pairs, channels;
  double all[CLT_GRAY_PAIRS_MAX][3];  /* of all lit probes; NaN where these are few */
  double wide[CLT_GRAY_PAIRS_MAX][3]; /* of the probes at which the pair's stripes and wide ones stand out alike, which
                                         blur does not touch; NaN where these are few */
  double noise;                       /* standard error of the above */
} clt_drift;

/* CLT_FAILED where memory is short; a sequence that lights nothing gives ones. */
clt_status clt_drift_measure(const clt_pairs *pairs, clt_drift *drift, clt_error *error);
/* Says what moved by more than a percent beyond the noise, by how much and what to do: exposure, gain or white balance
 * where wide stripes' sums move (with the channel that moves most), and the response where only fine stripes' sums do.
 */
void clt_drift_judge(const clt_drift *drift, clt_findings *findings);
/* Largest less smallest sum over pairs of a channel, relative to 1; wide: of what blur does not touch. */
double clt_drift_span(const clt_drift *drift, int channel, bool wide);

#endif
