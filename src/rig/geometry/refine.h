/* Neighbours of a pixel map put in line: outliers out, coordinates from robust local fits. */
#ifndef CLT_RIG_GEOMETRY_REFINE_H
#define CLT_RIG_GEOMETRY_REFINE_H

#include "rig/geometry/pixel_map.h"

/* Replaces each decoded coordinate by that of a plane x(u, v) = a + b u + c v through the neighbours on the same
 * surface (those that differ by no more than the map's own pitch and their noise explain), weighted by 1 / variance; of
 * a quadratic where a panel pixel spans so many camera pixels that windows are wide. Where the window around a pixel
 * holds two surfaces (a crease, an edge in depth), one beside it is taken if it fits better. A pixel that few
 * neighbours support or that the surface contradicts becomes isolated. variance[axis * pixels + i] is that of each
 * coordinate, panel pixels squared. Fills the confidences and *pitch, panel pixels from one camera pixel to the next
 * (median). */
clt_status clt_pixel_map_refine(clt_pixel_map *map, const float *variance, double *pitch, clt_error *error);

#endif
