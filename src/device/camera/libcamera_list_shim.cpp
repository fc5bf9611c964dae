/* What cameras libcamera knows. */
#include "device/camera/libcamera_list.h"

#include <libcamera/stream.h>
#include <stdio.h>
#include <stdlib.h>

#include "device/camera/libcamera_formats.h"
#include "device/camera/libcamera_shared.hpp"

namespace {

using libcamera::Camera;

/* An array for C. */
template <typename T> T *array_of(size_t count) {
  auto *array = static_cast<T *>(calloc(count > 0 ? count : 1, sizeof(T)));
  if (array == nullptr) {
    throw std::bad_alloc();
  }
  return array;
}

template <size_t size> void write(char (&to)[size], const std::string &text) {
  snprintf(to, size, "%s", text.c_str());
}

clt_libcamera_offer offer_of(const libcamera::StreamFormats &formats, const libcamera::PixelFormat &listed,
                             const libcamera::PixelFormat &format, bool raw) {
  clt_libcamera_offer offer = {};
  clt_libcamera_format read = clt_libcamera_format_find(format.fourcc(), format.modifier());
  write(offer.code, read.name);
  write(offer.name, format.toString());
  offer.raw = raw;
  for (const libcamera::Size &size : formats.sizes(listed)) {
    if (int64_t(size.width) * size.height > int64_t(offer.width) * offer.height) {
      offer.width = int(size.width);
      offer.height = int(size.height);
    }
  }
  return offer;
}

/* The formats of all roles, each once. */
std::vector<clt_libcamera_offer> offers_of(Camera &camera) {
  std::vector<clt_libcamera_offer> offers;
  for (libcamera::StreamRole role : clt::roles) {
    std::unique_ptr<libcamera::CameraConfiguration> configuration = camera.generateConfiguration({role});
    if (configuration == nullptr || configuration->empty()) {
      continue;
    }
    bool raw = role == libcamera::StreamRole::Raw;
    const libcamera::StreamFormats formats = configuration->at(0).formats();
    for (const libcamera::PixelFormat &listed : formats.pixelformats()) {
      libcamera::PixelFormat given = raw ? clt::unpacked(*configuration, listed) : listed;
      clt_libcamera_offer one = offer_of(formats, listed, given.isValid() ? given : listed, raw);
      bool known = false;
      for (const clt_libcamera_offer &offer : offers) {
        known = known || std::string(offer.name) == one.name;
      }
      if (!known) {
        offers.push_back(one);
      }
    }
  }
  return offers;
}

void list_settings(const Camera &camera, clt_libcamera_camera *out) {
  out->settings = array_of<clt_libcamera_setting>(camera.controls().size());
  for (const auto &[control, info] : camera.controls()) {
    clt_libcamera_setting *setting = &out->settings[out->setting_count++];
    write(setting->name, control->name());
    setting->least = clt::number_of(info.min());
    setting->most = clt::number_of(info.max());
    setting->standard = clt::number_of(info.def());
    setting->automatic = clt::is_automatic(control->id());
  }
}

void list_camera(Camera &camera, clt_libcamera_camera *out) {
  write(out->id, camera.id());
  write(out->model, clt::model_of(camera));
  std::vector<clt_libcamera_offer> offers = offers_of(camera);
  out->offers = array_of<clt_libcamera_offer>(offers.size());
  for (const clt_libcamera_offer &offer : offers) {
    out->offers[out->offer_count++] = offer;
  }
  list_settings(camera, out);
}

} // namespace

const char *clt_libcamera_version(void) {
  return libcamera::CameraManager::version().c_str();
}

clt_status clt_libcamera_list(clt_libcamera_cameras *cameras, clt_error *error) {
  *cameras = {};
  clt_status status = clt::guarded(error, [&] {
    clt::Manager manager;
    std::vector<std::shared_ptr<Camera>> found = manager.cameras();
    cameras->camera = array_of<clt_libcamera_camera>(found.size());
    for (const std::shared_ptr<Camera> &camera : found) {
      list_camera(*camera, &cameras->camera[cameras->count++]);
    }
  });
  if (status != CLT_OK) {
    clt_libcamera_cameras_finish(cameras);
  }
  return status;
}

void clt_libcamera_cameras_finish(clt_libcamera_cameras *cameras) {
  for (int k = 0; k < cameras->count; k++) {
    free(cameras->camera[k].offers);
    free(cameras->camera[k].settings);
  }
  free(cameras->camera);
  *cameras = {};
}
