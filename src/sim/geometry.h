/* Vectors, one-sided rectangles, and what a ray meets first. Lengths in metres; right-handed axes. */
#ifndef CLT_SIM_GEOMETRY_H
#define CLT_SIM_GEOMETRY_H

#include <math.h>
#include <stdbool.h>

typedef struct clt_vector {
  double x, y, z;
} clt_vector;

static inline clt_vector vec_add(clt_vector a, clt_vector b) {
  return (clt_vector){a.x + b.x, a.y + b.y, a.z + b.z};
}
static inline clt_vector vec_sub(clt_vector a, clt_vector b) {
  return (clt_vector){a.x - b.x, a.y - b.y, a.z - b.z};
}
static inline clt_vector vec_scale(double s, clt_vector a) {
  return (clt_vector){s * a.x, s * a.y, s * a.z};
}
/* a + s u + t v */
static inline clt_vector vec_along(clt_vector a, double s, clt_vector u, double t, clt_vector v) {
  return (clt_vector){a.x + s * u.x + t * v.x, a.y + s * u.y + t * v.y, a.z + s * u.z + t * v.z};
}
static inline double vec_dot(clt_vector a, clt_vector b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline clt_vector vec_cross(clt_vector a, clt_vector b) {
  return (clt_vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline double vec_length(clt_vector a) {
  return sqrt(vec_dot(a, a));
}
static inline clt_vector vec_unit(clt_vector a) {
  return vec_scale(1.0 / vec_length(a), a);
}

/* A flat piece of surface: the points corner + s u + t v, 0 <= s, t <= 1, with u perpendicular to v; or the triangle of
 * those with s + t <= 1, whose u and v may stand at any angle. The side that u x v points to reflects diffusely; the
 * back is black, but blocks light. */
typedef struct clt_rectangle {
  clt_vector corner, u, v;
  bool triangle;
  int material;      /* of the scene */
  clt_vector normal; /* unit, along u x v */
  double albedo[3];  /* per channel, 0 <= albedo < 1 */
} clt_rectangle;

/* Fills normal from u and v; false where they span no area, or no rectangle (to 1e-6) and it is not a triangle. */
bool clt_rectangle_complete(clt_rectangle *rectangle);
/* 4, or 3 of a triangle. */
int clt_rectangle_vertices(const clt_rectangle *rectangle);
/* Corner number 0..3 in the order corner, +u, +u+v, +v: counter-clockwise seen from the front. A triangle has no +u+v,
 * and its last corner also as number 3. */
clt_vector clt_rectangle_vertex(const clt_rectangle *rectangle, int number);
double clt_rectangle_area(const clt_rectangle *rectangle);
clt_vector clt_rectangle_centre(const clt_rectangle *rectangle);
/* Covers it evenly as s and t go evenly over 0..1. */
clt_vector clt_rectangle_point(const clt_rectangle *rectangle, double s, double t);

typedef struct clt_hit {
  int surface;     /* index into the rectangles; -1: nothing was met */
  bool front;      /* the side that reflects */
  double distance; /* in units of the ray's direction */
  double s, t;     /* where on the rectangle */
} clt_hit;

/* Where the ray meets the rectangle's plane, also outside of the rectangle or behind the origin. */
clt_hit clt_hit_on_plane(const clt_rectangle *rectangle, clt_vector origin, clt_vector direction);

/* The first rectangle but number `leaving` that origin + distance * direction meets at distance > 0. */
clt_hit clt_first_hit(const clt_rectangle *rectangles, int count, clt_vector origin, clt_vector direction, int leaving);

/* True where one of the rectangles but those numbered a and b cuts the open segment between two points. */
bool clt_segment_blocked(const clt_rectangle *rectangles, int count, clt_vector from, clt_vector to, int a, int b);

/* Bit 0: a corner of `of` lies well in front of the plane of `plane`; bit 1: one lies well behind it. */
int clt_rectangle_sides(const clt_rectangle *plane, const clt_rectangle *of);

/* True where some rectangle could stand between points of rectangles a and b: one whose plane has corners of a or b
 * well on both sides. For many pairs sim/sides.h tells the same sooner. */
bool clt_rectangles_may_be_parted(const clt_rectangle *rectangles, int count, int a, int b);

/* True where some point in front of a sees some point in front of b. */
bool clt_rectangles_face(const clt_rectangle *a, const clt_rectangle *b);

/* True where the fronts of both lie on each other: on one plane, with an area in common. */
bool clt_rectangles_coincide(const clt_rectangle *a, const clt_rectangle *b);

/* A pinhole projector or camera: image coordinates x to the right and y up, each from -1 to 1 across the image. */
typedef struct clt_pinhole {
  clt_vector position, right, up, forward; /* orthonormal axes: right = forward x up' for the scene's up' */
  double tangent[2];                       /* half-width and half-height of the image at distance 1 */
} clt_pinhole;

/* Points the axes from position to target; false where target = position or up is parallel to the view. */
bool clt_pinhole_aim(clt_pinhole *pinhole, clt_vector target, clt_vector up);
/* Direction (not unit: its forward part is 1) through image coordinates x, y. */
clt_vector clt_pinhole_direction(const clt_pinhole *pinhole, double x, double y);
/* Whether a place lies in its image. */
bool clt_pinhole_covers(const clt_pinhole *pinhole, clt_vector at);

#endif
