#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/settings.h"
#include "sim/effects/plan.h"
#include "sim/scene_file.h"

/* The keys that describe geometry and so mean nothing beside a transport_file. */
static const char *const geometry_keys[] = {"position", "target", "up", "tangent", "intensity"};

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
  bool fine = description->width * description->height > CLT_FINE_GRID;
  description->rays = clt_read_integer(grid, "rays", fine ? 2 : 8, 1, 16);
  if (description->channels == 2) {
    clt_section_fail(grid, "channels", "is 2; legal is 1 or 3");
  }
  if (description->width * description->height > CLT_RECTANGLE_CELLS_MAX) {
    clt_section_fail(root, "grid", "%d x %d is %d cells; surfaces are simulated with at most %d", description->width,
                     description->height, description->width * description->height, CLT_RECTANGLE_CELLS_MAX);
  }
}

/* What a pinhole's keys say; who: "projector" or "camera". */
static void read_pose(clt_section section, const char *who, const clt_pinhole *fallback, clt_pinhole *pinhole) {
  *pinhole = *fallback;
  pinhole->position = clt_scene_read_vector(section, "position", fallback->position);
  clt_vector target = clt_scene_read_vector(section, "target", (clt_vector){0.0, 0.0, 0.0});
  clt_vector up = clt_scene_read_vector(section, "up", (clt_vector){0.0, 0.0, 1.0});
  clt_read_numbers(section, "tangent", pinhole->tangent, 2, 2, 1e-3, 10.0);
  if (vec_length(vec_sub(target, pinhole->position)) < 1e-6) {
    clt_section_fail(section, "target", "is the %s's position; it must lie somewhere else", who);
  } else if (!clt_pinhole_aim(pinhole, target, up)) {
    clt_section_fail(section, "up", "is zero or parallel to the view; it must point across it");
  }
}

static void refuse_geometry(clt_section section) {
  for (size_t k = 0; k < sizeof geometry_keys / sizeof geometry_keys[0]; k++) {
    if (clt_section_has(section, geometry_keys[k])) {
      clt_section_fail(section, geometry_keys[k], "means nothing beside transport_file; leave it out");
    }
  }
}

static void read_projector(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(root, "projector");
  clt_projector_description *projector = &description->projector;
  if (description->transport == NULL) {
    const clt_pinhole usual = {.position = {0.0, -3.0, 0.0}, .tangent = {0.44, 0.33}};
    read_pose(section, "projector", &usual, &projector->pinhole);
    clt_scene_read_channels(section, "intensity", description->channels, 30.0, 1e-6, 1e9, projector->intensity);
  } else {
    refuse_geometry(section);
  }
  projector->response = read_curve(section, "srgb");
  projector->bits = clt_read_integer(section, "bits", 8, 1, 16);
  projector->black = clt_read_number(section, "black", 0.001, 0.0, 0.5);
  projector->refresh_s = 1.0 / clt_read_number(section, "refresh_hz", 60.0, 1.0, 1000.0);
  projector->latency_s = 1e-3 * clt_read_number(section, "latency_ms", 30.0, 0.0, 10000.0);
  projector->jitter_s = 1e-3 * clt_read_number(section, "jitter_ms", 0.0, 0.0, 1000.0);
}

/* A camera has a pose of its own with position and target, or none of a pose's keys; one with pixels of its own may
 * have another image angle where the projector stands. */
static void read_camera_pose(clt_section section, clt_scene_description *description) {
  clt_camera_description *camera = &description->camera;
  bool given = false;
  for (size_t k = 0; k < sizeof geometry_keys / sizeof geometry_keys[0]; k++) {
    bool alone = strcmp(geometry_keys[k], "tangent") == 0 && clt_section_has(section, "pixels");
    given = given || (clt_section_has(section, geometry_keys[k]) && !alone);
  }
  camera->placed = clt_section_has(section, "position") && clt_section_has(section, "target");
  if (camera->placed) {
    read_pose(section, "camera", &description->projector.pinhole, &camera->pinhole);
  } else if (given) {
    clt_section_fail(section, NULL,
                     "a camera with a pose of its own needs position and target; without one leave out position, "
                     "target, up and tangent: it then stands at the projector");
  }
}

static void read_camera(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(root, "camera");
  clt_camera_description *camera = &description->camera;
  if (description->transport == NULL) {
    read_camera_pose(section, description);
  } else {
    refuse_geometry(section);
  }
  clt_scene_read_pixels(section, description);
  camera->bits = clt_read_integer(section, "bits", 12, 8, 16);
  camera->response = read_curve(section, "linear");
  camera->responsivity =
      clt_section_has(section, "responsivity") ? clt_read_number(section, "responsivity", 1.0, 1e-9, 1e9) : 0.0;
  camera->full_well = clt_read_number(section, "full_well", 15000.0, 10.0, 1e7);
  camera->read_noise = clt_read_number(section, "read_noise", 4.0, 0.0, 1000.0);
  camera->photon_noise = clt_read_flag(section, "photon_noise", true);
  camera->black_level = clt_read_integer(section, "black_level", 1 << (camera->bits - 6), 0, 1 << (camera->bits - 1));
  camera->frame_s = 1.0 / clt_read_number(section, "fps", 60.0, 0.1, 1000.0);
  camera->exposure_delay = clt_read_integer(section, "exposure_delay_frames", 1, 0, CLT_EXPOSURE_DELAY_MAX);
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
  read_camera(root, description);
  clt_scene_read_channels(root, "ambient", description->channels, 0.002, 0.0, 1e6, description->ambient);
  description->seed = (uint64_t)clt_read_integer(root, "seed", 1, 0, 2147483647);
  clt_effects_read(root, description);
  if (!file) {
    clt_scene_read_surfaces(root, description);
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
    clt_scene_check_lit(root, description);
    clt_scene_check_seen(root, description);
    status = clt_settings_finish(settings, error);
  }
  clt_settings_close(settings);
  return status;
}

void clt_scene_description_finish(clt_scene_description *description) {
  clt_transport_destroy(description->transport);
  free(description->surfaces);
  description->transport = NULL;
  description->surfaces = NULL;
  description->surface_count = description->surface_room = 0;
}

bool clt_scene_reserve_surfaces(clt_scene_description *description, int more) {
  int needed = description->surface_count + more, room = 2 * description->surface_room;
  if (needed > CLT_SURFACES_MAX) {
    return false;
  }
  if (needed > description->surface_room) {
    room = room > needed ? room : needed;
    clt_rectangle *grown = realloc(description->surfaces, (size_t)room * sizeof *grown);
    if (grown == NULL) {
      return false;
    }
    description->surfaces = grown;
    description->surface_room = room;
  }
  return true;
}

clt_vector clt_scene_eye(const clt_scene_description *description) {
  return description->camera.placed ? description->camera.pinhole.position : description->projector.pinhole.position;
}

bool clt_scene_is_glossy(const clt_scene_description *description, int surface) {
  const clt_gloss *gloss = &description->gloss[description->surfaces[surface].material];
  bool found = false;
  for (int c = 0; c < description->channels; c++) {
    found = found || gloss->strength[c] > 0.0;
  }
  return found;
}

double clt_ambient_most(const clt_scene_description *description) {
  double most = 0.0;
  for (int c = 0; c < description->channels; c++) {
    most = fmax(most, description->ambient[c]);
  }
  return most;
}
