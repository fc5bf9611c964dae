/* The camera's response by bracketing: fields of a few brightnesses at several exposure times.
 *
 * With h the response (sample over full scale to light) on 65 equidistant nodes H_j and hats b_j(v) between them, the
 * mean light of a group of pixels in one frame is sum_j a_j H_j, a_j the mean of b_j over its samples: exact under
 * noise, for noise adds to light before it is encoded. Light grows with exposure, so for field and group g
 *   sum_j a_gkj H_j = e_g t_k
 * for every exposure k. H_0 = 0, and H minimises the weighted squares of the differences, e_g eliminated
 * (Debevec & Malik 1997 in linear instead of logarithmic form, which lets values scatter around zero), plus a little
 * third difference that carries H over what no sample reached; scaled to H_64 = 1 and made monotone at the
 * end.
 *
 * Ambient light that flickers averages out over a number of frames that is a multiple of 3: at 25, 30, 50 or 60 frames
 * a second 100 and 120 Hz are seen as 0, 10 or 20 Hz, of which 3 successive frames are whole periods or constant. */
#ifndef CLT_RIG_PHOTOMETRY_CAMERA_RESPONSE_H
#define CLT_RIG_PHOTOMETRY_CAMERA_RESPONSE_H

#include "rig/photometry/field.h"

enum { CLT_BRACKET_FIELDS = 9, CLT_BRACKET_EXPOSURES = 8 };

typedef struct clt_camera_response {
  clt_curve curve;   /* LINEAR where proportionality holds, else TABLE */
  double proportion; /* largest departure from samples proportional to exposure, of full scale */
  double residual;   /* deviation of what the curve leaves, relative to the light */
  double covered[2]; /* range of samples seen, fraction of full scale */
} clt_camera_response;

/* Brackets with exposures of shortest_s times 1, 2, 3, 5, 8, ... as far as the camera goes; shortest_s is one that
 * leaves the white panel unsaturated. The bench's black level and groups are there. CLT_FAILED where the fields span
 * too little. */
clt_status clt_camera_response_measure(clt_field_bench *bench, double shortest_s, int frames, clt_camera_response *out,
                                       clt_error *error);

#endif
