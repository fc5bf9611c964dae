#include <climits>
#include <cstdlib>
#include <cstring>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "image/codecs.h"
#include "image/opencv_guard.hpp"

namespace {

/* Runs work in silence, with every exception caught. */
template <typename Work> clt_status guarded(const char *path, const char *what, clt_error *error, Work work) {
  return clt_guarded(path, what, error, [&] {
    clt_silence silence;
    return work();
  });
}

/* A matrix on the raster's own samples. */
cv::Mat borrow(const clt_raster *raster) {
  int depth = raster->depth == 8 ? CV_8U : raster->depth == 16 ? CV_16U : CV_32F;
  return cv::Mat(raster->height, raster->width, CV_MAKETYPE(depth, raster->channels), raster->samples);
}

/* OpenCV keeps colours as B, G, R. */
cv::Mat swapped(const cv::Mat &image) {
  if (image.channels() != 3) {
    return image;
  }
  cv::Mat out;
  cv::cvtColor(image, out, cv::COLOR_BGR2RGB);
  return out;
}

clt_status keep(const char *path, const cv::Mat &image, clt_raster *raster, clt_error *error) {
  int depth = image.depth() == CV_8U ? 8 : image.depth() == CV_16U ? 16 : image.depth() == CV_32F ? 32 : 0;
  if (image.empty() || depth == 0 || (image.channels() != 1 && image.channels() != 3)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be decoded: the file is damaged or of a kind that is not read",
                    path);
  }
  clt_raster out = {image.cols, image.rows, image.channels(), depth, nullptr};
  out.samples = std::malloc(image.total() * image.elemSize());
  if (out.samples == nullptr) {
    throw std::bad_alloc();
  }
  cv::Mat target = borrow(&out);
  swapped(image).copyTo(target);
  *raster = out;
  return CLT_OK;
}

clt_status decode(const char *path, const unsigned char *bytes, size_t size, bool grey, clt_raster *raster,
                  clt_error *error) {
  *raster = clt_raster{};
  if (size > INT_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is larger than 2 GiB; give a smaller picture", path);
  }
  return guarded(path, "cannot be decoded", error, [&] {
    cv::_InputArray input(bytes, static_cast<int>(size));
    return keep(path, cv::imdecode(input, cv::IMREAD_ANYDEPTH | (grey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_ANYCOLOR)),
                raster, error);
  });
}

clt_status encode(const char *path, const char *ending, const clt_raster *raster, unsigned char **bytes, size_t *size,
                  clt_error *error) {
  *bytes = nullptr;
  return guarded(path, "cannot be encoded", error, [&] {
    std::vector<unsigned char> encoded;
    if (!cv::imencode(ending, swapped(borrow(raster)), encoded, {cv::IMWRITE_JPEG_QUALITY, 95})) {
      return clt_fail(error, CLT_FAILED, "%s: cannot be encoded", path);
    }
    *bytes = static_cast<unsigned char *>(std::malloc(encoded.size()));
    if (*bytes == nullptr) {
      throw std::bad_alloc();
    }
    std::memcpy(*bytes, encoded.data(), encoded.size());
    *size = encoded.size();
    return CLT_OK;
  });
}

clt_status read_exr(const char *path, clt_raster *raster, clt_error *error) {
  *raster = clt_raster{};
  return guarded(path, "cannot be decoded", error, [&] {
    return keep(path, cv::imread(path, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR), raster, error);
  });
}

clt_status write_exr(const char *path, const clt_raster *raster, clt_error *error) {
  return guarded(path, "cannot be written", error, [&] {
    if (!cv::imwrite(path, swapped(borrow(raster)))) {
      return clt_fail(error, CLT_FAILED, "%s: cannot be written: the disk may be full", path);
    }
    return CLT_OK;
  });
}

} // namespace

extern "C" const clt_picture_codecs clt_module_pictures = {decode, encode, read_exr, write_exr};
