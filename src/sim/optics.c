#include "sim/optics.h"

/* Where a direction appears, and the derivatives of that: slope[i][j] = d seen_i / d direction_j. */
static void distort(const double distortion[CLT_DISTORTION], const double direction[2], double seen[2],
                    double slope[2][2]) {
  double k1 = distortion[0], k2 = distortion[1], p1 = distortion[2], p2 = distortion[3], k3 = distortion[4];
  double x = direction[0], y = direction[1], rr = x * x + y * y;
  double radial = 1.0 + rr * (k1 + rr * (k2 + rr * k3)), change = 2.0 * (k1 + rr * (2.0 * k2 + rr * 3.0 * k3));
  seen[0] = x * radial + 2.0 * p1 * x * y + p2 * (rr + 2.0 * x * x);
  seen[1] = y * radial + p1 * (rr + 2.0 * y * y) + 2.0 * p2 * x * y;
  slope[0][0] = radial + change * x * x + 2.0 * p1 * y + 6.0 * p2 * x;
  slope[0][1] = slope[1][0] = change * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
  slope[1][1] = radial + change * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
}

static bool is_plain(const double distortion[CLT_DISTORTION]) {
  bool plain = true;
  for (int k = 0; k < CLT_DISTORTION; k++) {
    plain = plain && distortion[k] == 0.0;
  }
  return plain;
}

void clt_optics_distort(const double distortion[CLT_DISTORTION], const double direction[2], double seen[2]) {
  double slope[2][2];
  distort(distortion, direction, seen, slope);
}

bool clt_optics_undistort(const double distortion[CLT_DISTORTION], const double seen[2], double direction[2]) {
  enum { STEPS = 30 };
  const double settled = 1e-13; /* of the last step, and of the direction */
  direction[0] = seen[0];
  direction[1] = seen[1];
  for (int step = 0; step < STEPS; step++) {
    double at[2], slope[2][2];
    distort(distortion, direction, at, slope);
    double determinant = slope[0][0] * slope[1][1] - slope[0][1] * slope[1][0];
    if (!(determinant > 0.0)) {
      return false;
    }
    double off[2] = {seen[0] - at[0], seen[1] - at[1]};
    double right = (slope[1][1] * off[0] - slope[0][1] * off[1]) / determinant;
    double down = (slope[0][0] * off[1] - slope[1][0] * off[0]) / determinant;
    direction[0] += right;
    direction[1] += down;
    if (hypot(right, down) <= settled * (1.0 + hypot(direction[0], direction[1]))) {
      return true;
    }
  }
  return false;
}

bool clt_optics_direction(const clt_pinhole *pinhole, const double distortion[CLT_DISTORTION], double x, double y,
                          clt_vector *direction) {
  if (is_plain(distortion)) {
    *direction = clt_pinhole_direction(pinhole, x, y);
    return true;
  }
  double seen[2] = {x * pinhole->tangent[0], -y * pinhole->tangent[1]}, straight[2];
  bool found = clt_optics_undistort(distortion, seen, straight);
  *direction = vec_along(pinhole->forward, straight[0], pinhole->right, -straight[1], pinhole->up);
  return found;
}

bool clt_optics_covers(const clt_pinhole *pinhole, const double distortion[CLT_DISTORTION], clt_vector at) {
  if (is_plain(distortion)) {
    return clt_pinhole_covers(pinhole, at);
  }
  const double same = 1e-9;
  clt_vector view = vec_sub(at, pinhole->position);
  double depth = vec_dot(view, pinhole->forward), seen[2], back[2];
  if (!(depth > 0.0)) {
    return false;
  }
  double straight[2] = {vec_dot(view, pinhole->right) / depth, -vec_dot(view, pinhole->up) / depth};
  clt_optics_distort(distortion, straight, seen);
  /* Far outside the law may fold a direction back into the image; the lens does not show it there. */
  return fabs(seen[0]) <= pinhole->tangent[0] && fabs(seen[1]) <= pinhole->tangent[1] &&
         clt_optics_undistort(distortion, seen, back) &&
         hypot(back[0] - straight[0], back[1] - straight[1]) <= same * (1.0 + hypot(straight[0], straight[1]));
}
