// What the OpenCV shims share: no exception leaves them, and OpenCV keeps its messages to itself.
#ifndef CLT_IMAGE_OPENCV_GUARD_HPP
#define CLT_IMAGE_OPENCV_GUARD_HPP

#include <exception>
#include <iostream>
#include <mutex>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>

#include "counterlight/status.h"

/* While it lives, OpenCV neither logs nor prints: imread reports broken files through the log and, past its level, on
 * std::cerr. Both belong to the whole process, so one call at a time. */
class clt_silence {
public:
  clt_silence()
      : lock_(mutex()), level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)),
        buffer_(std::cerr.rdbuf(nullptr)) {
  }
  ~clt_silence() {
    std::cerr.rdbuf(buffer_);
    cv::utils::logging::setLogLevel(level_);
  }
  clt_silence(const clt_silence &) = delete;
  clt_silence &operator=(const clt_silence &) = delete;

private:
  static std::mutex &mutex() {
    static std::mutex one;
    return one;
  }
  std::lock_guard<std::mutex> lock_;
  cv::utils::logging::LogLevel level_;
  std::streambuf *buffer_;
};

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
