#include <string.h>

#include "sim/scene_file.h"

typedef struct material {
  const char *name;
  double albedo[CLT_SIM_CHANNELS_MAX];
} material;

static const material *find_material(const material *materials, int count, const char *name) {
  for (int k = 0; k < count; k++) {
    if (materials[k].name != NULL && strcmp(materials[k].name, name) == 0) {
      return &materials[k];
    }
  }
  return NULL;
}

static int read_materials(clt_section root, int channels, material *materials) {
  int count = clt_section_count(root, "materials");
  if (count > CLT_SURFACES_MAX) {
    clt_section_fail(root, "materials", "has %d materials; legal is at most %d", count, CLT_SURFACES_MAX);
    return 0;
  }
  for (int k = 0; k < count; k++) {
    clt_section item = clt_section_item(root, "materials", k);
    materials[k].name = clt_read_text(item, "name", NULL, 64);
    if (materials[k].name == NULL) {
      clt_section_fail(item, NULL, "a material needs name = \"...\"");
    } else if (find_material(materials, k, materials[k].name) != NULL) {
      clt_section_fail(item, "name", "\"%s\" is given to two materials", materials[k].name);
    }
    clt_scene_read_channels(item, "albedo", channels, 0.5, 0.0, 1.0, materials[k].albedo);
    for (int c = 0; c < channels; c++) {
      if (materials[k].albedo[c] >= 1.0) {
        clt_section_fail(item, "albedo", "is %g; legal is 0 to below 1", materials[k].albedo[c]);
      }
    }
  }
  return count;
}

static void read_surface(clt_section item, const material *materials, int count, clt_rectangle *surface) {
  static const char *const vectors[] = {"corner", "u", "v"};
  for (int k = 0; k < 3; k++) {
    if (!clt_section_has(item, vectors[k])) {
      clt_section_fail(item, NULL, "a surface needs %s = [x, y, z]", vectors[k]);
    }
  }
  surface->corner = clt_scene_read_vector(item, "corner", (clt_vector){0.0, 0.0, 0.0});
  surface->u = clt_scene_read_vector(item, "u", (clt_vector){1.0, 0.0, 0.0});
  surface->v = clt_scene_read_vector(item, "v", (clt_vector){0.0, 1.0, 0.0});
  if (!clt_rectangle_complete(surface)) {
    clt_section_fail(item, "u", "u and v must be longer than 1e-6 and perpendicular, so that they span a rectangle");
  }
  const char *name = clt_read_text(item, "material", "", 64);
  const material *found = find_material(materials, count, name);
  if (found == NULL) {
    clt_section_fail(item, "material", "\"%s\" is not among the materials; give one of their names", name);
    return;
  }
  memcpy(surface->albedo, found->albedo, sizeof surface->albedo);
}

void clt_scene_read_surfaces(clt_section root, clt_scene_description *description) {
  material materials[CLT_SURFACES_MAX];
  int known = read_materials(root, description->channels, materials);
  int count = clt_section_count(root, "surfaces");
  if (count < 1 || count > CLT_SURFACES_MAX) {
    clt_section_fail(root, "surfaces", "has %d surfaces; legal is 1 to %d", count, CLT_SURFACES_MAX);
    return;
  }
  for (int k = 0; k < count; k++) {
    read_surface(clt_section_item(root, "surfaces", k), materials, known, &description->surfaces[k]);
  }
  description->surface_count = count;
}

void clt_scene_check_lit(clt_section root, const clt_scene_description *description) {
  bool backs = false;
  for (int cell = 0; cell < description->width * description->height; cell++) {
    for (int ray = 0; ray < description->rays * description->rays; ray++) {
      double solid_angle;
      clt_vector direction = clt_scene_ray(description, cell, ray, &solid_angle);
      clt_hit hit = clt_first_hit(description->surfaces, description->surface_count,
                                  description->projector.pinhole.position, direction, -1);
      if (hit.surface >= 0 && hit.front) {
        return;
      }
      backs = backs || hit.surface >= 0;
    }
  }
  clt_section_fail(root, "projector",
                   backs ? "lights only backs of surfaces; they reflect on the side of u x v: swap their u and v"
                         : "its light meets no surface; check position, target and tangent");
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
