// What the OpenCV shims share: no exception leaves them.
#ifndef CLT_IMAGE_OPENCV_GUARD_HPP
#define CLT_IMAGE_OPENCV_GUARD_HPP

#include <exception>
#include <new>
#include <opencv2/core.hpp>

#include "counterlight/status.h"

// Runs work with every exception caught.
template <typename Work> clt_status clt_guarded(const char *path, const char *what, clt_error *error, Work work) {
  try {
    return work();
  } catch (const std::bad_alloc &) {
    return clt_fail(error, CLT_FAILED, "%s: %s: memory is short", path, what);
  } catch (const cv::Exception &exception) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s: %s", path, what, exception.err.c_str());
  } catch (const std::exception &exception) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s: %s", path, what, exception.what());
  } catch (...) {
    return clt_fail(error, CLT_FAILED, "%s: %s for an unknown reason", path, what);
  }
}

#endif
