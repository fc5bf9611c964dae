/* A camera's lens: a pinhole whose image is distorted as Brown (1966) and Conrady (1919) describe it, in the form and
 * with the signs of OpenCV. In normalised coordinates, x to the right and y down at distance 1 from the lens, a
 * direction (x, y) with r^2 = x^2 + y^2 appears at
 *   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
 *   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y. */
#ifndef CLT_SIM_OPTICS_H
#define CLT_SIM_OPTICS_H

#include "sim/geometry.h"

enum { CLT_DISTORTION = 5 }; /* coefficients: k1, k2, p1, p2, k3 */

/* Where a direction appears. */
void clt_optics_distort(const double distortion[CLT_DISTORTION], const double direction[2], double seen[2]);
/* The direction that appears there, by Newton's iteration; false where none is found on this side of the distance at
 * which the image would fold back over itself. */
bool clt_optics_undistort(const double distortion[CLT_DISTORTION], const double seen[2], double direction[2]);

/* The direction (as clt_pinhole_direction gives it) of what is seen at image coordinates x, y; false as above. */
bool clt_optics_direction(const clt_pinhole *pinhole, const double distortion[CLT_DISTORTION], double x, double y,
                          clt_vector *direction);
/* Whether a place lies in the image. */
bool clt_optics_covers(const clt_pinhole *pinhole, const double distortion[CLT_DISTORTION], clt_vector at);

#endif
