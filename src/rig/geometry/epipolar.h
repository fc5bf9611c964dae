/* How well a pixel map agrees with the geometry of camera and projector: distances from epipolar lines. */
#ifndef CLT_RIG_GEOMETRY_EPIPOLAR_H
#define CLT_RIG_GEOMETRY_EPIPOLAR_H

#include <stdbool.h>

#include "rig/geometry/lens.h"
#include "rig/geometry/pixel_map.h"

/* Distances, in camera pixels, of decoded pixels from the lines on which their panel coordinates put them: with c and p
 * the undistorted places of camera pixel and panel coordinate and E = [t]x R, |p' E c| over the length of the first two
 * parts of E' p, each over its focal length. */
typedef struct clt_epipolar {
  bool fitted; /* no calibration was given: the fundamental matrix is the map's own, the projector's lens straight */
  long count;  /* decoded pixels */
  double median, upper; /* 50 % and 90 % of them are nearer */
  long sure;            /* of the more confident half: their number */
  double sure_median, sure_upper;
} clt_epipolar;

/* Checks against reference, or NULL; then `lens` (NULL: straight) is the camera's. CLT_BAD_INPUT where fewer than 100
 * pixels are decoded, CLT_FAILED where no fundamental matrix fits; count is then 0. */
clt_status clt_epipolar_check(const clt_pixel_map *map, const clt_stereo *reference, const clt_lens *lens,
                              clt_epipolar *out, clt_error *error);

#endif
