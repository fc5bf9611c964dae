#include "counterlight/station.h"

#include <stdio.h>
#include <string.h>

#include "counterlight/replay.h"
#include "device/camera/libcamera.h"
#include "device/camera/v4l2.h"
#include "device/projector/glfw.h"

/* Where neither the file nor a scene says. */
#define TIMEOUT_S 2.0
enum { ATTEMPTS = 3 };

/* A driver opens its devices as the configuration says; scene is NULL where it names none. A driver of cameras only has
 * no open_projector, and the other way round. */
typedef struct driver_entry {
  const char *name;
  clt_status (*open_projector)(const clt_projector_config *config, clt_scene *scene, clt_projector **out,
                               clt_error *error);
  clt_status (*open_camera)(const clt_camera_config *config, clt_scene *scene, clt_camera **out, clt_error *error);
} driver_entry;

static clt_status need_scene(const clt_scene *scene, clt_error *error) {
  return scene != NULL ? CLT_OK
                       : clt_fail(error, CLT_BAD_INPUT,
                                  "the simulated devices need a scene; set scene = \"scenes/NAME.cfg\" in the "
                                  "configuration");
}

static clt_status open_simulated_projector(const clt_projector_config *config, clt_scene *scene, clt_projector **out,
                                           clt_error *error) {
  (void)config;
  clt_status status = need_scene(scene, error);
  return status == CLT_OK ? clt_scene_open_projector(scene, out, error) : status;
}

static clt_status open_simulated_camera(const clt_camera_config *config, clt_scene *scene, clt_camera **out,
                                        clt_error *error) {
  (void)config;
  clt_status status = need_scene(scene, error);
  return status == CLT_OK ? clt_scene_open_camera(scene, out, error) : status;
}

#ifdef CLT_HAVE_GLFW
static clt_status open_glfw_projector(const clt_projector_config *config, clt_scene *scene, clt_projector **out,
                                      clt_error *error) {
  (void)scene;
  return clt_glfw_open_projector(config, out, error);
}
#endif

#ifdef CLT_HAVE_V4L2
static clt_status open_v4l2_camera(const clt_camera_config *config, clt_scene *scene, clt_camera **out,
                                   clt_error *error) {
  (void)scene;
  return clt_v4l2_open(config, out, error);
}
#endif

#ifdef CLT_HAVE_LIBCAMERA
static clt_status open_libcamera_camera(const clt_camera_config *config, clt_scene *scene, clt_camera **out,
                                        clt_error *error) {
  (void)scene;
  return clt_libcamera_camera_open(config, out, error);
}
#endif

static const driver_entry drivers[] = {
    {"simulated", open_simulated_projector, open_simulated_camera},
#ifdef CLT_HAVE_GLFW
    {"glfw", open_glfw_projector, NULL},
#endif
#ifdef CLT_HAVE_V4L2
    {"v4l2", NULL, open_v4l2_camera},
#endif
#ifdef CLT_HAVE_LIBCAMERA
    {"libcamera", NULL, open_libcamera_camera},
#endif
};
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

static clt_status check_drivers(const clt_station_config *config, clt_error *error) {
  const driver_entry *found = NULL;
  clt_status status = find_driver(config->projector.driver, false, &found, error);
  return status == CLT_OK ? find_driver(config->camera.driver, true, &found, error) : status;
}

clt_status clt_station_begin(const clt_station_config *config, clt_station *station, clt_error *error) {
  *station = (clt_station){0};
  clt_status status = config->replay[0] == '\0' ? check_drivers(config, error) : CLT_OK;
  if (status == CLT_OK && config->calibration[0] != '\0') {
    status = clt_calibration_load(config->calibration, &station->calibration, error);
  }
  if (status == CLT_OK && config->scene[0] != '\0') {
    status = clt_scene_open(config->scene, &station->scene, error);
  }
  if (status != CLT_OK) {
    clt_station_close(station);
  }
  return status;
}

clt_status clt_station_open_projector(const clt_station_config *config, clt_station *station, clt_error *error) {
  const driver_entry *driver = NULL;
  if (station->projector != NULL) {
    return CLT_OK;
  }
  if (config->replay[0] != '\0') {
    clt_station_close_camera(station);
    return clt_replay_open(config->replay, &station->projector, &station->camera, error);
  }
  clt_status status = find_driver(config->projector.driver, false, &driver, error);
  return status == CLT_OK ? driver->open_projector(&config->projector, station->scene, &station->projector, error)
                          : status;
}

clt_status clt_station_open_camera(const clt_station_config *config, clt_station *station, clt_error *error) {
  const driver_entry *driver = NULL;
  if (station->camera != NULL) {
    return CLT_OK;
  }
  if (config->replay[0] != '\0') {
    return clt_fail(error, CLT_GONE, "%s: a recording's camera opens with its projector only", config->replay);
  }
  clt_status status = find_driver(config->camera.driver, true, &driver, error);
  return status == CLT_OK ? driver->open_camera(&config->camera, station->scene, &station->camera, error) : status;
}

/* Puts the recorder before the devices. */
static clt_status record_devices(const char *folder, clt_station *station, clt_error *error) {
  station->recorded_projector = station->projector;
  station->recorded_camera = station->camera;
  station->projector = NULL;
  station->camera = NULL;
  return clt_recording_open(folder, station->recorded_projector, station->recorded_camera, &station->projector,
                            &station->camera, error);
}

clt_status clt_station_open(const clt_station_config *config, clt_station *station, clt_error *error) {
  clt_status status = clt_station_begin(config, station, error);
  status = status == CLT_OK ? clt_station_open_projector(config, station, error) : status;
  status = status == CLT_OK ? clt_station_open_camera(config, station, error) : status;
  if (status == CLT_OK && config->record[0] != '\0') {
    status = record_devices(config->record, station, error);
  }
  if (status != CLT_OK) {
    clt_station_close(station);
  }
  return status;
}

clt_rig_config clt_station_rig_config(const clt_station_config *config, const clt_station *station) {
  clt_rig_config rig = config->rig, measured = config->rig;
  if (station->scene != NULL) {
    clt_scene_rig_config(station->scene, &measured);
  }
  if (station->calibration != NULL) {
    clt_calibration_apply(station->calibration, &measured);
  }
  measured.verify = config->verify_given ? rig.verify : true;
  measured.patch = rig.patch;
  if (rig.width != 0) {
    measured.width = rig.width;
    measured.height = rig.height;
  }
  if (rig.exposure_count != 0) {
    memcpy(measured.exposures_s, rig.exposures_s, sizeof rig.exposures_s);
    measured.exposure_count = rig.exposure_count;
  }
  measured.latency_s = rig.latency_s < 0 ? measured.latency_s : rig.latency_s;
  measured.timeout_s = rig.timeout_s > 0 ? rig.timeout_s : measured.timeout_s > 0 ? measured.timeout_s : TIMEOUT_S;
  measured.attempts = rig.attempts > 0 ? rig.attempts : measured.attempts > 0 ? measured.attempts : ATTEMPTS;
  for (int c = 0; c < CLT_PANEL_CHANNELS && config->projector_response_given; c++) {
    measured.projector.response[c] = rig.projector.response[c];
  }
  measured.camera = config->camera_response_given ? rig.camera : measured.camera;
  return measured;
}

clt_status clt_station_open_rig(const clt_station_config *config, clt_station *station, clt_projector *projector,
                                clt_error *error) {
  clt_rig_config rig = clt_station_rig_config(config, station);
  clt_status status =
      clt_rig_open(&rig, projector != NULL ? projector : station->projector, station->camera, &station->rig, error);
  return status != CLT_OK && config->calibration[0] != '\0' ? clt_fail_within(error, "with %s: ", config->calibration)
                                                            : status;
}

static void close_projector(clt_projector **projector) {
  if (*projector != NULL) {
    (*projector)->driver->close(*projector);
  }
  *projector = NULL;
}

static void close_camera(clt_camera **camera) {
  if (*camera != NULL) {
    (*camera)->driver->close(*camera);
  }
  *camera = NULL;
}

void clt_station_close_projector(clt_station *station) {
  close_projector(&station->projector);
  close_projector(&station->recorded_projector);
}

void clt_station_close_camera(clt_station *station) {
  if (station->rig != NULL) {
    station->rig->operations->close(station->rig);
  }
  station->rig = NULL;
  close_camera(&station->camera);
  close_camera(&station->recorded_camera);
}

void clt_station_close(clt_station *station) {
  if (station == NULL) {
    return;
  }
  clt_station_close_camera(station);
  clt_station_close_projector(station);
  clt_scene_close(station->scene);
  clt_calibration_destroy(station->calibration);
  *station = (clt_station){0};
}
