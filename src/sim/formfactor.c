#include "sim/formfactor.h"

#include <stddef.h>

enum { POLYGON_MAX = 8, ORDER_MAX = 4, BISECTIONS_MAX = 12 };

/* Of an edge pair's integral, relative to the smaller area: sixteen of them make H. */
static const double TOLERANCE = 1e-6;
/* Cosine below which two edges do not count as exchanging anything. */
static const double PERPENDICULAR = 1e-12;

/* Angle between two vectors over its sine times their lengths: atan2(|c|, d) / |c|, c = a x b, d = a . b. Small angles
 * by the series of asin(s)/s, whose next term is below 4e-10 at s^2 = 0.01. */
static double angle_ratio(double cross_squared, double dot, double lengths_squared) {
  double s2 = cross_squared / lengths_squared;
  if (dot > 0.0 && s2 < 0.01) {
    return (1.0 + s2 * (1.0 / 6.0 + s2 * (3.0 / 40.0 + s2 * (5.0 / 112.0)))) / sqrt(lengths_squared);
  }
  double across = sqrt(cross_squared);
  return across > 0.0 ? atan2(across, dot) / across : 0.0;
}

/* -1/(2 pi) sum over edges of normal . Gamma: positive for a polygon that is counter-clockwise seen from the point. */
static double contour_sum(clt_vector normal, const clt_vector *polygon, int count) {
  double sum = 0.0;
  for (int k = 0; k < count; k++) {
    clt_vector a = polygon[k], b = polygon[(k + 1) % count];
    clt_vector across = vec_cross(a, b);
    sum += vec_dot(normal, across) * angle_ratio(vec_dot(across, across), vec_dot(a, b), vec_dot(a, a) * vec_dot(b, b));
  }
  return -sum / (2.0 * M_PI);
}

/* Keeps the part of a polygon on the side of the plane through origin that normal points to (Sutherland-Hodgman);
 * returns its number of vertices, relative to origin. */
static int cut(clt_vector origin, clt_vector normal, const clt_vector *vertices, int count, clt_vector *kept) {
  int left = 0;
  for (int k = 0; k < count; k++) {
    clt_vector a = vec_sub(vertices[k], origin), b = vec_sub(vertices[(k + 1) % count], origin);
    double above = vec_dot(normal, a), next = vec_dot(normal, b);
    if (above >= 0.0) {
      kept[left++] = a;
    }
    if ((above > 0.0 && next < 0.0) || (above < 0.0 && next > 0.0)) {
      kept[left++] = vec_along(a, above / (above - next), vec_sub(b, a), 0.0, a);
    }
  }
  return left;
}

double clt_formfactor_point(clt_vector point, clt_vector normal, const clt_vector *vertices, int count,
                            clt_vector plane_normal) {
  clt_vector kept[POLYGON_MAX];
  if (vec_dot(plane_normal, vec_sub(point, vertices[0])) <= 0.0) {
    return 0.0;
  }
  int above = cut(point, normal, vertices, count, kept);
  return above >= 3 ? contour_sum(normal, kept, above) : 0.0;
}

/* Gauss-Legendre rules on 0..1. */
static const struct quadrature {
  double farther_than; /* serves from this distance on, in units of the elements' size */
  int order;
  double at[ORDER_MAX], weight[ORDER_MAX];
} quadratures[] = {
    {40.0, 1, {0.5}, {1.0}},
    {6.0, 2, {0.2113248654051871, 0.7886751345948129}, {0.5, 0.5}},
    {2.0,
     4,
     {0.0694318442029737, 0.3300094782075719, 0.6699905217924281, 0.9305681557970263},
     {0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269}},
};
enum { QUADRATURES = sizeof quadratures / sizeof quadratures[0] };

/* The 4-point rule carries the contour integral too. */
static const struct quadrature *const contour_rule = &quadratures[QUADRATURES - 1];

/* NULL: closer than any serves. */
static const struct quadrature *choose_quadrature(const clt_rectangle *a, const clt_rectangle *b) {
  double size = fmax(fmax(vec_length(a->u), vec_length(a->v)), fmax(vec_length(b->u), vec_length(b->v)));
  double distance = vec_length(vec_sub(clt_rectangle_centre(b), clt_rectangle_centre(a)));
  for (int k = 0; k < QUADRATURES; k++) {
    bool serves = quadratures[k].order > 1 || !a->triangle; /* one point would miss a triangle's middle */
    if (serves && distance >= quadratures[k].farther_than * size) {
      return &quadratures[k];
    }
  }
  return NULL;
}

/* Over a triangle the points are those of a square with one side drawn together (Duffy 1982). */
static double integrate_points(const clt_rectangle *a, const clt_rectangle *b, const clt_vector *vertices,
                               const struct quadrature *rule) {
  double sum = 0.0;
  for (int p = 0; p < rule->order; p++) {
    for (int q = 0; q < rule->order; q++) {
      double t = rule->at[q], across = a->triangle ? 1.0 - t : 1.0, weight = rule->weight[p] * rule->weight[q];
      clt_vector point = vec_along(a->corner, rule->at[p] * across, a->u, t, a->v);
      weight *= a->triangle ? 2.0 * across : 1.0;
      sum += weight * clt_formfactor_point(point, a->normal, vertices, clt_rectangle_vertices(b), b->normal);
    }
  }
  return clt_rectangle_area(a) * sum;
}

typedef struct edge {
  clt_vector start, along; /* unit */
  double length;
} edge;

static edge edge_of(const clt_vector *polygon, int count, int number) {
  clt_vector along = vec_sub(polygon[(number + 1) % count], polygon[number]);
  double length = vec_length(along);
  return (edge){polygon[number], length > 0.0 ? vec_scale(1.0 / length, along) : along, length};
}

/* The integral of ln sqrt(t^2 + d^2) from 0 to t. */
static double integral_of_log(double t, double d) {
  double squared = t * t + d * d;
  return squared > 0.0 ? 0.5 * t * log(squared) - t + (d > 0.0 ? d * atan(t / d) : 0.0) : 0.0;
}

/* The integral of ln r over the edge, seen from a point. */
static double log_along(const edge *over, clt_vector from) {
  clt_vector to_start = vec_sub(from, over->start);
  double foot = vec_dot(to_start, over->along), d = vec_length(vec_cross(over->along, to_start));
  return integral_of_log(over->length - foot, d) + integral_of_log(foot, d);
}

static double log_between(const edge *a, const edge *b, double from, double to) {
  double sum = 0.0;
  for (int k = 0; k < contour_rule->order; k++) {
    double s = from + (to - from) * contour_rule->at[k];
    sum += contour_rule->weight[k] * log_along(b, vec_along(a->start, s, a->along, 0.0, a->along));
  }
  return (to - from) * sum;
}

/* The integral of ln r over both edges, the interval of a bisected until both halves together say what the whole says.
 */
static double bisect(const edge *a, const edge *b, double from, double to, double whole, double tolerance, int depth) {
  double middle = 0.5 * (from + to);
  double low = log_between(a, b, from, middle), high = log_between(a, b, middle, to);
  if (depth == 0 || fabs(low + high - whole) <= tolerance) {
    return low + high;
  }
  return bisect(a, b, from, middle, low, tolerance, depth - 1) + bisect(a, b, middle, to, high, tolerance, depth - 1);
}

static double integrate_contours(const clt_vector *a, int count_a, const clt_vector *b, int count_b, double tolerance) {
  double sum = 0.0;
  for (int i = 0; i < count_a; i++) {
    edge from = edge_of(a, count_a, i);
    for (int j = 0; j < count_b; j++) {
      edge to = edge_of(b, count_b, j);
      double parallel = vec_dot(from.along, to.along);
      if (fabs(parallel) > PERPENDICULAR) {
        double whole = log_between(&from, &to, 0.0, from.length);
        sum += parallel * bisect(&from, &to, 0.0, from.length, whole, tolerance, BISECTIONS_MAX);
      }
    }
  }
  return fmax(0.0, sum / (2.0 * M_PI));
}

/* True where some vertex lies behind the plane of `plane`. */
static bool reaches_behind(const clt_vector *vertices, int count, const clt_rectangle *plane) {
  for (int k = 0; k < count; k++) {
    if (vec_dot(plane->normal, vec_sub(vertices[k], plane->corner)) < 0.0) {
      return true;
    }
  }
  return false;
}

double clt_formfactor_exchange(const clt_rectangle *a, const clt_rectangle *b) {
  clt_vector corners_a[4], corners_b[4], kept_a[POLYGON_MAX], kept_b[POLYGON_MAX];
  for (int k = 0; k < 4; k++) {
    corners_a[k] = clt_rectangle_vertex(a, k);
    corners_b[k] = clt_rectangle_vertex(b, k);
  }
  int vertices_a = clt_rectangle_vertices(a), vertices_b = clt_rectangle_vertices(b);
  const struct quadrature *rule = choose_quadrature(a, b);
  if (rule != NULL && !reaches_behind(corners_a, vertices_a, b)) {
    return integrate_points(a, b, corners_b, rule);
  }
  int count_a = cut(b->corner, b->normal, corners_a, vertices_a, kept_a);
  int count_b = cut(a->corner, a->normal, corners_b, vertices_b, kept_b);
  if (count_a < 3 || count_b < 3) {
    return 0.0;
  }
  for (int k = 0; k < count_b; k++) { /* both relative to the corner of b */
    kept_b[k] = vec_add(kept_b[k], vec_sub(a->corner, b->corner));
  }
  double smaller = fmin(clt_rectangle_area(a), clt_rectangle_area(b));
  return integrate_contours(kept_a, count_a, kept_b, count_b, TOLERANCE * smaller);
}
