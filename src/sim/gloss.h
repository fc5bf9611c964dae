/* The glossy lobe of a surface (clt_gloss), of strength 1. All directions are unit and point away from the surface. */
#ifndef CLT_SIM_GLOSS_H
#define CLT_SIM_GLOSS_H

#include "sim/geometry.h"

/* Radiance towards `view` per irradiance from `light`, 1/sr: (n + 2) / (2 pi) cos^n alpha, alpha the angle between the
 * view and the mirror direction of the light; 0 beyond a right angle. The same with light and view exchanged. Over the
 * hemisphere of views it carries the fraction 1 of light along the normal, less of slanting light. */
double clt_gloss_lobe(double exponent, clt_vector normal, clt_vector light, clt_vector view);

/* A direction from which light is thrown to `view`, drawn by (n + 1) / (2 pi) cos^n alpha around the view's mirror
 * direction from s and t, 0 <= s, t < 1. Returns what the radiance from there counts in a mean over such directions,
 * (n + 2) / (n + 1) cos theta, so that the mean is the radiance thrown to the view; 0 below the surface. */
double clt_gloss_sample(double exponent, clt_vector normal, clt_vector view, double s, double t, clt_vector *from);

#endif
