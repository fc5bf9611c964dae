#include "sim/gloss.h"

static clt_vector mirrored(clt_vector normal, clt_vector direction) {
  return vec_along(vec_scale(-1.0, direction), 2.0 * vec_dot(normal, direction), normal, 0.0, normal);
}

double clt_gloss_lobe(double exponent, clt_vector normal, clt_vector light, clt_vector view) {
  double cosine = vec_dot(mirrored(normal, light), view);
  if (cosine <= 0.0 || vec_dot(normal, view) <= 0.0 || vec_dot(normal, light) <= 0.0) {
    return 0.0;
  }
  return (exponent + 2.0) / (2.0 * M_PI) * pow(fmin(cosine, 1.0), exponent);
}

double clt_gloss_sample(double exponent, clt_vector normal, clt_vector view, double s, double t, clt_vector *from) {
  clt_vector axis = mirrored(normal, view);
  double cosine = pow(1.0 - s, 1.0 / (exponent + 1.0)), sine = sqrt(fmax(0.0, 1.0 - cosine * cosine));
  /* any two directions across the axis: the lobe is round */
  clt_vector some = fabs(axis.z) < 0.7 ? (clt_vector){0.0, 0.0, 1.0} : (clt_vector){1.0, 0.0, 0.0};
  clt_vector across = vec_unit(vec_cross(axis, some)), other = vec_cross(axis, across);
  *from = vec_along(vec_scale(cosine, axis), sine * cos(2.0 * M_PI * t), across, sine * sin(2.0 * M_PI * t), other);
  return fmax(0.0, vec_dot(*from, normal)) * (exponent + 2.0) / (exponent + 1.0);
}
