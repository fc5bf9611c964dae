/* Cameras of libcamera. */
#include "cli/doctor.h"

#ifdef CLT_HAVE_LIBCAMERA

#include <string.h>

#include "device/camera/libcamera_list.h"

static json_t *offers_json(const clt_libcamera_camera *camera) {
  json_t *offers = json_array();
  for (int k = 0; k < camera->offer_count; k++) {
    const clt_libcamera_offer *offer = &camera->offers[k];
    json_array_append_new(offers, json_pack("{s:s?, s:s, s:b, s:b, s:i, s:i}", "format",
                                            offer->code[0] != '\0' ? offer->code : NULL, "name", offer->name, "read",
                                            offer->code[0] != '\0', "raw", offer->raw, "width", offer->width, "height",
                                            offer->height));
  }
  return offers;
}

static json_t *settings_json(const clt_libcamera_camera *camera) {
  json_t *settings = json_array();
  for (int k = 0; k < camera->setting_count; k++) {
    const clt_libcamera_setting *setting = &camera->settings[k];
    json_array_append_new(settings,
                          json_pack("{s:s, s:f, s:f, s:f, s:b}", "name", setting->name, "least", setting->least, "most",
                                    setting->most, "standard", setting->standard, "automatic", setting->automatic));
  }
  return settings;
}

static json_t *camera_json(const clt_libcamera_camera *camera, bool chosen) {
  return json_pack("{s:s, s:s, s:s, s:b, s:o, s:o}", "driver", "libcamera", "device", camera->id, "name", camera->model,
                   "chosen", chosen, "formats", offers_json(camera), "controls", settings_json(camera));
}

static bool offers_control(const clt_libcamera_camera *camera, const char *name) {
  for (int k = 0; k < camera->setting_count; k++) {
    if (strcmp(camera->settings[k].name, name) == 0) {
      return true;
    }
  }
  return false;
}

static bool offers_read(const clt_libcamera_camera *camera) {
  for (int k = 0; k < camera->offer_count; k++) {
    if (camera->offers[k].code[0] != '\0') {
      return true;
    }
  }
  return false;
}

/* What libcamera cannot set it cannot lock. */
static void find_unlocked(doctor *self, const clt_libcamera_camera *camera, bool meant) {
  doctor_level level = meant ? DOCTOR_WARNING : DOCTOR_NOTE;
  if (!offers_control(camera, "ExposureTime")) {
    doctor_find(self, level, "the driver v4l2 may, where the camera is on USB",
                "libcamera offers no control of the exposure of \"%s\": it has one exposure only", camera->id);
  }
  if (!offers_control(camera, "AwbEnable")) {
    doctor_find(self, level, "use the driver v4l2, which can, where the camera is on USB; else see that it has none",
                "libcamera offers no control of the white balance of \"%s\": if it is automatic, it stays so",
                camera->id);
  }
}

/* As the driver chooses: "auto" is the first. */
static bool is_meant(const doctor *self, const clt_libcamera_camera *camera, bool first) {
  const char *device = self->config.camera.device;
  size_t length = strlen(device), whole = strlen(camera->id);
  if (!self->configured || strcmp(self->config.camera.driver, "libcamera") != 0) {
    return false;
  }
  return (first && strcmp(device, "auto") == 0) || strcmp(device, camera->model) == 0 ||
         (length <= whole && strcmp(camera->id + whole - length, device) == 0);
}

static void look_at_camera(doctor *self, const clt_libcamera_camera *camera, bool meant) {
  if (!offers_read(camera)) {
    doctor_find(self, meant ? DOCTOR_PROBLEM : DOCTOR_NOTE, "another camera, or another driver",
                "\"%s\" (%s) offers libcamera no format that is read", camera->id, camera->model);
    return;
  }
  doctor_find(self, DOCTOR_GOOD, NULL, "libcamera has \"%s\" (%s)%s", camera->id, camera->model,
              meant ? " (the configuration's)" : "");
  find_unlocked(self, camera, meant);
}

void doctor_look_at_libcamera(doctor *self) {
  clt_libcamera_cameras cameras;
  clt_error error = {0};
  json_t *list = json_object_get(self->document, "cameras");
  if (clt_libcamera_list(&cameras, &error) != CLT_OK) {
    doctor_find(self, doctor_level_of(self, "libcamera", DOCTOR_NOTE), "see whether this user may open /dev/media*",
                "%s", error.message);
    return;
  }
  int meant = 0;
  for (int k = 0; k < cameras.count; k++) {
    bool this_one = is_meant(self, &cameras.camera[k], k == 0);
    meant += this_one;
    json_array_append_new(list, camera_json(&cameras.camera[k], this_one));
    look_at_camera(self, &cameras.camera[k], this_one);
  }
  if (doctor_uses(self, "libcamera") && meant == 0) {
    doctor_find(self, DOCTOR_PROBLEM, "plug it in, or correct `device`",
                "the configuration's camera \"%s\" is not among the %d of libcamera", self->config.camera.device,
                cameras.count);
  } else if (cameras.count == 0) {
    doctor_find(self, DOCTOR_NOTE, "needed for cameras on a ribbon cable only; those on USB work with v4l2",
                "there is no camera of libcamera");
  }
  clt_libcamera_cameras_finish(&cameras);
}

#else

void doctor_look_at_libcamera(doctor *self) {
  doctor_find(self, doctor_level_of(self, "libcamera", DOCTOR_NOTE), "build with -Dlibcamera=enabled",
              "the driver libcamera is not in this build");
}

#endif
