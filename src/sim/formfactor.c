#include "sim/formfactor.h"

enum { POLYGON_MAX = 8, ORDER_MAX = 8 };

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

/* Keeps the part of a polygon with height >= 0 (Sutherland-Hodgman); returns its number of vertices. */
static int cut_horizon(clt_vector normal, const clt_vector vertices[4], clt_vector kept[POLYGON_MAX]) {
  int count = 0;
  for (int k = 0; k < 4; k++) {
    clt_vector a = vertices[k], b = vertices[(k + 1) % 4];
    double above = vec_dot(normal, a), next = vec_dot(normal, b);
    if (above >= 0.0) {
      kept[count++] = a;
    }
    if ((above > 0.0 && next < 0.0) || (above < 0.0 && next > 0.0)) {
      kept[count++] = vec_along(a, above / (above - next), vec_sub(b, a), 0.0, a);
    }
  }
  return count;
}

double clt_formfactor_point(clt_vector point, clt_vector normal, const clt_vector vertices[4],
                            clt_vector plane_normal) {
  clt_vector seen[4], kept[POLYGON_MAX];
  if (vec_dot(plane_normal, vec_sub(point, vertices[0])) <= 0.0) {
    return 0.0;
  }
  int above = 0;
  for (int k = 0; k < 4; k++) {
    seen[k] = vec_sub(vertices[k], point);
    above += vec_dot(normal, seen[k]) >= 0.0;
  }
  if (above == 4) {
    return contour_sum(normal, seen, 4);
  }
  int count = above > 0 ? cut_horizon(normal, seen, kept) : 0;
  return count >= 3 ? contour_sum(normal, kept, count) : 0.0;
}

/* Gauss-Legendre rules on 0..1; rows of orders 1, 2, 4 and 8. */
static const struct quadrature {
  double farther_than; /* serves from this distance on, in units of the elements' size */
  int order;
  double at[ORDER_MAX], weight[ORDER_MAX];
} quadratures[] = {
    {20.0, 1, {0.5}, {1.0}},
    {6.0, 2, {0.2113248654051871, 0.7886751345948129}, {0.5, 0.5}},
    {1.6,
     4,
     {0.0694318442029737, 0.3300094782075719, 0.6699905217924281, 0.9305681557970263},
     {0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269}},
    {0.0,
     8,
     {0.0198550717512319, 0.1016667612931866, 0.2372337950418355, 0.4082826787521751, 0.5917173212478249,
      0.7627662049581645, 0.8983332387068134, 0.9801449282487681},
     {0.0506142681451881, 0.1111905172266872, 0.1568533229389437, 0.1813418916891810, 0.1813418916891810,
      0.1568533229389437, 0.1111905172266872, 0.0506142681451881}},
};

static const struct quadrature *choose_quadrature(const clt_rectangle *a, const clt_rectangle *b, clt_vector centre_a,
                                                  clt_vector centre_b) {
  double size = fmax(fmax(vec_length(a->u), vec_length(a->v)), fmax(vec_length(b->u), vec_length(b->v)));
  double distance = vec_length(vec_sub(centre_b, centre_a));
  int k = 0;
  while (distance < quadratures[k].farther_than * size) {
    k++;
  }
  return &quadratures[k];
}

double clt_formfactor_exchange(const clt_rectangle *a, const clt_rectangle *b, const clt_blockers *blockers) {
  clt_vector vertices[4];
  for (int k = 0; k < 4; k++) {
    vertices[k] = clt_rectangle_vertex(b, k);
  }
  clt_vector centre_a = vec_along(a->corner, 0.5, a->u, 0.5, a->v);
  clt_vector centre_b = vec_along(b->corner, 0.5, b->u, 0.5, b->v);
  const struct quadrature *rule = choose_quadrature(a, b, centre_a, centre_b);
  double sum = 0.0;
  for (int p = 0; p < rule->order; p++) {
    for (int q = 0; q < rule->order; q++) {
      clt_vector point = vec_along(a->corner, rule->at[p], a->u, rule->at[q], a->v);
      if (!clt_segment_blocked(blockers->rectangles, blockers->which, blockers->count, point, centre_b)) {
        sum += rule->weight[p] * rule->weight[q] * clt_formfactor_point(point, a->normal, vertices, b->normal);
      }
    }
  }
  return clt_rectangle_area(a) * sum;
}
