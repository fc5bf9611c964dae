/* The one camera manager of the process. */
#include <iosfwd>
#include <libcamera/logging.h>
#include <libcamera/property_ids.h>
#include <stdlib.h>

#include <cstring>
#include <mutex>

#include "device/camera/libcamera_shared.hpp"

namespace {

/* libcamera ends a process that makes a second manager, and the manager keeps threads and descriptors: so there is one,
 * while anybody uses it. Never freed itself: a camera may be closed after the destructors of statics have run. */
struct Shared {
  std::mutex lock;
  int users = 0;
  std::unique_ptr<libcamera::CameraManager> manager;
};

Shared &shared() {
  static Shared *const only = new Shared;
  return *only;
}

void start(Shared *self) {
  if (getenv("LIBCAMERA_LOG_LEVELS") == nullptr) {
    libcamera::logSetTarget(libcamera::LoggingTargetNone); /* failures are reported here, once */
  }
  self->manager = std::make_unique<libcamera::CameraManager>();
  int problem = self->manager->start();
  if (problem != 0) {
    self->manager.reset();
    throw clt::Failure{CLT_FAILED, std::string("libcamera does not start: ") + strerror(-problem) +
                                       "; check that this user may open /dev/media*"};
  }
}

} // namespace

namespace clt {

const libcamera::StreamRole roles[4] = {libcamera::StreamRole::StillCapture, libcamera::StreamRole::Viewfinder,
                                        libcamera::StreamRole::VideoRecording, libcamera::StreamRole::Raw};

Manager::Manager() {
  std::lock_guard<std::mutex> held(shared().lock);
  if (shared().users == 0) {
    start(&shared());
  }
  shared().users++;
}

Manager::~Manager() {
  std::lock_guard<std::mutex> held(shared().lock);
  if (--shared().users == 0) {
    shared().manager->stop();
    shared().manager.reset();
  }
}

std::vector<std::shared_ptr<libcamera::Camera>> Manager::cameras() const {
  return shared().manager->cameras();
}

std::string model_of(const libcamera::Camera &camera) {
  return std::string(camera.properties().get(libcamera::properties::Model).value_or(""));
}

} // namespace clt
