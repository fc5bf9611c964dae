#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>

#include "image/codecs.h"
#include "image/opencv_guard.hpp"

struct clt_video {
  std::string path;
  cv::VideoCapture capture;
  cv::Mat frame;
  int width, height;
};

namespace {

constexpr double usual_rate_hz = 25, highest_rate_hz = 1000;

// FFmpeg reads what it can; OpenCV's own decoder reads Motion JPEG where it has no FFmpeg.
bool open_file(clt_video *video) {
  clt_silence silence;
  return video->capture.open(video->path, cv::CAP_FFMPEG) || video->capture.open(video->path, cv::CAP_OPENCV_MJPEG);
}

clt_status open_first(clt_video *video, clt_error *error) {
  if (!open_file(video) || !video->capture.read(video->frame) || video->frame.type() != CV_8UC3) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: is no video that can be decoded; AVI with Motion JPEG is read everywhere, other kinds where "
                    "OpenCV has FFmpeg",
                    video->path.c_str());
  }
  return CLT_OK;
}

// Not every decoder seeks: the file is opened again.
clt_status rewind_video(clt_video *video, clt_error *error) {
  return clt_guarded(video->path.c_str(), "cannot be opened again", error, [&] {
    return open_file(video)
               ? CLT_OK
               : clt_fail(error, CLT_BAD_INPUT, "%s: cannot be opened again; is it there?", video->path.c_str());
  });
}

clt_status open_video(const char *path, clt_video **out, clt_video_info *info, clt_error *error) {
  return clt_guarded(path, "cannot be opened", error, [&] {
    auto video = std::make_unique<clt_video>();
    video->path = path;
    cv::setNumThreads(1); // to swap the colours of a frame takes less than to wake threads for it
    clt_status status = open_first(video.get(), error);
    if (status != CLT_OK) {
      return status;
    }
    double rate_hz = video->capture.get(cv::CAP_PROP_FPS);
    bool sane = std::isfinite(rate_hz) && rate_hz > 0 && rate_hz <= highest_rate_hz;
    video->width = video->frame.cols;
    video->height = video->frame.rows;
    *info = {video->width, video->height, sane ? rate_hz : usual_rate_hz};
    status = rewind_video(video.get(), error);
    *out = status == CLT_OK ? video.release() : nullptr;
    return status;
  });
}

void close_video(clt_video *video) {
  delete video;
}

clt_status read_frame(clt_video *video, const int rectangle[4], uint8_t *codes, bool *end, clt_error *error) {
  return clt_guarded(video->path.c_str(), "cannot be decoded", error, [&] {
    bool more = video->capture.read(video->frame);
    // A frame of another size, as a damaged file may have, ends the film as well.
    *end = !more || video->frame.cols != video->width || video->frame.rows != video->height;
    if (!*end) {
      cv::Mat wanted(rectangle[3], rectangle[2], CV_8UC3, codes);
      cv::cvtColor(video->frame(cv::Rect(rectangle[0], rectangle[1], rectangle[2], rectangle[3])), wanted,
                   cv::COLOR_BGR2RGB);
    }
    return CLT_OK;
  });
}

} // namespace

extern "C" const clt_video_codecs clt_module_videos = {open_video, close_video, read_frame, rewind_video};
