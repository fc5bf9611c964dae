/* What the shims of libcamera share, in C++: the manager, the settings of a camera, and the guard against exceptions.
 */
#ifndef CLT_DEVICE_CAMERA_LIBCAMERA_SHARED_HPP
#define CLT_DEVICE_CAMERA_LIBCAMERA_SHARED_HPP

#include <libcamera/camera.h>
#include <libcamera/camera_manager.h>
#include <libcamera/control_ids.h>
#include <libcamera/controls.h>
#include <libcamera/request.h>
#include <libcamera/version.h>

#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "device/camera/libcamera_shim.h"

#define CLT_LIBCAMERA_AT_LEAST(major, minor)                                                                           \
  (LIBCAMERA_VERSION_MAJOR > (major) || (LIBCAMERA_VERSION_MAJOR == (major) && LIBCAMERA_VERSION_MINOR >= (minor)))

namespace clt {

/* A failure on its way out of C++. */
struct Failure {
  clt_status status;
  std::string message;
};

/* Runs a body that throws a Failure, or what libcamera and the standard library throw. */
template <typename Body> clt_status guarded(clt_error *error, Body body) {
  try {
    body();
    return CLT_OK;
  } catch (const Failure &failure) {
    return clt_fail(error, failure.status, "%s", failure.message.c_str());
  } catch (const std::exception &exception) {
    return clt_fail(error, CLT_FAILED, "libcamera: %s", exception.what());
  } catch (...) {
    return clt_fail(error, CLT_FAILED, "libcamera failed for an unknown reason");
  }
}

/* One use of the process's camera manager, which is there as long as anybody uses it. Throws a Failure. */
class Manager {
public:
  Manager();
  ~Manager();
  Manager(const Manager &) = delete;
  Manager &operator=(const Manager &) = delete;
  std::vector<std::shared_ptr<libcamera::Camera>> cameras() const;
};

/* The streams that are tried, in this order. */
extern const libcamera::StreamRole roles[4];

/* What becomes of a raw format when it is asked for: handlers may list a mosaic only packed but give it unpacked as
 * well, and its order is turned with the picture. Not valid where nothing comes of it. Changes the stream. */
libcamera::PixelFormat unpacked(libcamera::CameraConfiguration &configuration, const libcamera::PixelFormat &offer);

/* The configuration of one stream as config says, of so many buffers, validated; fills what is agreed on the picture.
 */
std::unique_ptr<libcamera::CameraConfiguration> choose(libcamera::Camera &camera, const clt_camera_config &config,
                                                       unsigned buffers, clt_libcamera_stream *agreed);

/* The sensor's or the device's name; empty where libcamera knows none. */
std::string model_of(const libcamera::Camera &camera);

/* Settings go out with requests, one stage after the other: what is automatic first, then the values. */
using Stages = std::deque<libcamera::ControlList>;

/* Whether the camera changes its picture by itself through this control. */
bool is_automatic(unsigned id);
/* A control's value as a number (a truth value as 0 or 1); 0 for what is none. */
double number_of(const libcamera::ControlValue &value);
/* Fills the stream's range and first exposure. */
void read_exposure_range(const libcamera::Camera &camera, clt_libcamera_stream *stream);
/* Automatic off, then the values; a value that the camera cannot take throws a Failure. */
Stages make_stages(const libcamera::Camera &camera, const clt_camera_config &config,
                   const clt_libcamera_stream &stream);
libcamera::ControlList make_exposure(const libcamera::Camera &camera, double seconds);
/* What the camera tells of a finished request. */
void read_metadata(libcamera::Request &request, clt_libcamera_picture *picture);

} // namespace clt
#endif
