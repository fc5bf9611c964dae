#include <string.h>

#include "base/file.h"
#include "sim/cells.h"
#include "sim/mesh_file.h"
#include "sim/scene_file.h"
#include "sim/shapes.h"
#include "sim/visibility.h"

/* Entries of the lists of a scene file. */
enum { ENTRIES_MAX = 64, PIECES_MAX = 360 };

/* A point or direction that must be given. */
static clt_vector read_needed(clt_section item, const char *what, const char *key, clt_vector fallback) {
  if (!clt_section_has(item, key)) {
    clt_section_fail(item, NULL, "a %s needs %s = [x, y, z]", what, key);
  }
  return clt_scene_read_vector(item, key, fallback);
}

static clt_facing read_facing(clt_section item) {
  static const char *const names[] = {"out", "in", NULL};
  return (clt_facing)clt_read_choice(item, "facing", CLT_FACING_OUT, names);
}

static bool perpendicular(clt_vector a, clt_vector b) {
  return fabs(vec_dot(a, b)) <= 1e-6 * vec_length(a) * vec_length(b);
}

static bool too_short(clt_vector a) {
  return !(vec_length(a) > 1e-6);
}

/* The readers of the types of surfaces return whether there was room for them. */

static bool read_rectangle(clt_section item, const double *albedo, clt_scene_description *description) {
  clt_rectangle surface = {.corner = read_needed(item, "surface", "corner", (clt_vector){0.0, 0.0, 0.0}),
                           .u = read_needed(item, "surface", "u", (clt_vector){1.0, 0.0, 0.0}),
                           .v = read_needed(item, "surface", "v", (clt_vector){0.0, 1.0, 0.0})};
  if (!clt_rectangle_complete(&surface)) {
    clt_section_fail(item, "u", "u and v must be longer than 1e-6 and perpendicular, so that they span a rectangle");
  }
  memcpy(surface.albedo, albedo, sizeof surface.albedo);
  if (!clt_scene_reserve_surfaces(description, 1)) {
    return false;
  }
  description->surfaces[description->surface_count++] = surface;
  return true;
}

static bool read_box(clt_section item, const double *albedo, clt_scene_description *description) {
  clt_vector corner = read_needed(item, "box", "corner", (clt_vector){0.0, 0.0, 0.0});
  clt_vector edges[3] = {read_needed(item, "box", "u", (clt_vector){1.0, 0.0, 0.0}),
                         read_needed(item, "box", "v", (clt_vector){0.0, 1.0, 0.0}),
                         read_needed(item, "box", "w", (clt_vector){0.0, 0.0, 1.0})};
  for (int k = 0; k < 3; k++) {
    if (too_short(edges[k]) || !perpendicular(edges[k], edges[(k + 1) % 3])) {
      clt_section_fail(item, "u", "u, v and w must be longer than 1e-6 and perpendicular, so that they span a box");
    }
  }
  return clt_shape_box(description, corner, edges, read_facing(item), albedo);
}

static bool read_cylinder(clt_section item, const double *albedo, clt_scene_description *description) {
  clt_cylinder cylinder = {.centre = read_needed(item, "cylinder", "centre", (clt_vector){0.0, 0.0, 0.0}),
                           .axis = read_needed(item, "cylinder", "axis", (clt_vector){0.0, 0.0, 1.0}),
                           .start = read_needed(item, "cylinder", "start", (clt_vector){1.0, 0.0, 0.0})};
  double degrees = clt_read_number(item, "arc", 360.0, 1.0, 360.0);
  int fewest = degrees > 180.0 ? 3 : 1;
  cylinder.arc = degrees * M_PI / 180.0;
  cylinder.pieces = clt_read_integer(item, "pieces", (int)fmax(fewest, degrees / 15.0), fewest, PIECES_MAX);
  if (too_short(cylinder.axis) || too_short(cylinder.start) || !perpendicular(cylinder.axis, cylinder.start)) {
    clt_section_fail(item, "axis", "axis and start must be longer than 1e-6 and perpendicular to each other");
  } else if (2.0 * vec_length(cylinder.start) * sin(cylinder.arc / (2 * cylinder.pieces)) <= 1e-6) {
    clt_section_fail(item, "start", "makes pieces less than 1e-6 wide; make start longer or take fewer pieces");
  }
  return clt_shape_cylinder(description, &cylinder, read_facing(item), albedo);
}

static bool all_have_area(const clt_scene_description *description, int first) {
  for (int k = first; k < description->surface_count; k++) {
    clt_rectangle surface = description->surfaces[k];
    if (!clt_rectangle_complete(&surface)) {
      return false;
    }
  }
  return true;
}

/* Facets are as wide as 15 degrees where the file does not say otherwise. */
static void read_sphere_angles(clt_section item, clt_sphere *sphere) {
  double from = clt_read_number(item, "from", 0.0, 0.0, 180.0), to = clt_read_number(item, "to", 180.0, 0.0, 180.0);
  double arc = clt_read_number(item, "arc", 360.0, 1.0, 360.0);
  int fewest_rings = from <= 0.0 && to >= 180.0 ? 2 : 1, fewest_pieces = arc > 180.0 ? 3 : 1;
  if (!(to - from >= 1.0)) {
    clt_section_fail(item, "to", "is %g; it must be at least 1 degree above from, which is %g", to, from);
  }
  sphere->from = from * M_PI / 180.0;
  sphere->to = to * M_PI / 180.0;
  sphere->arc = arc * M_PI / 180.0;
  sphere->rings =
      clt_read_integer(item, "rings", (int)fmax(fewest_rings, (to - from) / 15.0), fewest_rings, PIECES_MAX);
  sphere->pieces = clt_read_integer(item, "pieces", (int)fmax(fewest_pieces, arc / 15.0), fewest_pieces, PIECES_MAX);
}

static bool read_sphere(clt_section item, const double *albedo, clt_scene_description *description) {
  clt_sphere sphere = {.centre = read_needed(item, "sphere", "centre", (clt_vector){0.0, 0.0, 0.0}),
                       .axis = clt_scene_read_vector(item, "axis", (clt_vector){0.0, 0.0, 1.0}),
                       .start = clt_scene_read_vector(item, "start", (clt_vector){1.0, 0.0, 0.0}),
                       .radius = clt_read_number(item, "radius", 1.0, 1e-3, 1e3)};
  int first = description->surface_count;
  read_sphere_angles(item, &sphere);
  if (!clt_section_has(item, "radius")) {
    clt_section_fail(item, NULL, "a sphere needs radius = ...");
  }
  if (too_short(sphere.axis) || too_short(sphere.start) || !perpendicular(sphere.axis, sphere.start)) {
    clt_section_fail(item, "axis", "axis and start must be longer than 1e-6 and perpendicular to each other");
    return true;
  }
  bool fitted = clt_shape_sphere(description, &sphere, read_facing(item), albedo);
  if (!all_have_area(description, first)) {
    clt_section_fail(item, "pieces", "makes facets without area; take fewer pieces or rings");
  }
  return fitted;
}

/* What is wrong with the file is kept here. */
static bool read_mesh(clt_section item, const double *albedo, clt_scene_description *description) {
  char folder[CLT_PATH_MAX], path[CLT_PATH_MAX];
  clt_mesh_place place = {.at = clt_scene_read_vector(item, "at", (clt_vector){0.0, 0.0, 0.0}),
                          .scale = clt_read_number(item, "scale", 1.0, 1e-6, 1e6)};
  clt_facing facing = read_facing(item);
  const char *name = clt_read_text(item, "file", NULL, CLT_PATH_MAX - 1);
  if (name == NULL) {
    clt_section_fail(item, NULL, "a mesh needs file = \"...\"");
    return true;
  }
  static const char *const ups[] = {"z", "y", NULL};
  place.y_up = clt_read_choice(item, "up", clt_mesh_file_is_y_up(name), ups) == 1;
  clt_error wrong = {.status = CLT_OK};
  clt_file_folder(description->path, folder);
  if (clt_file_join(folder, name, path, &wrong) != CLT_OK ||
      clt_mesh_file_add(description, path, &place, facing, albedo, &wrong) != CLT_OK) {
    clt_section_fail(item, "file", "%s", wrong.message);
  }
  return true;
}

static const struct type {
  const char *name;
  bool (*read)(clt_section item, const double *albedo, clt_scene_description *description);
} types[] = {{"rectangle", read_rectangle},
             {"box", read_box},
             {"cylinder", read_cylinder},
             {"sphere", read_sphere},
             {"mesh", read_mesh}};
enum { TYPES = sizeof types / sizeof types[0] };

static void read_surface(clt_section item, const clt_material *materials, int count,
                         clt_scene_description *description) {
  const char *names[TYPES + 1] = {NULL};
  for (int k = 0; k < TYPES; k++) {
    names[k] = types[k].name;
  }
  const struct type *type = &types[clt_read_choice(item, "type", 0, names)];
  const char *name = clt_read_text(item, "material", "", 64);
  const clt_material *found = clt_scene_find_material(materials, count, name);
  const double black[CLT_SIM_CHANNELS_MAX] = {0.0};
  int first = description->surface_count;
  if (!type->read(item, found != NULL ? found->albedo : black, description)) {
    clt_section_fail(item, NULL, "does not fit: a scene has at most %d flat surfaces; take fewer pieces",
                     CLT_SURFACES_MAX);
  }
  if (found == NULL) {
    clt_section_fail(item, "material", "\"%s\" is not among the materials; give one of their names", name);
  }
  for (int k = first; k < description->surface_count && found != NULL; k++) {
    description->surfaces[k].material = (int)(found - materials);
  }
}

/* Whether anything is before a surface's front: another surface that faces it, or the projector. */
static bool has_view(const clt_scene_description *description, int surface) {
  const clt_rectangle *of = &description->surfaces[surface];
  bool found = vec_dot(of->normal, vec_sub(description->projector.pinhole.position, of->corner)) > 0.0;
  for (int k = 0; k < description->surface_count && !found; k++) {
    found = clt_rectangles_face(of, &description->surfaces[k]);
  }
  return found;
}

/* Light of surfaces that lie on each other would count twice: the front of neither hides the other's. */
static void refuse_coinciding(clt_section item, const clt_scene_description *description, int first, int end) {
  for (int k = first; k < end; k++) {
    for (int other = 0; other < k; other++) {
      if (clt_rectangles_coincide(&description->surfaces[k], &description->surfaces[other]) &&
          has_view(description, k)) {
        clt_section_fail(item, NULL,
                         "lies flush on %s, facing the same way; move it off by a millimetre, or cut out what it "
                         "covers",
                         other < first ? "a surface before it" : "another face of its own");
        return;
      }
    }
  }
}

void clt_scene_read_surfaces(clt_section root, clt_scene_description *description) {
  clt_material materials[CLT_MATERIALS_MAX];
  int known = clt_scene_read_materials(root, description, materials);
  int count = clt_section_count(root, "surfaces");
  if (count < 1 || count > ENTRIES_MAX) {
    clt_section_fail(root, "surfaces", "has %d surfaces; legal is 1 to %d", count, ENTRIES_MAX);
    return;
  }
  int end[ENTRIES_MAX];
  for (int k = 0; k < count; k++) {
    read_surface(clt_section_item(root, "surfaces", k), materials, known, description);
    end[k] = description->surface_count;
  }
  for (int k = 0; k < count; k++) {
    refuse_coinciding(clt_section_item(root, "surfaces", k), description, k > 0 ? end[k - 1] : 0, end[k]);
  }
}

/* True where every way out of a place leads to the back of a surface first: inside a solid. */
static bool inside_solid(const clt_scene_description *description, clt_vector place) {
  for (int k = 0; k < 27; k++) {
    clt_vector way = {k % 3 - 1.003, k / 3 % 3 - 1.001, k / 9 - 1.002}; /* turned a little off the usual edges */
    clt_hit hit = clt_first_hit(description->surfaces, description->surface_count, place, way, -1);
    if (k != 13 && (hit.surface < 0 || hit.front)) {
      return false;
    }
  }
  return true;
}

/* backs: whether it meets a back before that. */
static bool lights_a_front(const clt_scene_description *description, const clt_visibility *visibility, bool *backs) {
  for (int cell = 0; cell < description->width * description->height; cell++) {
    for (int ray = 0; ray < description->rays * description->rays; ray++) {
      double solid_angle;
      clt_vector direction = clt_scene_ray(description, cell, ray, &solid_angle);
      clt_hit hit = clt_visibility_first_hit(visibility, description->projector.pinhole.position, direction, -1);
      if (hit.surface >= 0 && hit.front) {
        return true;
      }
      *backs = *backs || hit.surface >= 0;
    }
  }
  return false;
}

void clt_scene_check_lit(clt_section root, const clt_scene_description *description) {
  if (inside_solid(description, description->projector.pinhole.position)) {
    clt_section_fail(root, "projector",
                     "its position lies inside an object, with only backs of surfaces around; move it out, or give the "
                     "object facing = \"in\"");
    return;
  }
  clt_visibility *visibility = NULL;
  clt_error error = {.status = CLT_OK};
  if (clt_visibility_create(description->surfaces, description->surface_count, &visibility, &error) != CLT_OK) {
    clt_section_fail(root, "surfaces", "%s", error.message);
    return;
  }
  bool backs = false;
  if (!lights_a_front(description, visibility, &backs)) {
    clt_section_fail(root, "projector",
                     backs ? "lights only backs of surfaces; they reflect on the side of u x v: swap their u and v, or "
                             "give an object the other facing"
                           : "its light meets no surface; check position, target and tangent");
  }
  clt_visibility_destroy(visibility);
}

void clt_scene_check_seen(clt_section root, const clt_scene_description *description) {
  clt_visibility *visibility = NULL;
  clt_error error = {.status = CLT_OK};
  if (!description->camera.placed) {
    return;
  }
  if (clt_visibility_create(description->surfaces, description->surface_count, &visibility, &error) != CLT_OK) {
    clt_section_fail(root, "surfaces", "%s", error.message);
    return;
  }
  bool seen = false;
  for (int cell = 0; cell < description->width * description->height && !seen; cell++) {
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    clt_cell_trace(description, visibility, cell, ends);
    for (int ray = 0; ray < description->rays * description->rays; ray++) {
      seen = seen || ends[ray].view > 0.0;
    }
  }
  clt_visibility_destroy(visibility);
  if (!seen) {
    clt_section_fail(root, "camera", "sees nothing that the projector lights; check position, target and tangent");
  }
}

clt_vector clt_scene_ray(const clt_scene_description *description, int cell, int ray, double *solid_angle) {
  const clt_pinhole *pinhole = &description->projector.pinhole;
  int rays = description->rays, across = description->width * rays, down = description->height * rays;
  int column = cell % description->width * rays + ray % rays, row = cell / description->width * rays + ray / rays;
  double x = 2.0 * (column + 0.5) / across - 1.0, y = 1.0 - 2.0 * (row + 0.5) / down;
  clt_vector direction = clt_pinhole_direction(pinhole, x, y);
  double length = vec_length(direction);
  /* d omega = dA cos / r^2 on the image plane at distance 1, cos = 1 / r */
  double area = 4.0 * pinhole->tangent[0] * pinhole->tangent[1] / ((double)across * down);
  *solid_angle = area / (length * length * length);
  return direction;
}
