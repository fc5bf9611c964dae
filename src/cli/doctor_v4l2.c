/* Cameras of Video4Linux. */
#include "cli/doctor.h"

#ifdef CLT_HAVE_V4L2

#include <ctype.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>

#include "device/camera/v4l2_list.h"

/* USB carries so much of its nominal speed at best. */
#define USB_USABLE 0.8
/* Less is USB 1. */
#define SLOW_USB_MBIT_S 480

static json_t *sizes_json(const clt_v4l2_offer *offer) {
  json_t *sizes = json_array();
  for (int k = 0; k < offer->size_count; k++) {
    const clt_v4l2_size *size = &offer->sizes[k];
    json_array_append_new(sizes, json_pack("{s:i, s:i, s:f, s:f}", "width", size->width, "height", size->height,
                                           "rate_low_hz", size->rate_low_hz, "rate_high_hz", size->rate_high_hz));
  }
  return sizes;
}

static json_t *offers_json(const clt_v4l2_camera *camera) {
  json_t *offers = json_array();
  for (int k = 0; k < camera->offer_count; k++) {
    const clt_v4l2_offer *offer = &camera->offers[k];
    json_array_append_new(offers,
                          json_pack("{s:s%, s:s, s:b, s:i, s:i, s:b, s:o}", "format", offer->code, strlen(offer->code),
                                    "name", offer->name, "read", offer->decoded, "channels", offer->channels, "bits",
                                    offer->depth, "compressed", offer->compressed, "sizes", sizes_json(offer)));
  }
  return offers;
}

static json_t *settings_json(const clt_v4l2_camera *camera) {
  json_t *settings = json_array();
  for (int k = 0; k < camera->setting_count; k++) {
    const clt_v4l2_setting *setting = &camera->settings[k];
    json_array_append_new(settings,
                          json_pack("{s:s, s:I, s:I, s:I, s:I, s:b, s:b, s:b}", "name", setting->name, "value",
                                    (json_int_t)setting->value, "least", (json_int_t)setting->least, "most",
                                    (json_int_t)setting->most, "standard", (json_int_t)setting->standard, "automatic",
                                    setting->automatic, "on", setting->on, "read_only", setting->read_only));
  }
  return settings;
}

static json_t *camera_json(const clt_v4l2_camera *camera, bool chosen) {
  return json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:f, s:b, s:o, s:o}", "driver", "v4l2", "node", camera->node,
                   "device", camera->stable, "name", camera->card, "kernel_driver", camera->driver, "status",
                   clt_status_name(camera->status), "usb_mbit_s", camera->usb_mbit_s, "chosen", chosen, "formats",
                   offers_json(camera), "controls", settings_json(camera));
}

/* Whether the configuration means this camera, as far as its name tells. */
static bool is_meant(const doctor *self, const clt_v4l2_camera *camera) {
  const char *device = self->config.camera.device;
  clt_usb_id which;
  if (!self->configured || strcmp(self->config.camera.driver, "v4l2") != 0) {
    return false;
  }
  if (strcmp(device, "auto") == 0 || strcmp(device, camera->node) == 0 || strcmp(device, camera->stable) == 0) {
    return true;
  }
  return camera->is_usb && clt_usb_parse(device, &which, NULL) == CLT_OK && clt_usb_matches(&which, &camera->usb);
}

/* v4l2-ctl's name of a control: "White Balance, Automatic" is white_balance_automatic. */
static void tool_name(const char *name, char *out, size_t size) {
  size_t used = 0;
  for (; *name != '\0' && used + 1 < size; name++) {
    if (isalnum((unsigned char)*name)) {
      out[used++] = (char)tolower((unsigned char)*name);
    } else if (used > 0 && out[used - 1] != '_') {
      out[used++] = '_';
    }
  }
  out[used] = '\0';
}

static void find_automatic(doctor *self, const clt_v4l2_camera *camera, const clt_v4l2_setting *setting) {
  char advice[CLT_MESSAGE_MAX], name[sizeof setting->name];
  if (!setting->automatic || !setting->on) {
    return;
  }
  if (setting->read_only) {
    doctor_find(self, DOCTOR_WARNING, "measure with another camera: what it photographs changes by itself",
                "%s: \"%s\" is automatic and cannot be switched off", camera->node, setting->name);
    return;
  }
  tool_name(setting->name, name, sizeof name);
  snprintf(advice, sizeof advice,
           "must be locked to measure; the driver v4l2 does so as it opens the camera, and by hand: v4l2-ctl -d %s -c "
           "%s=%d",
           camera->node, name, setting->id == V4L2_CID_EXPOSURE_AUTO ? V4L2_EXPOSURE_MANUAL : 0);
  doctor_find(self, DOCTOR_NOTE, advice, "%s: \"%s\" is automatic now", camera->node, setting->name);
}

static void find_speed(doctor *self, const clt_v4l2_camera *camera) {
  if (camera->usb_mbit_s > 0 && camera->usb_mbit_s < SLOW_USB_MBIT_S) {
    doctor_find(self, DOCTOR_WARNING, "another port or cable, and no old hub between",
                "%s is connected with %g Mbit/s only", camera->node, camera->usb_mbit_s);
  }
}

/* Formats that are read, in the order of the camera; returns how many. */
static int list_formats(const clt_v4l2_camera *camera, char *text, size_t size) {
  int count = 0;
  text[0] = '\0';
  for (int k = 0; k < camera->offer_count; k++) {
    size_t used = strlen(text);
    if (camera->offers[k].decoded) {
      snprintf(text + used, size - used, "%s%s", count > 0 ? ", " : "", camera->offers[k].code);
      count++;
    }
  }
  return count;
}

static const clt_v4l2_offer *find_offer(const clt_v4l2_camera *camera, const char *code) {
  for (int k = 0; k < camera->offer_count; k++) {
    if (camera->offers[k].decoded && strcmp(camera->offers[k].code, code) == 0) {
      return &camera->offers[k];
    }
  }
  return NULL;
}

static bool fits_between(const clt_v4l2_offer *offer, int width, int height) {
  int least_w = width, least_h = height, most_w = 0, most_h = 0;
  for (int k = 0; k < offer->size_count; k++) {
    least_w = offer->sizes[k].width < least_w ? offer->sizes[k].width : least_w;
    least_h = offer->sizes[k].height < least_h ? offer->sizes[k].height : least_h;
    most_w = offer->sizes[k].width > most_w ? offer->sizes[k].width : most_w;
    most_h = offer->sizes[k].height > most_h ? offer->sizes[k].height : most_h;
  }
  return width >= least_w && width <= most_w && height >= least_h && height <= most_h;
}

/* The uncompressed picture of the configuration, against what its connection carries. */
static void find_bandwidth(doctor *self, const clt_v4l2_camera *camera, const clt_v4l2_offer *offer) {
  const clt_camera_config *asked = &self->config.camera;
  double mbit_s = 16e-6 * asked->width * asked->height * asked->rate_hz;
  if (!offer->compressed && camera->usb_mbit_s > 0 && mbit_s > USB_USABLE * camera->usb_mbit_s) {
    doctor_find(self, DOCTOR_WARNING, "a smaller picture, a lower rate_hz, or a faster port",
                "%s: %d x %d at %g Hz uncompressed are some %.0f Mbit/s, the connection has %g", camera->node,
                asked->width, asked->height, asked->rate_hz, mbit_s, camera->usb_mbit_s);
  }
}

static void check_asked(doctor *self, const clt_v4l2_camera *camera) {
  const clt_camera_config *asked = &self->config.camera;
  const clt_v4l2_offer *offer = find_offer(camera, asked->format);
  char formats[256];
  list_formats(camera, formats, sizeof formats);
  if (strcmp(asked->format, "auto") != 0 && offer == NULL) {
    doctor_find(self, DOCTOR_PROBLEM, "set `format` to one of these, or to \"auto\"",
                "%s offers no %s that is read; it offers %s", camera->node, asked->format, formats);
  }
  if (offer != NULL && asked->width > 0 && !fits_between(offer, asked->width, asked->height)) {
    doctor_find(self, DOCTOR_PROBLEM, "counterlight doctor --json lists the sizes", "%s offers no %s of %d x %d pixels",
                camera->node, asked->format, asked->width, asked->height);
  }
  if (offer != NULL && asked->width > 0 && asked->rate_hz > 0) {
    find_bandwidth(self, camera, offer);
  }
}

static void look_at_camera(doctor *self, const clt_v4l2_camera *camera, bool meant) {
  char formats[256];
  if (camera->status != CLT_OK) {
    doctor_find(self, meant ? DOCTOR_PROBLEM : DOCTOR_WARNING,
                "join the group video, or see who has it: fuser -v /dev/video*", "%s: %s", camera->node,
                camera->message);
    return;
  }
  if (list_formats(camera, formats, sizeof formats) == 0) {
    doctor_find(self, meant ? DOCTOR_PROBLEM : DOCTOR_NOTE, "another camera, or another driver",
                "%s (%s) offers no format that is read", camera->node, camera->card);
    return;
  }
  doctor_find(self, DOCTOR_GOOD, NULL, "%s is \"%s\", `device = \"%s\"`: %s%s", camera->node, camera->card,
              camera->stable, formats, meant ? " (the configuration's)" : "");
  for (int k = 0; k < camera->setting_count; k++) {
    find_automatic(self, camera, &camera->settings[k]);
  }
  find_speed(self, camera);
  if (meant) {
    check_asked(self, camera);
  }
}

/* Nothing that is meant, or more than one. */
static void judge_choice(doctor *self, int count, int meant) {
  if (!self->configured || strcmp(self->config.camera.driver, "v4l2") != 0) {
    if (count == 0) {
      doctor_find(self, DOCTOR_NOTE, "plug one in; dmesg says whether the kernel sees it",
                  "there is no camera of Video4Linux");
    }
  } else if (meant == 0) {
    doctor_find(self, DOCTOR_PROBLEM, "plug it in, or correct `device`; dmesg says whether the kernel sees it",
                "the configuration's camera \"%s\" is not among the %d of Video4Linux", self->config.camera.device,
                count);
  } else if (meant > 1) {
    doctor_find(self, DOCTOR_PROBLEM, "name one as `device`, by what is given above",
                "the configuration's camera \"%s\" may be any of %d", self->config.camera.device, meant);
  }
}

void doctor_look_at_v4l2(doctor *self) {
  clt_v4l2_cameras cameras;
  clt_error error = {0};
  json_t *list = json_array();
  json_object_set_new(self->document, "cameras", list);
  if (clt_v4l2_list(&cameras, &error) != CLT_OK) {
    doctor_find(self, DOCTOR_WARNING, NULL, "%s", error.message);
    return;
  }
  int meant = 0;
  for (int k = 0; k < cameras.count; k++) {
    bool this_one = is_meant(self, &cameras.camera[k]);
    meant += this_one;
    json_array_append_new(list, camera_json(&cameras.camera[k], this_one));
    look_at_camera(self, &cameras.camera[k], this_one);
  }
  judge_choice(self, cameras.count, meant);
  clt_v4l2_cameras_finish(&cameras);
}

#else

void doctor_look_at_v4l2(doctor *self) {
  json_object_set_new(self->document, "cameras", json_array());
  doctor_find(self, doctor_level_of(self, "v4l2", DOCTOR_NOTE), "build with -Dv4l2=enabled",
              "the driver v4l2 is not in this build");
}

#endif
