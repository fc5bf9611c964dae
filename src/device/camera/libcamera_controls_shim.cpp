/* The controls of a camera of libcamera: what is automatic, what can be set, and what a finished request tells. */
#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "device/camera/libcamera_shared.hpp"

namespace {

namespace controls = libcamera::controls;
using libcamera::Camera;
using libcamera::ControlInfo;
using libcamera::ControlList;
using libcamera::ControlValue;

/* The exposure that is asked for first, before anybody has said one. */
constexpr double FIRST_EXPOSURE_S = 0.01;
/* UVC counts exposure in these, and libcamera's handler cuts off what is less. */
constexpr int32_t UVC_STEP_US = 100;
/* Black levels are told for this full scale. */
constexpr double BLACK_SCALE = 65535;

const ControlInfo *offered(const Camera &camera, const libcamera::ControlId &control) {
  auto found = camera.controls().find(control.id());
  return found == camera.controls().end() ? nullptr : &found->second;
}

[[noreturn]] void refuse(const Camera &camera, const std::string &what) {
  throw clt::Failure{CLT_BAD_INPUT, "camera \"" + camera.id() + "\": " + what};
}

const ControlInfo &needed(const Camera &camera, const libcamera::ControlId &control, const std::string &key) {
  const ControlInfo *info = offered(camera, control);
  if (info == nullptr) {
    refuse(camera,
           "libcamera offers no control " + control.name() + " of it; leave `" + key + "` out of the configuration");
  }
  return *info;
}

/* Sets a value that the configuration gives, once it is known to lie in the range. */
template <typename T>
void set_given(const Camera &camera, const libcamera::Control<T> &control, const std::string &key, double value,
               ControlList *list) {
  const ControlInfo &info = needed(camera, control, key);
  double least = clt::number_of(info.min()), most = clt::number_of(info.max());
  if (most > least && !(value >= least && value <= most)) {
    refuse(camera, "`" + key + "` is " + std::to_string(value) + "; legal is " + std::to_string(least) + " to " +
                       std::to_string(most));
  }
  list->set(control, static_cast<T>(value));
}

/* A control by which the camera changes its picture by itself, and the value that ends that. */
struct Automatic {
  const libcamera::ControlId &control;
  ControlValue off;
};

/* From 0.5 on the two modes decide, and AeEnable only stands for both. */
const std::vector<Automatic> &automatics() {
  static const std::vector<Automatic> all = {
#if CLT_LIBCAMERA_AT_LEAST(0, 5)
    {controls::ExposureTimeMode, int32_t{controls::ExposureTimeModeManual}},
    {controls::AnalogueGainMode, int32_t{controls::AnalogueGainModeManual}},
#endif
    {controls::AeEnable, false},
    {controls::AwbEnable, false},
    {controls::AfMode, int32_t{controls::AfModeManual}},
  };
  return all;
}

ControlList automatic_off(const Camera &camera) {
  ControlList list(camera.controls());
  for (const Automatic &automatic : automatics()) {
    if (offered(camera, automatic.control) != nullptr) {
      list.set(automatic.control.id(), automatic.off);
    }
  }
  return list;
}

/* No frame shorter than asked for; longer ones where the exposure needs it. */
void set_rate(const Camera &camera, double rate_hz, ControlList *list) {
  const ControlInfo &info = needed(camera, controls::FrameDurationLimits, "rate_hz");
  auto duration = static_cast<int64_t>(std::llround(1e6 / rate_hz));
  auto least = static_cast<int64_t>(clt::number_of(info.min())),
       most = static_cast<int64_t>(clt::number_of(info.max()));
  if (duration < least || duration > most) {
    refuse(camera, "`rate_hz` is " + std::to_string(rate_hz) + "; legal is " + std::to_string(1e6 / most) + " to " +
                       std::to_string(1e6 / least));
  }
  const std::array<int64_t, 2> limits = {duration, most};
  list->set(controls::FrameDurationLimits, libcamera::Span<const int64_t, 2>(limits));
}

} // namespace

namespace clt {

bool is_automatic(unsigned id) {
  const std::vector<Automatic> &all = automatics();
  return std::any_of(all.begin(), all.end(), [id](const Automatic &automatic) { return automatic.control.id() == id; });
}

double number_of(const ControlValue &value) {
  if (value.isArray() || value.isNone()) {
    return 0;
  }
  switch (value.type()) {
  case libcamera::ControlTypeBool:
    return value.get<bool>();
  case libcamera::ControlTypeByte:
    return value.get<uint8_t>();
  case libcamera::ControlTypeInteger32:
    return value.get<int32_t>();
  case libcamera::ControlTypeInteger64:
    return static_cast<double>(value.get<int64_t>());
  case libcamera::ControlTypeFloat:
    return value.get<float>();
  default:
    return 0;
  }
}

void read_exposure_range(const Camera &camera, clt_libcamera_stream *stream) {
  const ControlInfo *info = offered(camera, controls::ExposureTime);
  if (info == nullptr) {
    return;
  }
  auto least = static_cast<int32_t>(number_of(info->min())), most = static_cast<int32_t>(number_of(info->max()));
  stream->exposure_min_s = 1e-6 * std::max(least, 1);
  stream->exposure_max_s = 1e-6 * std::max(most, 1);
  bool uvc = least >= UVC_STEP_US && least % UVC_STEP_US == 0 && most % UVC_STEP_US == 0;
  stream->exposure_step_s = uvc ? 1e-6 * UVC_STEP_US : 0;
  stream->exposure_s = std::clamp(FIRST_EXPOSURE_S, stream->exposure_min_s, stream->exposure_max_s);
}

ControlList make_exposure(const Camera &camera, double seconds) {
  ControlList list(camera.controls());
  list.set(controls::ExposureTime, static_cast<int32_t>(std::lround(1e6 * seconds)));
  return list;
}

Stages make_stages(const Camera &camera, const clt_camera_config &config, const clt_libcamera_stream &stream) {
  ControlList values =
      stream.exposure_s > 0 ? make_exposure(camera, stream.exposure_s) : ControlList(camera.controls());
  if (config.gain >= 0) {
    set_given(camera, controls::AnalogueGain, "gain", config.gain, &values);
  }
  if (config.white_balance_k > 0) {
    set_given(camera, controls::ColourTemperature, "white_balance_k", config.white_balance_k, &values);
  }
  if (config.focus >= 0) {
    set_given(camera, controls::LensPosition, "focus", config.focus, &values);
  }
  if (config.rate_hz > 0) {
    set_rate(camera, config.rate_hz, &values);
  }
  return {automatic_off(camera), values};
}

void read_metadata(libcamera::Request &request, clt_libcamera_picture *picture) {
  const ControlList &told = request.metadata();
  auto exposure_us = told.get(controls::ExposureTime);
  auto gain = told.get(controls::AnalogueGain);
  auto read_ns = told.get(controls::SensorTimestamp);
  auto black = told.get(controls::SensorBlackLevels);
  picture->exposure_s = exposure_us ? 1e-6 * *exposure_us : -1;
  picture->gain = gain ? *gain : -1;
  picture->black_level = -1;
  if (black) {
    picture->black_level = ((*black)[0] + (*black)[1] + (*black)[2] + (*black)[3]) / (4 * BLACK_SCALE);
  }
  if (read_ns) {
    picture->stamp_ns = *read_ns;
  }
}

} // namespace clt
