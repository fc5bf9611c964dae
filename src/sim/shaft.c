#include "sim/shaft.h"

static void interval(clt_vector axis, const clt_vector *points, int count, double *low, double *high) {
  *low = INFINITY;
  *high = -INFINITY;
  for (int k = 0; k < count; k++) {
    double at = vec_dot(axis, points[k]);
    *low = fmin(*low, at);
    *high = fmax(*high, at);
  }
}

static clt_vector middle(const clt_vector corner[4]) {
  return vec_scale(0.25, vec_add(vec_add(corner[0], corner[1]), vec_add(corner[2], corner[3])));
}

/* Across the shaft and along an edge; the zero vector, which parts nothing, where the edge runs along it. */
static clt_vector across(clt_vector way, clt_vector from, clt_vector to) {
  clt_vector axis = vec_cross(way, vec_sub(to, from));
  double length = vec_length(axis);
  return length > 0.0 ? vec_scale(1.0 / length, axis) : axis;
}

void clt_shaft_init(clt_shaft *shaft, const clt_vector a[4], clt_vector normal_a, const clt_vector b[4],
                    clt_vector normal_b) {
  clt_vector way = vec_sub(middle(b), middle(a));
  const clt_vector axes[CLT_SHAFT_AXES] = {
      {1.0, 0.0, 0.0},         {0.0, 1.0, 0.0},         {0.0, 0.0, 1.0},         vec_scale(1.0 / vec_length(way), way),
      across(way, a[0], a[1]), across(way, a[1], a[2]), across(way, b[0], b[1]), across(way, b[1], b[2])};
  for (int k = 0; k < 4; k++) {
    shaft->corner[k] = a[k];
    shaft->corner[4 + k] = b[k];
  }
  shaft->normal[0] = normal_a;
  shaft->normal[1] = normal_b;
  shaft->touching = 1e-9 * (vec_length(way) + vec_length(vec_sub(a[2], a[0])) + vec_length(vec_sub(b[2], b[0])));
  for (int k = 0; k < CLT_SHAFT_AXES; k++) {
    shaft->axis[k] = axes[k];
    interval(axes[k], shaft->corner, 8, &shaft->low[k], &shaft->high[k]);
  }
}

/* True where the plane has corners of the shaft well on both sides. */
static bool crosses_plane(const clt_shaft *shaft, const clt_rectangle *surface) {
  double low, high, at = vec_dot(surface->normal, surface->corner);
  interval(surface->normal, shaft->corner, 8, &low, &high);
  return low < at - shaft->touching && high > at + shaft->touching;
}

bool clt_shaft_may_hold(const clt_shaft *shaft, const clt_rectangle *surface) {
  if (!crosses_plane(shaft, surface)) {
    return false;
  }
  clt_vector points[4];
  double low, high;
  for (int k = 0; k < 4; k++) {
    points[k] = clt_rectangle_vertex(surface, k);
  }
  for (int end = 0; end < 2; end++) { /* nothing passes behind either end */
    interval(shaft->normal[end], points, 4, &low, &high);
    if (high <= vec_dot(shaft->normal[end], shaft->corner[4 * end]) + shaft->touching) {
      return false;
    }
  }
  for (int k = 0; k < CLT_SHAFT_AXES; k++) {
    interval(shaft->axis[k], points, 4, &low, &high);
    if (low > shaft->high[k] - shaft->touching && high > shaft->low[k] + shaft->touching) {
      return false;
    }
    if (high < shaft->low[k] + shaft->touching && low < shaft->high[k] - shaft->touching) {
      return false;
    }
  }
  return true;
}

bool clt_shaft_closed_by(const clt_shaft *shaft, const clt_rectangle *surface) {
  for (int i = 0; i < 4; i++) {
    for (int j = 4; j < 8; j++) {
      clt_vector way = vec_sub(shaft->corner[j], shaft->corner[i]);
      clt_hit hit = clt_hit_on_plane(surface, shaft->corner[i], way);
      bool between = hit.distance > 1e-9 && hit.distance < 1.0 - 1e-9;
      bool inside = hit.s >= 0.0 && hit.t >= 0.0 && hit.s <= 1.0 && hit.t <= 1.0;
      if (!between || !inside || (surface->triangle && hit.s + hit.t > 1.0)) {
        return false;
      }
    }
  }
  return true;
}
