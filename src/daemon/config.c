#include "daemon/config.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/places.h"
#include "base/settings.h"
#include "daemon/input.h"

enum { METHOD_NAMES_MOST = 48 };

/* The path at key, resolved against the folder of the configuration; out stays as it is where the key is absent. */
static void read_path(clt_section section, const char *key, const char *folder, char *out) {
  const char *text = clt_read_text(section, key, NULL, CLT_PATH_MAX - 1);
  clt_error error = {0};
  if (text == NULL) {
    return;
  }
  if (text[0] == '\0') {
    clt_section_fail(section, key, "must name a path");
  } else if (clt_file_join(folder, text, out, &error) != CLT_OK) {
    clt_section_fail(section, key, "%s", error.message);
  }
}

static void read_method(clt_section section, daemon_config *config) {
  const char *names[METHOD_NAMES_MOST] = {"auto"};
  for (size_t i = 0; i + 2 < METHOD_NAMES_MOST && clt_method_name(i) != NULL; i++) {
    names[i + 1] = clt_method_name(i);
  }
  int choice = clt_read_choice(section, "method", 0, names);
  snprintf(config->method, sizeof config->method, "%s", names[choice]);
}

static void read_solve(clt_section section, daemon_config *config) {
  read_method(section, config);
  config->solve.method = config->method;
  config->solve.tolerance = clt_read_number(section, "tolerance", 1e-4, 1e-10, 0.5);
  config->solve.deadline_s = clt_read_number(section, "deadline_ms", 10000, 1, 600000) / 1000;
  clt_error error = {0};
  if (clt_white_parse(clt_read_text(section, "white", "auto", 31), &config->white, &error) != CLT_OK) {
    clt_section_fail(section, "white", "%s", error.message);
  }
}

static void read_moving(clt_section section, daemon_config *config) {
  static const char *const outs[] = {"clip", "scale", NULL};
  config->live.budget_ms = clt_read_number(section, "budget_ms", 12, 0.1, 1000);
  config->live.target_error = clt_read_number(section, "target_error", 0.005, 1e-5, 0.5);
  config->reach = clt_read_choice(section, "out_of_reach", 0, outs) == 1;
  config->picture_s = clt_read_number(section, "picture_seconds", 10, 0.1, 86400);
}

static void read_retry(clt_section section, daemon_config *config) {
  double limits[2] = {1, 60};
  clt_read_numbers(section, "retry_s", limits, 2, 2, 0.01, 86400);
  if (limits[0] > limits[1]) {
    clt_section_fail(section, "retry_s", "must be [least, most] with least <= most, in seconds");
  }
  config->retry_least_s = limits[0];
  config->retry_most_s = limits[1];
}

static void read_policies(clt_section section, daemon_config *config) {
  static const char *const starts[] = {"acquire", "reuse", NULL};
  static const char *const losses[] = {"hold", NULL};
  static const char *const misfits[] = {"reacquire", "refine", "report", NULL};
  config->reuse = clt_read_choice(section, "at_start", 1, starts) == 1;
  clt_read_choice(section, "on_camera_loss", 0, losses);
  config->verify_s = 60 * clt_read_number(section, "verify_minutes", 60, 0, 525600);
  config->reacquire_error = clt_read_number(section, "reacquire_error", 0, 0, 100);
  config->on_misfit = (misfit_policy)clt_read_choice(section, "on_misfit", MISFIT_REPORT, misfits);
  config->drift_limit = clt_read_number(section, "drift_limit", 0, 0, 100);
  read_retry(section, config);
}

static void read_section(clt_section section, const char *folder, daemon_config *config) {
  read_path(section, "socket", folder, config->socket);
  read_path(section, "state", folder, config->state);
  read_path(section, "content", folder, config->content);
  snprintf(config->group, sizeof config->group, "%s", clt_read_text(section, "group", "counterlight", 63));
  read_policies(section, config);
  read_solve(section, config);
  read_moving(section, config);
  if (config->content[0] == '\0') {
    clt_section_fail(section, NULL, "needs content = \"picture.png\", what is to be shown");
  }
}

static clt_status read_daemon(const char *path, daemon_config *config, clt_error *error) {
  clt_settings *settings = NULL;
  clt_status status = clt_settings_open(path, &settings, error);
  if (status != CLT_OK) {
    return status;
  }
  char folder[CLT_PATH_MAX];
  clt_file_folder(path, folder);
  clt_section root = clt_settings_root(settings);
  clt_section_leave_others(root, "daemon");
  if (clt_section_has(root, "daemon")) {
    read_section(clt_section_group(root, "daemon"), folder, config);
  } else {
    clt_section_fail(root, NULL, "needs a section daemon = { content = \"picture.png\"; }");
  }
  status = clt_settings_finish(settings, error);
  clt_settings_close(settings);
  return status;
}

/* A path of the command line, made absolute: clients are told of it. */
static clt_status override_path(const char *path, char *out, clt_error *error) {
  char folder[CLT_PATH_MAX];
  if (path == NULL) {
    return CLT_OK;
  }
  if (path[0] == '\0' || getcwd(folder, sizeof folder) == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "\"%s\" is no path that can be used", path);
  }
  return clt_file_join(folder, path, out, error);
}

/* What the command line names, and what neither it nor the file does. */
static clt_status fill_places(const daemon_overrides *overrides, daemon_config *config, clt_error *error) {
  clt_status status = override_path(overrides->socket, config->socket, error);
  status = status == CLT_OK ? override_path(overrides->state, config->state, error) : status;
  if (status == CLT_OK && config->socket[0] == '\0') {
    status = clt_place_own_socket(config->socket, error);
  }
  return status != CLT_OK || config->state[0] != '\0' ? status : clt_place_state(config->state, error);
}

clt_status daemon_config_read(const char *path, const daemon_overrides *overrides, daemon_config *config,
                              clt_error *error) {
  *config = (daemon_config){0};
  char *resolved = realpath(path, NULL);
  clt_status status = clt_file_join(".", resolved != NULL ? resolved : path, config->path, error);
  free(resolved);
  status = status == CLT_OK ? read_daemon(config->path, config, error) : status;
  status = status == CLT_OK ? clt_station_read(config->path, &config->station, error) : status;
  return status == CLT_OK ? fill_places(overrides, config, error) : status;
}

clt_status daemon_config_check(const daemon_config *config, clt_error *error) {
  clt_image picture = {0};
  clt_station station = {0};
  clt_status status = input_poster(config->content, &picture, error);
  clt_image_finish(&picture);
  status = status == CLT_OK ? clt_station_open(&config->station, &station, error) : status;
  status = status == CLT_OK ? clt_station_open_rig(&config->station, &station, NULL, error) : status;
  clt_station_close(&station);
  return status;
}

void daemon_config_copy(const daemon_config *from, daemon_config *to) {
  *to = *from;
  to->solve.method = to->method;
}

const char *daemon_config_needs_restart(const daemon_config *running, const daemon_config *wanted) {
  if (strcmp(running->socket, wanted->socket) != 0) {
    return "socket";
  }
  if (strcmp(running->state, wanted->state) != 0) {
    return "state";
  }
  if (strcmp(running->group, wanted->group) != 0) {
    return "group";
  }
  return clt_station_same(&running->station, &wanted->station) ? NULL : "the devices' sections";
}
