/* Footprints of cells by decoded maps: where they lie, what is missing, what is seen twice; and weights in the merge.
 */
#include "rig/geometry/decode.h"
#include "rig/merge.h"
#include "structured.h"

/* The camera's place of a panel coordinate, by Newton's method on seen_place. */
static void camera_place(const seen_scene *s, double x, double y, double *u, double *v) {
  *u = SEEN_WIDTH / 2.0;
  *v = SEEN_HEIGHT / 2.0;
  for (int k = 0; k < 30; k++) {
    double p[3][2], h = 1e-3;
    seen_place(s, *u, *v, false, &p[0][0], &p[0][1]);
    seen_place(s, *u + h, *v, false, &p[1][0], &p[1][1]);
    seen_place(s, *u, *v + h, false, &p[2][0], &p[2][1]);
    double a = (p[1][0] - p[0][0]) / h, b = (p[2][0] - p[0][0]) / h, c = (p[1][1] - p[0][1]) / h,
           d = (p[2][1] - p[0][1]) / h, det = a * d - b * c, ex = x - p[0][0], ey = y - p[0][1];
    *u += (d * ex - b * ey) / det;
    *v += (a * ey - c * ex) / det;
  }
}

static void centroid_of(const clt_footprints *f, size_t cell, double *u, double *v) {
  double s = 0;
  *u = *v = 0;
  for (int64_t p = f->start[cell]; p < f->start[cell + 1]; p++) {
    s += f->weight[p];
    *u += (double)f->weight[p] * (f->pixel[p] % SEEN_WIDTH);
    *v += (double)f->weight[p] * (f->pixel[p] / SEEN_WIDTH);
  }
  *u /= s;
  *v /= s;
}

static void decode_scene(const seen_scene *s, clt_pixel_map *map, clt_decode_report *report) {
  clt_pairs pairs;
  clt_error error = {0};
  uint8_t *detail = calloc(SEEN_PIXELS, 1);
  seen_take(s, &pairs);
  assert_ok(clt_decode(&pairs, map, detail, report, &error), error);
  clt_pairs_finish(&pairs);
  free(detail);
}

static int compare(const void *left, const void *right) {
  double a = *(const double *)left, b = *(const double *)right;
  return (a > b) - (a < b);
}

/* Cells whose place lies well within both pictures. */
static bool well_inside(double u, double v, double margin) {
  return u > margin && v > margin && u < SEEN_WIDTH - 1 - margin && v < SEEN_HEIGHT - 1 - margin;
}

static void centroids_are_right_to_a_tenth_of_a_pixel(void **state) {
  (void)state;
  static const struct {
    double pitch;
    int across, down;
  } cases[] = {{0.4, 60, 50}, {0.7, 120, 75}, {0.7, 40, 25}, {1.0, 60, 50}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    seen_scene s = seen_wall(30 + n);
    clt_pixel_map map;
    clt_decode_report decoded;
    clt_footprints f;
    clt_footprint_report report;
    clt_error error = {0};
    s.pitch = cases[n].pitch;
    decode_scene(&s, &map, &decoded);
    assert_ok(clt_footprints_map(&map, decoded.pitch, cases[n].across, cases[n].down, &f, NULL, &report, &error),
              error);
    double across = (double)PANEL_WIDTH / cases[n].across, down = (double)PANEL_HEIGHT / cases[n].down;
    double *off = calloc(f.cells, sizeof *off);
    size_t count = 0;
    for (size_t i = 0; i < f.cells; i++) {
      double x = ((double)(i % (size_t)cases[n].across) + 0.5) * across, u, v, cu, cv;
      double y = ((double)(i / (size_t)cases[n].across) + 0.5) * down;
      camera_place(&s, x, y, &u, &v);
      bool inner = x > 2 + across && y > 2 + down && x < PANEL_WIDTH - across - 2 && y < PANEL_HEIGHT - down - 2;
      if (well_inside(u, v, 2 * across / s.pitch) && inner) {
        assert_true(f.start[i + 1] > f.start[i]);
        centroid_of(&f, i, &cu, &cv);
        off[count++] = hypot(cu - u, cv - v);
      }
    }
    qsort(off, count, sizeof *off, compare);
    assert_true(count > 100);
    assert_true(off[count / 2] < 0.05);
    assert_true(off[count * 99 / 100] < 0.1);
    free(off);
    clt_footprints_finish(&f);
    clt_pixel_map_finish(&map);
  }
}

static void cells_in_shadow_and_out_of_sight_have_no_pixels(void **state) {
  (void)state;
  enum { ACROSS = 30, DOWN = 25 };
  seen_scene s = seen_wall(40);
  clt_pixel_map map;
  clt_decode_report decoded;
  clt_footprints f;
  clt_footprint_report report;
  clt_error error = {0};
  uint8_t fate[ACROSS * DOWN];
  s.shadow = 0.2;
  s.turn = s.bend = s.tilt = 0;
  decode_scene(&s, &map, &decoded);
  assert_ok(clt_footprints_map(&map, decoded.pitch, ACROSS, DOWN, &f, fate, &report, &error), error);
  long unseen = 0;
  for (int i = 0; i < ACROSS * DOWN; i++) {
    double u, v, half = 4 / s.pitch; /* of a cell of 8 x 6 panel pixels */
    camera_place(&s, 8 * (i % ACROSS) + 4, 6 * (double)(i / ACROSS) + 3, &u, &v);
    bool gone = (seen_shadowed(&s, u - half - 2) && seen_shadowed(&s, u + half + 2)) || u + half < -3 ||
                u - half > SEEN_WIDTH + 2 || v + half < -3 || v - half > SEEN_HEIGHT + 2;
    bool there = well_inside(u, v, half) && !seen_shadowed(&s, u - half) && !seen_shadowed(&s, u) &&
                 !seen_shadowed(&s, u + half);
    assert_true(!gone || fate[i] == CLT_CELL_UNSEEN);
    assert_true(!there || fate[i] == CLT_CELL_SEEN);
    assert_int_equal(fate[i] == CLT_CELL_UNSEEN, f.start[i + 1] == f.start[i]);
    unseen += fate[i] == CLT_CELL_UNSEEN;
  }
  assert_int_equal(unseen, report.count[CLT_CELL_UNSEEN]);
  assert_true(unseen > 50);
  clt_footprints_finish(&f);
  clt_pixel_map_finish(&map);
}

/* A map by hand: the right third of the camera's picture shows the left third of the panel once more. */
static void cells_seen_twice_are_found(void **state) {
  (void)state;
  enum { WIDTH = 90, HEIGHT = 40, ACROSS = 30, DOWN = 20 };
  clt_pixel_map map;
  clt_footprints f;
  clt_footprint_report report;
  clt_error error = {0};
  uint8_t fate[ACROSS * DOWN];
  assert_ok(clt_pixel_map_init(&map, WIDTH, HEIGHT, 60, 40, &error), error);
  for (int i = 0; i < WIDTH * HEIGHT; i++) {
    int u = i % WIDTH;
    map.x[i] = (float)(u < 60 ? u : u - 60) + 0.5F;
    map.y[i] = (float)(i / WIDTH) + 0.5F;
    map.confidence[i] = 1;
    map.fate[i] = CLT_PIXEL_DECODED;
  }
  assert_ok(clt_footprints_map(&map, 1, ACROSS, DOWN, &f, fate, &report, &error), error);
  for (int i = 0; i < ACROSS * DOWN; i++) {
    assert_int_equal(fate[i], i % ACROSS < 15 ? CLT_CELL_DOUBLE : CLT_CELL_SEEN);
  }
  assert_int_equal(report.count[CLT_CELL_DOUBLE], 15 * DOWN);
  clt_footprints_finish(&f);
  assert_int_equal(clt_footprints_map(&map, 1, 7, 5, &f, fate, &report, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "7 x 5"));
  clt_pixel_map_finish(&map);
}

/* Rows of unequal weights: the merged radiance is the weighted mean, and its variance that of one. */
static void the_merge_weighs_pixels(void **state) {
  (void)state;
  enum { PIXELS = 5, FULL = 4095 };
  static const uint16_t samples[PIXELS] = {400, 1000, 2000, 4095, 3000};
  int64_t start[3] = {0, 3, 5};
  int32_t pixel[PIXELS] = {2, 0, 1, 3, 4};
  float weight[PIXELS] = {0.5F, 1, 0.25F, 0.1F, 1}, values[4];
  const clt_footprints f = {.cells = 2, .start = start, .pixel = pixel, .weight = weight};
  const clt_camera_info sensor = {
      .width = PIXELS, .height = 1, .channels = 1, .bits = 12, .responsivity = 2, .full_well = 5000, .read_noise = 3};
  clt_image radiance = {1, 1, 2, values}, deviation = {1, 1, 2, values + 2};
  clt_curve linear = {.kind = CLT_CURVE_LINEAR};
  clt_merge merge;
  clt_error error = {0};
  assert_ok(clt_merge_init(&merge, &sensor, &linear, &f, 1, &error), error);
  const clt_frame frame = {PIXELS, 1, 1, 12, samples, 0, 0.1, 0};
  clt_merge_add(&merge, 0, &frame);
  clt_merge_radiance(&merge, &radiance, &deviation);
  double mean = (0.5 * 2000 + 1 * 400 + 0.25 * 1000) / 1.75 / FULL, alike = 1.75 * 1.75 / (0.25 + 1 + 0.0625);
  assert_near(radiance.data[0], mean / 0.1 / 2, 1e-6);
  double variance = (mean / 5000 + pow(3.0 / 5000, 2) + 1.0 / FULL / FULL / 12) / alike;
  assert_near(deviation.data[0], sqrt(variance) / 0.1 / 2, 1e-6);
  assert_near(radiance.data[1], 3000.0 / FULL / 0.1 / 2, 2e-6); /* without the saturated pixel */
  clt_merge_finish(&merge);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(centroids_are_right_to_a_tenth_of_a_pixel),
      cmocka_unit_test(cells_in_shadow_and_out_of_sight_have_no_pixels),
      cmocka_unit_test(cells_seen_twice_are_found),
      cmocka_unit_test(the_merge_weighs_pixels),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
