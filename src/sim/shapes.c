#include "sim/shapes.h"

#include <string.h>

/* The rectangle reflects where u x v points to, or on the other side where it faces in. */
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
