#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/settings.h"
#include "sim/description.h"

static const double FAR_AWAY = 1000.0; /* m, the largest legal coordinate */

/* The keys that describe geometry and so mean nothing beside a transport_file. */
static const char *const geometry_keys[] = {"position", "target", "up", "tangent", "intensity"};

static clt_vector read_vector(clt_section section, const char *key, clt_vector fallback) {
  double v[3];
  return clt_read_numbers(section, key, v, 3, 3, -FAR_AWAY, FAR_AWAY) == 3 ? (clt_vector){v[0], v[1], v[2]} : fallback;
}

/* One number for every channel, or one per channel. */
static void read_channels(clt_section section, const char *key, int channels, double fallback, double low, double high,
                          double *values) {
  int count = clt_read_numbers(section, key, values, 1, CLT_SIM_CHANNELS_MAX, low, high);
  if (count == 0) {
    values[0] = fallback;
  }
  if (count > 1 && count != channels) {
    clt_section_fail(section, key, "has %d values; legal is one, or one for each of the %d channels", count, channels);
  }
  for (int c = 1; c < CLT_SIM_CHANNELS_MAX && count <= 1; c++) {
    values[c] = values[0];
  }
}

static clt_curve read_curve(clt_section section, const char *fallback) {
  clt_curve curve = {.kind = CLT_CURVE_LINEAR};
  clt_error wrong = {.status = CLT_OK};
  if (clt_curve_parse(clt_read_text(section, "response", fallback, 32), &curve, &wrong) != CLT_OK) {
    clt_section_fail(section, "response", "%s", wrong.message);
  }
  return curve;
}

static void read_transport(clt_section root, const char *path, clt_scene_description *description) {
  char folder[CLT_PATH_MAX], file[CLT_PATH_MAX];
  const char *name = clt_read_text(root, "transport_file", "", CLT_PATH_MAX - 1);
  clt_error wrong = {.status = CLT_OK};
  clt_file_folder(path, folder);
  if (clt_file_join(folder, name, file, &wrong) != CLT_OK ||
      clt_transport_load(file, &description->transport, &wrong) != CLT_OK) {
    clt_section_fail(root, "transport_file", "%s", wrong.message);
    return;
  }
  clt_transport_info info = clt_transport_describe(description->transport);
  if (info.rows != info.cols || (info.channels != 1 && info.channels != 3)) {
    clt_section_fail(root, "transport_file",
                     "%s has %zu rows, %zu columns and %d channels; legal is as many rows as columns, 1 or 3 channels",
                     name, info.rows, info.cols, info.channels);
  }
  clt_section grid = clt_section_group(root, "grid");
  int width = clt_read_integer(grid, "width", info.width, 1, CLT_GRID_SIDE_MAX);
  int height = clt_read_integer(grid, "height", info.height, 1, CLT_GRID_SIDE_MAX);
  int channels = clt_read_integer(grid, "channels", info.channels, 1, 3);
  if (width != info.width || height != info.height || channels != info.channels) {
    clt_section_fail(root, "grid", "is %d x %d with %d channels, but %s has %d x %d with %d; leave it out", width,
                     height, channels, name, info.width, info.height, info.channels);
  }
  description->width = info.width;
  description->height = info.height;
  description->channels = info.channels;
}

static void read_grid(clt_section root, clt_scene_description *description) {
  clt_section grid = clt_section_group(root, "grid");
  description->width = clt_read_integer(grid, "width", 64, 1, 1024);
  description->height = clt_read_integer(grid, "height", 48, 1, 1024);
  description->channels = clt_read_integer(grid, "channels", 3, 1, 3);
  description->rays = clt_read_integer(grid, "rays", 8, 1, 16);
  if (description->channels == 2) {
    clt_section_fail(grid, "channels", "is 2; legal is 1 or 3");
  }
  if (description->width * description->height > CLT_RECTANGLE_CELLS_MAX) {
    clt_section_fail(root, "grid", "%d x %d is %d cells; surfaces are simulated with at most %d", description->width,
                     description->height, description->width * description->height, CLT_RECTANGLE_CELLS_MAX);
  }
}

static void read_pose(clt_section section, clt_scene_description *description) {
  clt_projector_description *projector = &description->projector;
  projector->pinhole.position = read_vector(section, "position", (clt_vector){0.0, -3.0, 0.0});
  clt_vector target = read_vector(section, "target", (clt_vector){0.0, 0.0, 0.0});
  clt_vector up = read_vector(section, "up", (clt_vector){0.0, 0.0, 1.0});
  projector->pinhole.tangent[0] = 0.44;
  projector->pinhole.tangent[1] = 0.33;
  clt_read_numbers(section, "tangent", projector->pinhole.tangent, 2, 2, 1e-3, 10.0);
  read_channels(section, "intensity", description->channels, 30.0, 1e-6, 1e9, projector->intensity);
  if (vec_length(vec_sub(target, projector->pinhole.position)) < 1e-6) {
    clt_section_fail(section, "target", "is the projector's position; it must lie somewhere else");
  } else if (!clt_pinhole_aim(&projector->pinhole, target, up)) {
    clt_section_fail(section, "up", "is zero or parallel to the view; it must point across it");
  }
}

static void read_projector(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(root, "projector");
  clt_projector_description *projector = &description->projector;
  if (description->transport == NULL) {
    read_pose(section, description);
  } else {
    for (size_t k = 0; k < sizeof geometry_keys / sizeof geometry_keys[0]; k++) {
      if (clt_section_has(section, geometry_keys[k])) {
        clt_section_fail(section, geometry_keys[k], "means nothing beside transport_file; leave it out");
      }
    }
  }
  projector->response = read_curve(section, "srgb");
  projector->bits = clt_read_integer(section, "bits", 8, 1, 16);
  projector->black = clt_read_number(section, "black", 0.001, 0.0, 0.5);
  projector->refresh_s = 1.0 / clt_read_number(section, "refresh_hz", 60.0, 1.0, 1000.0);
  projector->latency_s = 1e-3 * clt_read_number(section, "latency_ms", 30.0, 0.0, 10000.0);
}

static void read_camera(clt_section root, clt_camera_description *camera) {
  clt_section section = clt_section_group(root, "camera");
  camera->cell_pixels = clt_read_integer(section, "cell_pixels", 2, 1, 16);
  camera->bits = clt_read_integer(section, "bits", 12, 8, 16);
  camera->response = read_curve(section, "linear");
  camera->responsivity =
      clt_section_has(section, "responsivity") ? clt_read_number(section, "responsivity", 1.0, 1e-9, 1e9) : 0.0;
  camera->full_well = clt_read_number(section, "full_well", 15000.0, 10.0, 1e7);
  camera->read_noise = clt_read_number(section, "read_noise", 4.0, 0.0, 1000.0);
  camera->black_level = clt_read_integer(section, "black_level", 1 << (camera->bits - 6), 0, 1 << (camera->bits - 1));
  camera->frame_s = 1.0 / clt_read_number(section, "fps", 60.0, 0.1, 1000.0);
  camera->exposure_delay = clt_read_integer(section, "exposure_delay_frames", 1, 0, CLT_EXPOSURE_DELAY_MAX);
}

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
    read_channels(item, "albedo", channels, 0.5, 0.0, 1.0, materials[k].albedo);
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
  surface->corner = read_vector(item, "corner", (clt_vector){0.0, 0.0, 0.0});
  surface->u = read_vector(item, "u", (clt_vector){1.0, 0.0, 0.0});
  surface->v = read_vector(item, "v", (clt_vector){0.0, 1.0, 0.0});
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

static void read_surfaces(clt_section root, clt_scene_description *description) {
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

/* Refuses a projector whose light meets no front of a surface. */
static void check_lit(clt_section root, const clt_scene_description *description) {
  bool backs = false;
  for (int cell = 0; cell < description->width * description->height; cell++) {
    for (int ray = 0; ray < description->rays * description->rays; ray++) {
      double solid_angle;
      clt_vector direction = clt_scene_ray(description, cell, ray, &solid_angle);
      clt_hit hit = clt_first_hit(description->surfaces, description->surface_count,
                                  description->projector.pinhole.position, direction);
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

static void read_scene(clt_section root, const char *path, clt_scene_description *description) {
  bool file = clt_section_has(root, "transport_file");
  if (file == clt_section_has(root, "surfaces")) {
    clt_section_fail(root, file ? "transport_file" : NULL,
                     file ? "is given beside surfaces; a scene has one or the other"
                          : "neither surfaces nor transport_file is given; a scene needs one of them");
    return;
  }
  if (file) {
    read_transport(root, path, description);
  } else {
    read_grid(root, description);
  }
  read_projector(root, description);
  read_camera(root, &description->camera);
  read_channels(root, "ambient", description->channels, 0.002, 0.0, 1e6, description->ambient);
  description->seed = (uint64_t)clt_read_integer(root, "seed", 1, 0, 2147483647);
  if (!file) {
    read_surfaces(root, description);
  }
}

clt_status clt_scene_read(const char *path, clt_scene_description *description, clt_error *error) {
  clt_settings *settings = NULL;
  clt_status status = clt_settings_open(path, &settings, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t length = strlen(path);
  if (length >= sizeof description->path) {
    clt_settings_close(settings);
    return clt_fail(error, CLT_BAD_INPUT, "%.60s...: the path is longer than %d characters", path, CLT_PATH_MAX - 1);
  }
  memcpy(description->path, path, length + 1);
  clt_section root = clt_settings_root(settings);
  read_scene(root, path, description);
  status = clt_settings_finish(settings, error);
  if (status == CLT_OK && description->surface_count > 0) {
    check_lit(root, description);
    status = clt_settings_finish(settings, error);
  }
  clt_settings_close(settings);
  return status;
}

void clt_scene_description_finish(clt_scene_description *description) {
  clt_transport_destroy(description->transport);
  description->transport = NULL;
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
