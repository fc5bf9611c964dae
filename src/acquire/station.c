#include "counterlight/station.h"

#include <stdio.h>
#include <string.h>

/* A driver opens its devices for a station; scene is NULL where the configuration names none. A driver of cameras only
 * has no open_projector, and the other way round. */
typedef struct driver_entry {
  const char *name;
  clt_status (*open_projector)(clt_scene *scene, clt_projector **out, clt_error *error);
  clt_status (*open_camera)(clt_scene *scene, clt_camera **out, clt_error *error);
} driver_entry;

static clt_status need_scene(const clt_scene *scene, clt_error *error) {
  return scene != NULL ? CLT_OK
                       : clt_fail(error, CLT_BAD_INPUT,
                                  "the simulated devices need a scene; set scene = \"scenes/NAME.cfg\" in the "
                                  "configuration");
}

static clt_status open_simulated_projector(clt_scene *scene, clt_projector **out, clt_error *error) {
  clt_status status = need_scene(scene, error);
  return status == CLT_OK ? clt_scene_open_projector(scene, out, error) : status;
}

static clt_status open_simulated_camera(clt_scene *scene, clt_camera **out, clt_error *error) {
  clt_status status = need_scene(scene, error);
  return status == CLT_OK ? clt_scene_open_camera(scene, out, error) : status;
}

static const driver_entry drivers[] = {{"simulated", open_simulated_projector, open_simulated_camera}};
enum { DRIVERS = sizeof drivers / sizeof drivers[0] };

static bool drives(const driver_entry *driver, bool camera) {
  return camera ? driver->open_camera != NULL : driver->open_projector != NULL;
}

/* The driver of that name for cameras or for projectors. */
static clt_status find_driver(const char *name, bool camera, const driver_entry **out, clt_error *error) {
  char names[128] = "";
  for (size_t i = 0; i < DRIVERS; i++) {
    if (!drives(&drivers[i], camera)) {
      continue;
    }
    if (strcmp(drivers[i].name, name) == 0) {
      *out = &drivers[i];
      return CLT_OK;
    }
    size_t used = strlen(names);
    snprintf(names + used, sizeof names - used, "%s%s", used > 0 ? ", " : "", drivers[i].name);
  }
  return clt_fail(error, CLT_BAD_INPUT, "there is no %s driver \"%s\"; there are: %s", camera ? "camera" : "projector",
                  name, names);
}

clt_status clt_station_open(const clt_station_config *config, clt_station *station, clt_error *error) {
  const driver_entry *projector = NULL, *camera = NULL;
  *station = (clt_station){0};
  clt_status status = find_driver(config->projector, false, &projector, error);
  if (status == CLT_OK) {
    status = find_driver(config->camera, true, &camera, error);
  }
  if (status == CLT_OK && config->scene[0] != '\0') {
    status = clt_scene_open(config->scene, &station->scene, error);
  }
  if (status == CLT_OK) {
    status = projector->open_projector(station->scene, &station->projector, error);
  }
  if (status == CLT_OK) {
    status = camera->open_camera(station->scene, &station->camera, error);
  }
  if (status != CLT_OK) {
    clt_station_close(station);
  }
  return status;
}

/* The rig's settings with what the configuration leaves out taken from the scene. */
static clt_rig_config complete_rig(const clt_station_config *config, const clt_scene *scene) {
  clt_rig_config rig = config->rig, measured = config->rig;
  if (scene != NULL) {
    clt_scene_rig_config(scene, &measured);
  }
  if (rig.width == 0) {
    rig.width = measured.width;
    rig.height = measured.height;
  }
  if (rig.exposure_count == 0) {
    memcpy(rig.exposures_s, measured.exposures_s, sizeof rig.exposures_s);
    rig.exposure_count = measured.exposure_count;
  }
  rig.latency_s = rig.latency_s < 0 ? measured.latency_s : rig.latency_s;
  rig.timeout_s = rig.timeout_s > 0 ? rig.timeout_s : measured.timeout_s;
  rig.attempts = rig.attempts > 0 ? rig.attempts : measured.attempts;
  for (int c = 0; c < CLT_PANEL_CHANNELS && config->projector_response_given; c++) {
    measured.projector.response[c] = rig.projector.response[c];
  }
  rig.projector = measured.projector;
  rig.camera = config->camera_response_given ? rig.camera : measured.camera;
  memcpy(rig.source, measured.source, sizeof rig.source);
  return rig;
}

clt_status clt_station_open_rig(const clt_station_config *config, clt_station *station, clt_projector *projector,
                                clt_error *error) {
  clt_rig_config rig = complete_rig(config, station->scene);
  return clt_rig_open(&rig, projector != NULL ? projector : station->projector, station->camera, &station->rig, error);
}

void clt_station_close(clt_station *station) {
  if (station == NULL) {
    return;
  }
  if (station->rig != NULL) {
    station->rig->operations->close(station->rig);
  }
  if (station->camera != NULL) {
    station->camera->driver->close(station->camera);
  }
  if (station->projector != NULL) {
    station->projector->driver->close(station->projector);
  }
  clt_scene_close(station->scene);
  *station = (clt_station){0};
}
