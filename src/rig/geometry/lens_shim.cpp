/* calib3d for C: chessboards, distortion, fundamental matrices and calibration files. */
#include "rig/geometry/lens.h"

#include <cmath>
#include <new>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <vector>

namespace {

/* Runs work with every exception caught. */
template <typename Work> clt_status guarded(const char *what, clt_status blame, clt_error *error, Work work) {
  try {
    return work();
  } catch (const std::bad_alloc &) {
    return clt_fail(error, CLT_FAILED, "%s: memory is short", what);
  } catch (const cv::Exception &exception) {
    return clt_fail(error, blame, "%s: %s", what, exception.err.c_str());
  } catch (const std::exception &exception) {
    return clt_fail(error, blame, "%s: %s", what, exception.what());
  } catch (...) {
    return clt_fail(error, CLT_FAILED, "%s for an unknown reason", what);
  }
}

cv::Matx33d matrix_of(const clt_lens &lens) {
  return {lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1};
}

/* The photograph as eight bits of perceived grey, in which corners look as they do to an eye. */
cv::Mat grey_of(const clt_image &photograph) {
  cv::Mat grey(photograph.height, photograph.width, CV_8U);
  size_t plane = grey.total();
  for (size_t i = 0; i < plane; i++) {
    float light = 0;
    for (int c = 0; c < photograph.channels; c++) {
      light += photograph.data[static_cast<size_t>(c) * plane + i] / static_cast<float>(photograph.channels);
    }
    grey.data[i] = cv::saturate_cast<uchar>(255 * std::sqrt(std::fmax(light, 0.0F)));
  }
  return grey;
}

/* Reads a node's matrix of so many values. */
bool take(const cv::FileStorage &file, const char *name, int count, double *values) {
  cv::Mat matrix;
  file[name] >> matrix;
  if (static_cast<int>(matrix.total()) != count || matrix.channels() != 1) {
    return false;
  }
  matrix.convertTo(matrix, CV_64F);
  for (int k = 0; k < count; k++) {
    values[k] = matrix.at<double>(k / matrix.cols, k % matrix.cols);
    if (!std::isfinite(values[k])) {
      return false;
    }
  }
  return true;
}

bool take_lens(const cv::FileStorage &file, const char *intrinsics, const char *distortion, clt_lens *lens) {
  double k[9];
  if (!take(file, intrinsics, 9, k) || !take(file, distortion, 5, lens->distortion)) {
    return false;
  }
  lens->fx = k[0], lens->cx = k[2], lens->fy = k[4], lens->cy = k[5];
  return lens->fx > 0 && lens->fy > 0;
}

} // namespace

clt_status clt_lens_calibrate(const clt_image *photographs, int count, int columns, int rows, clt_lens *lens,
                              clt_lens_report *report, clt_error *error) {
  *report = clt_lens_report{};
  return guarded("calibrating the lens", CLT_BAD_INPUT, error, [&] {
    std::vector<std::vector<cv::Point2f>> seen;
    std::vector<cv::Point3f> board;
    for (int k = 0; k < columns * rows; k++) {
      board.emplace_back(static_cast<float>(k % columns), static_cast<float>(k / columns), 0.0F);
    }
    for (int n = 0; n < count; n++) {
      std::vector<cv::Point2f> corners;
      if (cv::findChessboardCornersSB(grey_of(photographs[n]), {columns, rows}, corners, cv::CALIB_CB_ACCURACY)) {
        seen.push_back(corners);
      }
    }
    report->found = static_cast<int>(seen.size());
    if (report->found < CLT_CHESSBOARDS_LEAST) {
      return clt_fail(
          error, CLT_BAD_INPUT,
          "the chessboard of %d x %d inner corners is whole in %d of %d photographs; take at least %d, with "
          "the board sharp, evenly lit and tilted differently in each",
          columns, rows, report->found, count, CLT_CHESSBOARDS_LEAST);
    }
    cv::Mat intrinsics, distortion;
    std::vector<cv::Mat> turns, shifts;
    report->reprojection =
        cv::calibrateCamera(std::vector<std::vector<cv::Point3f>>(seen.size(), board), seen,
                            {photographs[0].width, photographs[0].height}, intrinsics, distortion, turns, shifts);
    *lens = {intrinsics.at<double>(0, 0),
             intrinsics.at<double>(1, 1),
             intrinsics.at<double>(0, 2),
             intrinsics.at<double>(1, 2),
             {}};
    for (int k = 0; k < 5; k++) {
      lens->distortion[k] = distortion.at<double>(k);
    }
    return CLT_OK;
  });
}

clt_status clt_stereo_read(const char *path, clt_stereo *stereo, clt_error *error) {
  return guarded(path, CLT_BAD_INPUT, error, [&] {
    cv::FileStorage file;
    if (!file.open(path, cv::FileStorage::READ)) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be read as a calibration; give OpenCV's YAML, XML or JSON",
                      path);
    }
    if (!take_lens(file, "cam_K", "cam_kc", &stereo->camera) ||
        !take_lens(file, "pro_K", "pro_kc", &stereo->projector) || !take(file, "R", 9, stereo->rotation) ||
        !take(file, "T", 3, stereo->translation)) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "%s: is no calibration of a camera and a projector; it must hold cam_K, cam_kc, pro_K, pro_kc "
                      "(3 x 3 and 5 numbers), R and T",
                      path);
    }
    return CLT_OK;
  });
}

clt_status clt_lens_undistort(const clt_lens *lens, double *xy, size_t count, clt_error *error) {
  return guarded("undistorting", CLT_FAILED, error, [&] {
    if (count == 0) {
      return CLT_OK;
    }
    cv::Mat points(static_cast<int>(count), 1, CV_64FC2, xy), out;
    cv::Mat distortion(5, 1, CV_64F, const_cast<double *>(lens->distortion));
    /* The usual five iterations leave tenths of a pixel where the distortion is strong. */
    cv::undistortPoints(points, out, matrix_of(*lens), distortion, cv::noArray(), cv::noArray(),
                        {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 60, 1e-9});
    out.copyTo(points);
    return CLT_OK;
  });
}

clt_status clt_fundamental_fit(const double *a, const double *b, size_t count, double fundamental[9],
                               clt_error *error) {
  return guarded("fitting the fundamental matrix", CLT_FAILED, error, [&] {
    cv::Mat from(static_cast<int>(count), 1, CV_64FC2, const_cast<double *>(a));
    cv::Mat to(static_cast<int>(count), 1, CV_64FC2, const_cast<double *>(b));
    cv::Mat found = cv::findFundamentalMat(from, to, cv::USAC_MAGSAC, 3.0, 0.999, 2000);
    if (found.rows != 3 || found.cols != 3) {
      return clt_fail(error, CLT_FAILED, "no fundamental matrix fits the %zu decoded pixels", count);
    }
    for (int k = 0; k < 9; k++) {
      fundamental[k] = found.at<double>(k / 3, k % 3);
    }
    return CLT_OK;
  });
}
