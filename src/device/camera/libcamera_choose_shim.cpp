/* Which stream of a camera of libcamera is taken: role, format and size. */
#include <libcamera/stream.h>

#include "device/camera/libcamera_formats.h"
#include "device/camera/libcamera_shared.hpp"

namespace {

using clt::Failure;
using libcamera::Camera;
using libcamera::CameraConfiguration;
using libcamera::ColorSpace;
using libcamera::PixelFormat;
using libcamera::StreamConfiguration;

struct Choice {
  std::unique_ptr<CameraConfiguration> configuration;
  PixelFormat format;
  clt_libcamera_format read = {};
};

/* The best format of the stream's that is read and asked for. */
void consider(std::unique_ptr<CameraConfiguration> configuration, bool raw, const std::string &wanted, Choice *best,
              std::string *offers) {
  PixelFormat format;
  clt_libcamera_format read = best->read;
  for (const PixelFormat &listed : configuration->at(0).formats().pixelformats()) {
    PixelFormat offer = raw ? clt::unpacked(*configuration, listed) : listed;
    clt_libcamera_format one = clt_libcamera_format_find(offer.fourcc(), offer.modifier());
    if (one.code == 0) {
      continue;
    }
    std::string name = one.name;
    if (offers->find(name) == std::string::npos) {
      *offers += (offers->empty() ? "" : ", ") + name;
    }
    if ((wanted == "auto" || wanted == name) && one.rank > read.rank) {
      format = offer;
      read = one;
    }
  }
  if (format.isValid()) {
    *best = {std::move(configuration), format, read};
  }
}

Choice choose_format(Camera &camera, const std::string &wanted) {
  Choice best;
  std::string offers;
  for (libcamera::StreamRole role : clt::roles) {
    std::unique_ptr<CameraConfiguration> configuration = camera.generateConfiguration({role});
    if (configuration != nullptr && !configuration->empty()) {
      consider(std::move(configuration), role == libcamera::StreamRole::Raw, wanted, &best, &offers);
    }
  }
  if (best.configuration == nullptr) {
    throw Failure{CLT_BAD_INPUT, "camera \"" + camera.id() + "\" offers no format " + wanted +
                                     " that is read; there are: " + (offers.empty() ? "none" : offers)};
  }
  return best;
}

std::string size_name(const libcamera::Size &size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

/* Y'CbCr without a word about it is that of a webcam: BT.601, and limited. */
void agree_colours(const StreamConfiguration &stream, clt_libcamera_stream *agreed) {
  agreed->ycbcr = 601;
  agreed->limited = true;
  if (stream.colorSpace && stream.colorSpace->ycbcrEncoding != ColorSpace::YcbcrEncoding::None) {
    agreed->ycbcr = stream.colorSpace->ycbcrEncoding == ColorSpace::YcbcrEncoding::Rec709    ? 709
                    : stream.colorSpace->ycbcrEncoding == ColorSpace::YcbcrEncoding::Rec2020 ? 2020
                                                                                             : 601;
    agreed->limited = stream.colorSpace->range == ColorSpace::Range::Limited;
  }
}

} // namespace

namespace clt {

PixelFormat unpacked(CameraConfiguration &configuration, const PixelFormat &offer) {
  StreamConfiguration &stream = configuration.at(0);
  const libcamera::Size size = stream.size;
  stream.pixelFormat = PixelFormat(offer.fourcc());
  bool taken = configuration.validate() != CameraConfiguration::Invalid;
  stream.size = size;
  return taken ? stream.pixelFormat : PixelFormat();
}

std::unique_ptr<CameraConfiguration> choose(Camera &camera, const clt_camera_config &config, unsigned buffers,
                                            clt_libcamera_stream *agreed) {
  Choice choice = choose_format(camera, config.format[0] == '\0' ? "auto" : config.format);
  StreamConfiguration &stream = choice.configuration->at(0);
  stream.pixelFormat = choice.format;
  if (config.width > 0) {
    stream.size = {static_cast<unsigned>(config.width), static_cast<unsigned>(config.height)};
  }
  libcamera::Size wanted = stream.size;
  stream.bufferCount = buffers;
  CameraConfiguration::Status status = choice.configuration->validate();
  if (status == CameraConfiguration::Invalid || stream.pixelFormat != choice.format) {
    throw Failure{CLT_BAD_INPUT, "camera \"" + camera.id() + "\" cannot be set to " + choice.read.name +
                                     " alone; choose another `format`"};
  }
  if (config.width > 0 && stream.size != wanted) {
    throw Failure{CLT_BAD_INPUT, "camera \"" + camera.id() + "\" does not take " + size_name(wanted) + " pixels as " +
                                     choice.read.name + "; the nearest that it takes is " + size_name(stream.size)};
  }
  agreed->code = choice.read.code;
  agreed->width = static_cast<int>(stream.size.width);
  agreed->height = static_cast<int>(stream.size.height);
  agree_colours(stream, agreed);
  return std::move(choice.configuration);
}

} // namespace clt
