#include "sim/shapes.h"

#include <string.h>

/* The flat piece reflects where u x v points to, or on the other side where it faces in. */
static void add(clt_scene_description *description, clt_rectangle side, clt_facing facing, const double *albedo) {
  clt_rectangle *added = &description->surfaces[description->surface_count++];
  *added = side;
  if (facing == CLT_FACING_IN) {
    added->u = side.v;
    added->v = side.u;
  }
  memcpy(added->albedo, albedo, sizeof added->albedo);
  clt_rectangle_complete(added);
}

bool clt_shape_box(clt_scene_description *description, clt_vector corner, const clt_vector edges[3], clt_facing facing,
                   const double *albedo) {
  if (!clt_scene_reserve_surfaces(description, 6)) {
    return false;
  }
  bool right_handed = vec_dot(vec_cross(edges[0], edges[1]), edges[2]) > 0.0;
  for (int k = 0; k < 3; k++) {
    clt_vector across = edges[(k + 2) % 3];
    clt_vector a = edges[right_handed ? k : (k + 1) % 3], b = edges[right_handed ? (k + 1) % 3 : k];
    add(description, (clt_rectangle){.corner = vec_add(corner, across), .u = a, .v = b}, facing, albedo);
    add(description, (clt_rectangle){.corner = corner, .u = b, .v = a}, facing, albedo);
  }
  return true;
}

static clt_vector on_circle(const clt_cylinder *cylinder, double angle) {
  clt_vector sideways = vec_cross(vec_unit(cylinder->axis), cylinder->start);
  return vec_along(cylinder->centre, cos(angle), cylinder->start, sin(angle), sideways);
}

bool clt_shape_cylinder(clt_scene_description *description, const clt_cylinder *cylinder, clt_facing facing,
                        const double *albedo) {
  if (!clt_scene_reserve_surfaces(description, cylinder->pieces)) {
    return false;
  }
  for (int k = 0; k < cylinder->pieces; k++) {
    clt_vector from = on_circle(cylinder, cylinder->arc * k / cylinder->pieces);
    clt_vector to = on_circle(cylinder, cylinder->arc * (k + 1) / cylinder->pieces);
    add(description, (clt_rectangle){.corner = from, .u = vec_sub(to, from), .v = cylinder->axis}, facing, albedo);
  }
  return true;
}

/* Where the edges of a ring and a piece begin; edge 0 is at `from`. */
static clt_vector on_sphere(const clt_sphere *sphere, int ring, int piece) {
  clt_vector up = vec_unit(sphere->axis), ahead = vec_unit(sphere->start), sideways = vec_cross(up, ahead);
  double angle = sphere->from + (sphere->to - sphere->from) * ring / sphere->rings;
  double turn = sphere->arc * piece / sphere->pieces, across = sphere->radius * sin(angle);
  clt_vector ring_centre = vec_along(sphere->centre, sphere->radius * cos(angle), up, 0.0, up);
  return vec_along(ring_centre, across * cos(turn), ahead, across * sin(turn), sideways);
}

static bool ends_at_pole(const clt_sphere *sphere, int ring) {
  const double rounding = 1e-9;
  return (ring == 0 && sphere->from <= rounding) || (ring == sphere->rings && sphere->to >= M_PI - rounding);
}

static void add_triangle(clt_scene_description *description, const clt_vector corners[3], clt_facing facing,
                         const double *albedo) {
  clt_rectangle side = {.corner = corners[0],
                        .u = vec_sub(corners[1], corners[0]),
                        .v = vec_sub(corners[2], corners[0]),
                        .triangle = true};
  add(description, side, facing, albedo);
}

/* The facet between rings `ring` and ring + 1: a trapezium, cut along a diagonal. */
static void add_facet(clt_scene_description *description, const clt_sphere *sphere, int ring, int piece,
                      clt_facing facing, const double *albedo) {
  clt_vector low = on_sphere(sphere, ring + 1, piece), low_next = on_sphere(sphere, ring + 1, piece + 1);
  clt_vector high = on_sphere(sphere, ring, piece), high_next = on_sphere(sphere, ring, piece + 1);
  if (!ends_at_pole(sphere, ring + 1)) {
    add_triangle(description, (clt_vector[]){low, low_next, high}, facing, albedo);
  }
  if (!ends_at_pole(sphere, ring)) {
    add_triangle(description, (clt_vector[]){high_next, high, low_next}, facing, albedo);
  }
}

bool clt_shape_sphere(clt_scene_description *description, const clt_sphere *sphere, clt_facing facing,
                      const double *albedo) {
  int poles = ends_at_pole(sphere, 0) + ends_at_pole(sphere, sphere->rings);
  if (!clt_scene_reserve_surfaces(description, (2 * sphere->rings - poles) * sphere->pieces)) {
    return false;
  }
  for (int ring = 0; ring < sphere->rings; ring++) {
    for (int piece = 0; piece < sphere->pieces; piece++) {
      add_facet(description, sphere, ring, piece, facing, albedo);
    }
  }
  return true;
}
