/* Lenses from rendered chessboards, and epipolar distances of maps whose camera and projector are known. */
#include "rig/geometry/epipolar.h"
#include "support.h"

enum { WIDTH = 480, HEIGHT = 360, COLUMNS = 9, ROWS = 6, POSES = 7, RAYS = 9 };

static const clt_lens lens = {420, 424, 244.5, 177.25, {-0.21, 0.08, 0.001, -0.0015, 0}};

/* Pixel to X/Z, Y/Z by fixed-point iteration on Brown's model. */
static void undistort(const clt_lens *l, double px, double py, double *x, double *y) {
  double u = (px - l->cx) / l->fx, v = (py - l->cy) / l->fy;
  const double *k = l->distortion;
  *x = u;
  *y = v;
  for (int n = 0; n < 20; n++) {
    double r = *x * *x + *y * *y, s = 1 + r * (k[0] + r * (k[1] + r * k[4]));
    double dx = 2 * k[2] * *x * *y + k[3] * (r + 2 * *x * *x), dy = k[2] * (r + 2 * *y * *y) + 2 * k[3] * *x * *y;
    *x = (u - dx) / s;
    *y = (v - dy) / s;
  }
}

static void distort(const clt_lens *l, double x, double y, double *px, double *py) {
  const double *k = l->distortion;
  double r = x * x + y * y, s = 1 + r * (k[0] + r * (k[1] + r * k[4]));
  *px = l->fx * (x * s + 2 * k[2] * x * y + k[3] * (r + 2 * x * x)) + l->cx;
  *py = l->fy * (y * s + k[2] * (r + 2 * y * y) + 2 * k[3] * x * y) + l->cy;
}

/* Rotation about x by a, then about y by b. */
static void rotation(double a, double b, double r[9]) {
  const double all[9] = {cos(b),  sin(a) * sin(b), cos(a) * sin(b), 0, cos(a), -sin(a),
                         -sin(b), sin(a) * cos(b), cos(a) * cos(b)};
  memcpy(r, all, sizeof all);
}

/* Light of a board in its plane: squares of one unit, a white margin of one around them, grey beyond. */
static double board_light(double x, double y) {
  if (x < -2 || y < -2 || x > COLUMNS + 1 || y > ROWS + 1) {
    return 0.2;
  }
  bool margin = x < -1 || y < -1 || x > COLUMNS || y > ROWS;
  return margin || ((int)floor(x) + (int)floor(y)) % 2 != 0 ? 0.8 : 0.05;
}

/* Directions X/Z, Y/Z of 3 x 3 points of each pixel. */
static void cast_rays(double *ray) {
  for (int i = 0; i < WIDTH * HEIGHT; i++) {
    int column = i % WIDTH, row = i / WIDTH;
    for (int k = 0; k < RAYS; k++, ray += 2) {
      undistort(&lens, column + (k % 3 - 1) / 3.0, row + (k / 3 - 1) / 3.0, &ray[0], &ray[1]);
    }
  }
}

/* A photograph: the rays meet the board's plane. */
static void photograph(const double *ray, int pose, clt_image *out) {
  clt_error error = {0};
  double r[9];
  rotation(0.5 * sin(1.7 * pose), 0.5 * cos(2.3 * pose), r);
  const double t[3] = {-4 + sin(pose), -2.5 + 0.7 * cos(2 * pose), 13 + 2 * sin(1.1 * pose)};
  assert_ok(clt_image_init(out, 1, HEIGHT, WIDTH, &error), error);
  for (int i = 0; i < WIDTH * HEIGHT * RAYS; i++, ray += 2) {
    /* s (x, y, 1) meets R (X, Y, 0) + t where R^T (s d - t) has no third part. */
    double d3 = r[2] * ray[0] + r[5] * ray[1] + r[8], t3 = r[2] * t[0] + r[5] * t[1] + r[8] * t[2], s = t3 / d3;
    double p[3] = {s * ray[0] - t[0], s * ray[1] - t[1], s - t[2]};
    out->data[i / RAYS] +=
        (float)(board_light(r[0] * p[0] + r[3] * p[1] + r[6] * p[2], r[1] * p[0] + r[4] * p[1] + r[7] * p[2]) / RAYS);
  }
}

static void a_lens_is_found_from_chessboards(void **state) {
  (void)state;
  clt_image photographs[POSES] = {{0}};
  clt_lens found;
  clt_lens_report report;
  clt_error error = {0};
  double *ray = malloc(sizeof *ray * 2 * WIDTH * HEIGHT * RAYS);
  assert_non_null(ray);
  cast_rays(ray);
  for (int k = 0; k < POSES; k++) {
    photograph(ray, k, &photographs[k]);
  }
  free(ray);
  assert_ok(clt_lens_calibrate(photographs, POSES, COLUMNS, ROWS, &found, &report, &error), error);
  assert_true(report.found >= CLT_CHESSBOARDS_LEAST);
  assert_true(report.reprojection < 0.1);
  assert_near(found.fx, lens.fx, 0.005 * lens.fx);
  assert_near(found.fy, lens.fy, 0.005 * lens.fy);
  assert_near(found.cx, lens.cx, 2);
  assert_near(found.cy, lens.cy, 2);
  for (int i = 0; i < 100; i++) { /* where the two lenses put directions within the picture */
    double x, y, px = WIDTH * (0.1 + 0.08 * (i % 10)), py = HEIGHT * (0.1 + 0.08 * (double)(i / 10)), qx, qy;
    undistort(&lens, px, py, &x, &y);
    distort(&found, x, y, &qx, &qy);
    assert_near(hypot(qx - px, qy - py), 0, 3);
  }
  assert_int_equal(clt_lens_calibrate(photographs, 4, COLUMNS, ROWS, &found, &report, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "at least 5"));
  for (int k = 0; k < POSES; k++) {
    clt_image_finish(&photographs[k]);
  }
}

/* A map of a curved surface by exact geometry, panel coordinates off by a normal of deviation `noise` in y. */
static void make_map(const clt_stereo *stereo, double noise, clt_pixel_map *map) {
  clt_error error = {0};
  uint64_t random = 7;
  assert_ok(clt_pixel_map_init(map, 320, 240, 640, 400, &error), error);
  for (int i = 0; i < 320 * 240; i++) {
    double x, y, p[3], px, py;
    undistort(&stereo->camera, i % 320, i / 320, &x, &y);
    double z = 5 + sin(3 * x) + 0.7 * cos(5 * y);
    for (int k = 0; k < 3; k++) {
      const double *r = stereo->rotation + 3 * k;
      p[k] = z * (r[0] * x + r[1] * y + r[2]) + stereo->translation[k];
    }
    distort(&stereo->projector, p[0] / p[2], p[1] / p[2], &px, &py);
    double normal = sqrt(-2 * log(test_random(&random) + 1e-300)) * cos(2 * M_PI * test_random(&random));
    map->x[i] = (float)(px + 0.5);
    map->y[i] = (float)(py + 0.5 + noise * normal);
    map->confidence[i] = i % 2 == 0 ? 0.9F : 0.5F;
    map->fate[i] = CLT_PIXEL_DECODED;
  }
}

static void epipolar_distances_are_those_of_the_geometry(void **state) {
  (void)state;
  clt_stereo stereo = {.camera = {300, 302, 158, 121, {-0.2, 0.1, 0.001, 0.002, -0.01}},
                       .projector = {600, 610, 320, 300, {-0.05, 0.1, 0, 0, 0}},
                       .translation = {-1.2, 0.05, 0.1}};
  clt_pixel_map map;
  clt_epipolar epipolar;
  clt_error error = {0};
  rotation(0.03, 0.2, stereo.rotation);
  make_map(&stereo, 0, &map);
  assert_ok(clt_epipolar_check(&map, &stereo, NULL, &epipolar, &error), error);
  assert_int_equal(epipolar.count, 320 * 240);
  assert_true(epipolar.upper < 2e-3); /* float coordinates */
  clt_pixel_map_finish(&map);
  /* Lines are nearly along x: a panel pixel in y is nearly fy camera / fy projector camera pixels. */
  make_map(&stereo, 1, &map);
  assert_ok(clt_epipolar_check(&map, &stereo, NULL, &epipolar, &error), error);
  assert_near(epipolar.median, 0.6745 * 302 / 610, 0.05);
  assert_near(epipolar.upper, 1.645 * 302 / 610, 0.12);
  assert_int_equal(epipolar.sure, 320 * 120);
  clt_pixel_map_finish(&map);
}

static void without_a_calibration_the_map_is_checked_against_itself(void **state) {
  (void)state;
  clt_stereo stereo = {
      .camera = {300, 302, 158, 121, {0}}, .projector = {600, 610, 320, 300, {0}}, .translation = {-1.2, 0.05, 0.1}};
  clt_pixel_map map;
  clt_epipolar epipolar;
  clt_error error = {0};
  rotation(0.03, 0.2, stereo.rotation);
  make_map(&stereo, 0.5, &map);
  assert_ok(clt_epipolar_check(&map, NULL, NULL, &epipolar, &error), error);
  assert_true(epipolar.fitted);
  assert_near(epipolar.median, 0.5 * 0.6745 * 302 / 610, 0.03);
  for (int i = 50; i < 320 * 240; i++) {
    clt_pixel_map_mask(&map, (size_t)i, CLT_PIXEL_UNLIT);
  }
  assert_int_equal(clt_epipolar_check(&map, NULL, NULL, &epipolar, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "only 50"));
  clt_pixel_map_finish(&map);
}

/* A camera's lens that bends is no fault of the map, where it is known. */
static void a_known_lens_is_straightened_first(void **state) {
  (void)state;
  clt_stereo stereo = {.camera = {300, 302, 158, 121, {-0.2, 0.1, 0.001, 0.002, -0.01}},
                       .projector = {600, 610, 320, 300, {0}},
                       .translation = {-1.2, 0.05, 0.1}};
  clt_pixel_map map;
  clt_epipolar bent, straight;
  clt_error error = {0};
  rotation(0.03, 0.2, stereo.rotation);
  make_map(&stereo, 0, &map);
  assert_ok(clt_epipolar_check(&map, NULL, NULL, &bent, &error), error);
  assert_ok(clt_epipolar_check(&map, NULL, &stereo.camera, &straight, &error), error);
  assert_true(straight.fitted && straight.upper < 0.02 && bent.upper > 10 * straight.upper);
  clt_pixel_map_finish(&map);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_lens_is_found_from_chessboards),
      cmocka_unit_test(epipolar_distances_are_those_of_the_geometry),
      cmocka_unit_test(without_a_calibration_the_map_is_checked_against_itself),
      cmocka_unit_test(a_known_lens_is_straightened_first),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
