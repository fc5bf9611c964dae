/* Reading the station's sections of a configuration file (docs/configuration.md). */
#include <stdio.h>
#include <string.h>

#include "acquire/station_devices.h"
#include "base/file.h"
#include "base/settings.h"
#include "counterlight/station.h"
#include "counterlight/transport.h"
#include "rig/merge.h"

static const char *const scheme_names[] = {"auto", "brute", "hadamard", "hierarchical", "blocks", NULL};
#define MS 1e-3

/* What a configuration holds that says nothing: everything from the scene. */
static void set_defaults(clt_station_config *config) {
  *config = (clt_station_config){.rig.latency_s = -1};
  clt_section nothing = {0};
  clt_station_read_projector(nothing, config);
  clt_station_read_camera(nothing, config);
  snprintf(config->scheme, sizeof config->scheme, "%s", scheme_names[0]);
}

static void copy_text(char *to, size_t size, const char *text) {
  snprintf(to, size, "%s", text);
}

static void read_patch(clt_section section, clt_patch *patch) {
  patch->left = clt_read_integer(section, "left", 0, 0, CLT_GRID_SIDE_MAX);
  patch->top = clt_read_integer(section, "top", 0, 0, CLT_GRID_SIDE_MAX);
  patch->side = clt_read_integer(section, "side", 0, 1, CLT_GRID_SIDE_MAX / 4);
  if (section.group != NULL && !clt_section_has(section, "side")) {
    clt_section_fail(section, NULL, "patch needs a side, the cells of one of its 4 x 4 blocks");
  }
}

static void read_rig(clt_section section, clt_rig_config *rig) {
  double exposures_ms[CLT_EXPOSURES_MAX];
  rig->width = clt_read_integer(section, "width", 0, 1, CLT_GRID_SIDE_MAX);
  rig->height = clt_read_integer(section, "height", 0, 1, CLT_GRID_SIDE_MAX);
  rig->exposure_count = clt_read_numbers(section, "exposures_ms", exposures_ms, 1, CLT_EXPOSURES_MAX, 0.01, 60000);
  for (int k = 0; k < rig->exposure_count; k++) {
    rig->exposures_s[k] = exposures_ms[k] * MS;
    if (k > 0 && exposures_ms[k] <= exposures_ms[k - 1]) {
      clt_section_fail(section, "exposures_ms", "has %g after %g; the exposures must ascend", exposures_ms[k],
                       exposures_ms[k - 1]);
    }
  }
  if (clt_section_has(section, "width") != clt_section_has(section, "height")) {
    clt_section_fail(section, NULL, "rig needs both width and height, or neither");
  }
  double latency_ms = clt_read_number(section, "latency_ms", -1, 0, 10000);
  rig->latency_s = latency_ms < 0 ? -1 : latency_ms * MS;
  rig->timeout_s = clt_read_number(section, "timeout_ms", 0, 1, 600000) * MS;
  rig->attempts = clt_read_integer(section, "attempts", 0, 1, 100);
  rig->verify = clt_read_flag(section, "verify", false);
  read_patch(clt_section_group(section, "patch"), &rig->patch);
}

static void read_acquire(clt_section section, clt_station_config *config) {
  clt_acquire_options *acquire = &config->acquire;
  copy_text(config->scheme, sizeof config->scheme, scheme_names[clt_read_choice(section, "scheme", 0, scheme_names)]);
  acquire->threshold = clt_read_number(section, "threshold", 0, 0, 0.5);
  acquire->error = clt_read_number(section, "error", 0, 0, 0.5);
  acquire->seconds = clt_read_number(section, "seconds", 0, 0, 1e9);
  acquire->repeats = clt_read_integer(section, "repeats", 0, 1, 256);
  acquire->checks = clt_read_integer(section, "checks", 2, 0, 64);
  acquire->watch = clt_read_integer(section, "watch", -1, 0, 1000000);
  acquire->watch_s = clt_read_number(section, "watch_s", 0, 0, 1e6);
  acquire->patience_s = clt_read_number(section, "patience_s", 0, 0, 1e6);
  acquire->seed = (unsigned)clt_read_integer(section, "seed", 0, 0, 1000000000);
}

/* A file or folder that the configuration names, relative to its own folder; "" where it names none. */
static clt_status read_place(clt_section section, const char *key, const char *path, char *place, clt_error *error) {
  const char *name = clt_read_text(section, key, "", CLT_PATH_MAX - 1);
  if (name[0] == '\0') {
    return CLT_OK;
  }
  char folder[CLT_PATH_MAX];
  clt_file_folder(path, folder);
  clt_status status = clt_file_join(folder, name, place, error);
  return status == CLT_OK ? status : clt_fail_within(error, "%s: %s: ", path, key);
}

static clt_status read_places(clt_section root, const char *path, clt_station_config *config, clt_error *error) {
  clt_section rig = clt_section_group(root, "rig");
  clt_status status = read_place(root, "scene", path, config->scene, error);
  if (status == CLT_OK) {
    status = read_place(root, "replay", path, config->replay, error);
  }
  return status == CLT_OK ? read_place(rig, "calibration", path, config->calibration, error) : status;
}

clt_status clt_station_read(const char *path, clt_station_config *config, clt_error *error) {
  clt_settings *settings = NULL;
  clt_status status = clt_settings_open(path, &settings, error);
  if (status != CLT_OK) {
    return status;
  }
  set_defaults(config);
  clt_section root = clt_settings_root(settings);
  status = read_places(root, path, config, error);
  clt_station_read_projector(clt_section_group(root, "projector"), config);
  clt_station_read_camera(clt_section_group(root, "camera"), config);
  config->verify_given = clt_section_has(clt_section_group(root, "rig"), "verify");
  read_rig(clt_section_group(root, "rig"), &config->rig);
  read_acquire(clt_section_group(root, "acquire"), config);
  clt_section_leave(root, "daemon");
  if (status == CLT_OK) {
    status = clt_settings_finish(settings, error);
  }
  clt_settings_close(settings);
  return status;
}

clt_status clt_station_for_scene(const char *scene_path, clt_station_config *config, clt_error *error) {
  set_defaults(config);
  config->acquire.checks = 2;
  config->acquire.watch = -1;
  if (strlen(scene_path) >= sizeof config->scene) {
    return clt_fail(error, CLT_BAD_INPUT, "%.80s...: the path is longer than %d characters", scene_path,
                    CLT_PATH_MAX - 1);
  }
  copy_text(config->scene, sizeof config->scene, scene_path);
  return CLT_OK;
}
