/* Lenses: pinhole with Brown's distortion, from photographs of a chessboard; and the pair of a camera and a projector.
 *
 * Coordinates are OpenCV's: the first pixel's centre is (0, 0). Distortion and calibration are OpenCV's (calib3d). */
#ifndef CLT_RIG_GEOMETRY_LENS_H
#define CLT_RIG_GEOMETRY_LENS_H

#include <stddef.h>

#include "counterlight/image.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A point (X, Y, Z) before the lens is seen at fx x' + cx, fy y' + cy, with x', y' the distorted X/Z, Y/Z:
 *   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), y' likewise. */
typedef struct clt_lens {
  double fx, fy, cx, cy;
  double distortion[5]; /* k1 k2 p1 p2 k3 */
} clt_lens;

/* A point c before the camera is R c + t before the projector. */
typedef struct clt_stereo {
  clt_lens camera, projector;
  double rotation[9]; /* row by row */
  double translation[3];
} clt_stereo;

enum { CLT_CHESSBOARDS_LEAST = 5, CLT_CHESSBOARDS_MAX = 64 };

/* What photographs of a chessboard tell of the lens that took them. */
typedef struct clt_lens_report {
  int found;           /* photographs with the whole board in them */
  double reprojection; /* rms distance of corners from where the lens puts them, pixels */
} clt_lens_report;

/* Intrinsics from photographs (of one size, 1 or 3 channels, linear) of a board of columns x rows inner corners in
 * different poses. CLT_BAD_INPUT where the board is found whole in fewer than CLT_CHESSBOARDS_LEAST of them. */
clt_status clt_lens_calibrate(const clt_image *photographs, int count, int columns, int rows, clt_lens *lens,
                              clt_lens_report *report, clt_error *error);

/* Reads a calibration as OpenCV's FileStorage holds it (YAML, XML or JSON): cam_K, cam_kc, pro_K, pro_kc, R, T.
 * CLT_BAD_INPUT where one is missing or of another shape. */
clt_status clt_stereo_read(const char *path, clt_stereo *stereo, clt_error *error);

/* x, y of count pixels (in place) to X/Z, Y/Z. */
clt_status clt_lens_undistort(const clt_lens *lens, double *xy, size_t count, clt_error *error);

/* The fundamental matrix (row by row) of b' F a = 0 that most of the count >= 8 pairs of points a, b (x, y each) meet,
 * distances in units of the points. CLT_FAILED where there is none. */
clt_status clt_fundamental_fit(const double *a, const double *b, size_t count, double fundamental[9], clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
