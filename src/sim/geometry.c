#include "sim/geometry.h"

/* Distances along a ray, and to a plane, below which points count as touching, relative to their lengths. */
static const double TOUCHING = 1e-9;

bool clt_rectangle_complete(clt_rectangle *rectangle) {
  clt_vector across = vec_cross(rectangle->u, rectangle->v);
  double u = vec_length(rectangle->u), v = vec_length(rectangle->v), area = vec_length(across);
  bool skewed = fabs(vec_dot(rectangle->u, rectangle->v)) > 1e-6 * u * v;
  if (!(u > 1e-6 && v > 1e-6 && area > 1e-6 * u * v) || (skewed && !rectangle->triangle)) {
    return false;
  }
  rectangle->normal = vec_scale(1.0 / area, across);
  return true;
}

int clt_rectangle_vertices(const clt_rectangle *rectangle) {
  return rectangle->triangle ? 3 : 4;
}

clt_vector clt_rectangle_vertex(const clt_rectangle *rectangle, int number) {
  double s = number == 1 || (number == 2 && !rectangle->triangle), t = number >= 2;
  return vec_along(rectangle->corner, s, rectangle->u, t, rectangle->v);
}

double clt_rectangle_area(const clt_rectangle *rectangle) {
  return rectangle->triangle ? 0.5 * vec_length(vec_cross(rectangle->u, rectangle->v))
                             : vec_length(rectangle->u) * vec_length(rectangle->v);
}

clt_vector clt_rectangle_centre(const clt_rectangle *rectangle) {
  double middle = rectangle->triangle ? 1.0 / 3.0 : 0.5;
  return vec_along(rectangle->corner, middle, rectangle->u, middle, rectangle->v);
}

clt_vector clt_rectangle_point(const clt_rectangle *rectangle, double s, double t) {
  bool fold = rectangle->triangle && s + t > 1.0; /* the other half of the parallelogram, turned around */
  return vec_along(rectangle->corner, fold ? 1.0 - s : s, rectangle->u, fold ? 1.0 - t : t, rectangle->v);
}

/* p . u' / (u . u') with u' = u less its part along v: s of a point p = s u + t v. */
static double coordinate(clt_vector p, clt_vector u, clt_vector v) {
  clt_vector only = vec_along(u, -vec_dot(u, v) / vec_dot(v, v), v, 0.0, v);
  return vec_dot(p, only) / vec_dot(u, only);
}

clt_hit clt_hit_on_plane(const clt_rectangle *rectangle, clt_vector origin, clt_vector direction) {
  double slope = vec_dot(rectangle->normal, direction);
  clt_hit hit = {.front = slope < 0.0};
  hit.distance = vec_dot(rectangle->normal, vec_sub(rectangle->corner, origin)) / slope;
  clt_vector at = vec_sub(vec_add(origin, vec_scale(hit.distance, direction)), rectangle->corner);
  hit.s = coordinate(at, rectangle->u, rectangle->v);
  hit.t = coordinate(at, rectangle->v, rectangle->u);
  return hit;
}

/* Where the ray meets the rectangle; false where it does not, or only runs along its plane (distance and places are
 * then not finite). */
static bool meet(const clt_rectangle *rectangle, clt_vector origin, clt_vector direction, clt_hit *hit) {
  *hit = clt_hit_on_plane(rectangle, origin, direction);
  return isfinite(hit->distance) && hit->distance > TOUCHING && hit->s >= 0.0 && hit->s <= 1.0 && hit->t >= 0.0 &&
         hit->t <= 1.0 && (!rectangle->triangle || hit->s + hit->t <= 1.0);
}

clt_hit clt_first_hit(const clt_rectangle *rectangles, int count, clt_vector origin, clt_vector direction,
                      int leaving) {
  clt_hit first = {.surface = -1, .distance = INFINITY};
  for (int k = 0; k < count; k++) {
    clt_hit hit;
    if (k != leaving && meet(&rectangles[k], origin, direction, &hit) && hit.distance < first.distance) {
      first = hit;
      first.surface = k;
    }
  }
  return first;
}

bool clt_segment_blocked(const clt_rectangle *rectangles, int count, clt_vector from, clt_vector to, int a, int b) {
  clt_vector direction = vec_sub(to, from);
  for (int k = 0; k < count; k++) {
    clt_hit hit;
    if (k != a && k != b && meet(&rectangles[k], from, direction, &hit) && hit.distance < 1.0 - TOUCHING) {
      return true;
    }
  }
  return false;
}

int clt_rectangle_sides(const clt_rectangle *plane, const clt_rectangle *of) {
  double reach = vec_length(of->u) + vec_length(of->v) + vec_length(vec_sub(of->corner, plane->corner));
  int found = 0;
  for (int k = 0; k < clt_rectangle_vertices(of); k++) {
    double height = vec_dot(plane->normal, vec_sub(clt_rectangle_vertex(of, k), plane->corner));
    found |= height > TOUCHING * reach ? 1 : height < -TOUCHING * reach ? 2 : 0;
  }
  return found;
}

bool clt_rectangles_may_be_parted(const clt_rectangle *rectangles, int count, int a, int b) {
  for (int k = 0; k < count; k++) {
    if (k != a && k != b &&
        (clt_rectangle_sides(&rectangles[k], &rectangles[a]) | clt_rectangle_sides(&rectangles[k], &rectangles[b])) ==
            3) {
      return true;
    }
  }
  return false;
}

bool clt_rectangles_face(const clt_rectangle *a, const clt_rectangle *b) {
  return (clt_rectangle_sides(a, b) & 1) != 0 && (clt_rectangle_sides(b, a) & 1) != 0;
}

static void extent(const clt_rectangle *of, clt_vector axis, double *low, double *high) {
  *low = INFINITY;
  *high = -INFINITY;
  for (int k = 0; k < clt_rectangle_vertices(of); k++) {
    double at = vec_dot(axis, clt_rectangle_vertex(of, k));
    *low = fmin(*low, at);
    *high = fmax(*high, at);
  }
}

/* True where a line along an edge of `edges` parts it from `other` on their plane. */
static bool edge_parts(const clt_rectangle *edges, const clt_rectangle *other) {
  const double share = 1e-6; /* of the smaller extent: what rounding makes neighbours overlap by, and far more */
  int corners = clt_rectangle_vertices(edges);
  for (int k = 0; k < corners; k++) {
    clt_vector edge = vec_sub(clt_rectangle_vertex(edges, (k + 1) % corners), clt_rectangle_vertex(edges, k));
    double low[2], high[2];
    extent(edges, vec_cross(edges->normal, edge), &low[0], &high[0]);
    extent(other, vec_cross(edges->normal, edge), &low[1], &high[1]);
    double common = fmin(high[0], high[1]) - fmax(low[0], low[1]);
    if (common <= share * fmin(high[0] - low[0], high[1] - low[1])) {
      return true;
    }
  }
  return false;
}

/* Two convex pieces of a plane have no area in common where an edge of one of them parts them. */
bool clt_rectangles_coincide(const clt_rectangle *a, const clt_rectangle *b) {
  return vec_dot(a->normal, b->normal) > 0.5 && clt_rectangle_sides(a, b) == 0 && clt_rectangle_sides(b, a) == 0 &&
         !edge_parts(a, b) && !edge_parts(b, a);
}

bool clt_pinhole_aim(clt_pinhole *pinhole, clt_vector target, clt_vector up) {
  clt_vector view = vec_sub(target, pinhole->position);
  clt_vector side = vec_cross(view, up);
  if (!(vec_length(side) > 1e-6 * vec_length(view) * vec_length(up))) {
    return false;
  }
  pinhole->forward = vec_unit(view);
  pinhole->right = vec_unit(side);
  pinhole->up = vec_cross(pinhole->right, pinhole->forward);
  return true;
}

clt_vector clt_pinhole_direction(const clt_pinhole *pinhole, double x, double y) {
  return vec_along(pinhole->forward, x * pinhole->tangent[0], pinhole->right, y * pinhole->tangent[1], pinhole->up);
}

bool clt_pinhole_covers(const clt_pinhole *pinhole, clt_vector at) {
  clt_vector view = vec_sub(at, pinhole->position);
  double depth = vec_dot(view, pinhole->forward);
  return depth > 0.0 && fabs(vec_dot(view, pinhole->right)) <= depth * pinhole->tangent[0] &&
         fabs(vec_dot(view, pinhole->up)) <= depth * pinhole->tangent[1];
}
