/* The geometry of a camera with pixels of its own: what its pixels see, by closed forms. */
#include "room.h"
#include "sim/view.h"

enum { WIDTH = 16, HEIGHT = 12, CELLS = WIDTH * HEIGHT };

/* Grid of WIDTH x HEIGHT cells seen by width x height pixels from the projector's place. */
static void describe_pixels(clt_scene_description *made, int width, int height, clt_vector position,
                            clt_vector target) {
  describe_view(made, WIDTH, HEIGHT, position, target);
  clt_camera_description *camera = &made->camera;
  camera->pinhole = made->projector.pinhole;
  camera->width = width;
  camera->height = height;
  camera->own_pixels = true;
  camera->cell_pixels = 1;
  camera->rays = 4;
}

static void place(clt_scene_description *made, clt_vector position, clt_vector target, double across, double down) {
  made->camera.placed = true;
  made->camera.pinhole = (clt_pinhole){.position = position, .tangent = {across, down}};
  assert_true(clt_pinhole_aim(&made->camera.pinhole, target, (clt_vector){0, 0, 1}));
}

static clt_visibility *trace_through(const clt_scene_description *made) {
  clt_visibility *visibility = NULL;
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_visibility_create(made->surfaces, made->surface_count, &visibility, &error), error);
  return visibility;
}

/* Walls at a right angle and a board before them: all that the projector's own place sees is lit, and where it lies in
 * the picture is where it lies in the image, wherever the surfaces are; with few surfaces and with so many that Embree
 * traces them. */
static void see_from_the_projector(int more) {
  clt_scene_description made;
  describe_pixels(&made, 70, 54, (clt_vector){0.06, -3.2, 0.03}, (clt_vector){0.02, 0, -0.01});
  add_surface(&made, (clt_vector){-2.25, -2.25, -2.3}, (clt_vector){2.25, 2.25, 0}, (clt_vector){0, 0, 4.6}, 0.7);
  add_surface(&made, (clt_vector){0, 0, -2.3}, (clt_vector){2.25, -2.25, 0}, (clt_vector){0, 0, 4.6}, 0.6);
  add_surface(&made, (clt_vector){-0.3, -1, -0.4}, (clt_vector){0.8, 0.1, 0}, (clt_vector){0, 0, 0.7}, 0.5);
  for (int k = 0; k < more; k++) {
    add_surface(&made, (clt_vector){-0.5 + 0.1 * k, -0.9, 0.5}, (clt_vector){0.1, 0, 0}, (clt_vector){0, 0, 0.2}, 0.5);
  }
  clt_visibility *visibility = trace_through(&made);
  uint64_t random = 5;
  for (int n = 0; n < 5000; n++) {
    double column = 70 * test_random(&random), row = 54 * test_random(&random);
    clt_sightline line = clt_sightline_trace(&made, visibility, column, row);
    assert_int_equal(line.fate, CLT_SIGHTLINE_LIT);
    assert_near(line.x, column / 70 * WIDTH, 1e-9);
    assert_near(line.y, row / 54 * HEIGHT, 1e-9);
  }
  clt_visibility_destroy(visibility);
  clt_scene_description_finish(&made);
}

static void at_the_projector(void **state) {
  (void)state;
  see_from_the_projector(0);
  see_from_the_projector(9);
}

/* Rows of the matrix that takes (x, z, 1) of the plane y = 0 to homogeneous image coordinates of a pinhole that looks
 * from `from` to `at`, up = z, in units of its image, left to right and top to bottom 0 to 1. */
static void plane_to_image(clt_vector from, clt_vector at, double across, double down, double m[3][3]) {
  double dx = at.x - from.x, dy = at.y - from.y, dz = at.z - from.z, far = sqrt(dx * dx + dy * dy + dz * dz);
  double f[3] = {dx / far, dy / far, dz / far}, level = hypot(f[0], f[1]);
  double r[3] = {f[1] / level, -f[0] / level, 0};
  double u[3] = {-f[0] * f[2] / level, -f[1] * f[2] / level, level};
  const double *axes[3] = {r, u, f};
  double rows[3][3];
  for (int k = 0; k < 3; k++) {
    rows[k][0] = axes[k][0];
    rows[k][1] = axes[k][2];
    rows[k][2] = -axes[k][0] * from.x - axes[k][1] * from.y - axes[k][2] * from.z;
  }
  for (int j = 0; j < 3; j++) {
    m[0][j] = 0.5 * (rows[2][j] + rows[0][j] / across);
    m[1][j] = 0.5 * (rows[2][j] - rows[1][j] / down);
    m[2][j] = rows[2][j];
  }
}

/* m^-1 up to a factor, which homogeneous coordinates do not mind: the adjugate. */
static void invert(double m[3][3], double out[3][3]) {
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
      out[i][j] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
    }
  }
}

static void apply(double m[3][3], const double x[3], double out[3]) {
  for (int i = 0; i < 3; i++) {
    out[i] = m[i][0] * x[0] + m[i][1] * x[1] + m[i][2] * x[2];
  }
}

/* Of a plane seen from aside the camera's pixels and the picture's cells are a homography apart. */
static void plane_from_aside(void **state) {
  (void)state;
  const clt_vector lens = {0.2, -3, 0.1}, aim = {0.1, 0, -0.1}, eyes[] = {{1.5, -2.0, 0.7}, {-2.2, -2.4, -1.0}};
  for (int n = 0; n < 2; n++) {
    clt_scene_description made;
    describe_pixels(&made, 64, 48, lens, aim);
    add_surface(&made, (clt_vector){-6, 0, -6}, (clt_vector){12, 0, 0}, (clt_vector){0, 0, 12}, 0.5);
    place(&made, eyes[n], (clt_vector){0, 0, 0}, 0.5, 0.36);
    clt_visibility *visibility = trace_through(&made);
    double image[3][3], back[3][3], picture[3][3];
    plane_to_image(eyes[n], (clt_vector){0, 0, 0}, 0.5, 0.36, image);
    plane_to_image(lens, aim, 0.44, 0.33, picture);
    invert(image, back);
    int lit = 0;
    for (int k = 0; k < 64 * 48; k++) {
      double pixel[3] = {(k % 64 + 0.5) / 64, (k / 64 + 0.5) / 48, 1}, place_on[3], seen[3];
      apply(back, pixel, place_on);
      apply(picture, place_on, seen);
      clt_sightline line = clt_sightline_trace(&made, visibility, k % 64 + 0.5, k / 64 + 0.5);
      double x = WIDTH * seen[0] / seen[2], y = HEIGHT * seen[1] / seen[2];
      bool inside = x > 0 && x < WIDTH && y > 0 && y < HEIGHT;
      assert_int_equal(line.fate, inside ? CLT_SIGHTLINE_LIT : CLT_SIGHTLINE_OUTSIDE);
      assert_near(line.x, x, 1e-9 * (1 + fabs(x)));
      assert_near(line.y, y, 1e-9 * (1 + fabs(y)));
      lit += inside;
    }
    assert_true(lit > 1000 && lit < 64 * 48);
    clt_visibility_destroy(visibility);
    clt_scene_description_finish(&made);
  }
}

/* OpenCV's documentation, written down once more: k1 k2 p1 p2 k3; x to the right, y down. */
static void opencv_distortion(const double k[5], double x, double y, double *u, double *v) {
  double r2 = x * x + y * y, r4 = pow(r2, 2), r6 = pow(r2, 3), radial = 1 + k[0] * r2 + k[1] * r4 + k[4] * r6;
  *u = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
  *v = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
}

static const double lenses[][5] = {{-0.12, 0.02, 0.0005, -0.0004, 0.0},
                                   {-0.35, 0.15, -0.002, 0.003, -0.03},
                                   {0.2, 0.05, 0.004, 0.0, 0.01},
                                   {0.0, 0.0, 0.01, -0.02, 0.0}};
enum { LENSES = sizeof lenses / sizeof lenses[0] };

static void distortion_is_undone(void **state) {
  (void)state;
  uint64_t random = 3;
  for (int n = 0; n < 4000; n++) {
    const double *k = lenses[n % LENSES];
    double x = 1.0 * test_random(&random) - 0.5, y = 0.8 * test_random(&random) - 0.4, seen[2], back[2];
    opencv_distortion(k, x, y, &seen[0], &seen[1]);
    assert_true(clt_optics_undistort(k, seen, back));
    assert_near(back[0], x, 1e-12);
    assert_near(back[1], y, 1e-12);
  }
  double beyond[2] = {0.9, 0.0}, none[2]; /* r (1 - r^2 / 2) is nowhere above 0.545 */
  assert_false(clt_optics_undistort((const double[5]){-0.5, 0, 0, 0, 0}, beyond, none));
}

/* A place of the wall, taken to the image by hand (down is against z: the camera is level), is what the pixel there
 * sees; and it is in the image just where that is inside it. */
static void distorted_image(void **state) {
  (void)state;
  const clt_vector eye = {0.8, -2.5, 0.2};
  uint64_t random = 9;
  for (int n = 0; n < LENSES; n++) {
    clt_scene_description made;
    describe_pixels(&made, 320, 240, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
    add_surface(&made, (clt_vector){-3, 0, -3}, (clt_vector){6, 0, 0}, (clt_vector){0, 0, 6}, 0.5);
    place(&made, eye, (clt_vector){0.8, 0, 0.2}, 0.45, 0.34);
    memcpy(made.camera.distortion, lenses[n], sizeof lenses[n]);
    clt_visibility *visibility = trace_through(&made);
    int inside = 0;
    for (int k = 0; k < 2000; k++) {
      clt_vector at = {0.8 + 3.2 * test_random(&random) - 1.6, 0, 0.2 + 2.4 * test_random(&random) - 1.2};
      double u, v;
      opencv_distortion(lenses[n], (at.x - eye.x) / 2.5, -(at.z - eye.z) / 2.5, &u, &v);
      bool covered = fabs(u) < 0.45 && fabs(v) < 0.34;
      assert_int_equal(clt_optics_covers(&made.camera.pinhole, made.camera.distortion, at), covered);
      if (covered) {
        clt_sightline line =
            clt_sightline_trace(&made, visibility, 320 * 0.5 * (1 + u / 0.45), 240 * 0.5 * (1 + v / 0.34));
        assert_near(line.x, WIDTH * 0.5 * (1 + at.x / (3 * 0.44)), 1e-9);
        assert_near(line.y, HEIGHT * 0.5 * (1 - at.z / (3 * 0.33)), 1e-9);
        inside++;
      }
    }
    assert_true(inside > 500 && inside < 1990);
    clt_visibility_destroy(visibility);
    clt_scene_description_finish(&made);
  }
}

/* A wall with a screen half way to the projector, and a camera before the screen: by similar triangles. */
static void describe_shadow(clt_scene_description *made) {
  describe_pixels(made, 100, 75, (clt_vector){0, -3, 0}, (clt_vector){0, 0, 0});
  add_surface(made, (clt_vector){-1.4, 0, -1.2}, (clt_vector){2.8, 0, 0}, (clt_vector){0, 0, 2.4}, 0.5);
  add_surface(made, (clt_vector){-0.2, -1.5, -0.15}, (clt_vector){0.4, 0, 0}, (clt_vector){0, 0, 0.3}, 0.0);
  place(made, (clt_vector){0.05, -1.4, 0.02}, (clt_vector){0.05, 0, 0.02}, 1.1, 0.9);
}

static clt_sightline_fate fate_by_hand(double column, double row) {
  double x = 0.05 + 1.4 * 1.1 * (2 * column / 100 - 1), z = 0.02 + 1.4 * 0.9 * (1 - 2 * row / 75);
  if (fabs(x) > 1.4 || fabs(z) > 1.2) {
    return CLT_SIGHTLINE_NOTHING;
  }
  if (fabs(x) > 3 * 0.44 || fabs(z) > 3 * 0.33) {
    return CLT_SIGHTLINE_OUTSIDE;
  }
  return fabs(x) < 2 * 0.2 && fabs(z) < 2 * 0.15 ? CLT_SIGHTLINE_SHADOWED : CLT_SIGHTLINE_LIT;
}

static void shadow_edges(void **state) {
  (void)state;
  clt_scene_description made;
  describe_shadow(&made);
  clt_visibility *visibility = trace_through(&made);
  int fates[CLT_SIGHTLINE_FATES] = {0};
  uint64_t random = 17;
  for (int k = 0; k < 20000; k++) {
    double column = 100 * test_random(&random), row = 75 * test_random(&random);
    clt_sightline_fate fate = clt_sightline_trace(&made, visibility, column, row).fate;
    assert_int_equal(fate, fate_by_hand(column, row));
    fates[fate]++;
  }
  for (int k = 0; k < CLT_SIGHTLINE_FATES; k++) {
    assert_true(fates[k] > 300);
  }
  clt_visibility_destroy(visibility);
  clt_scene_description_finish(&made);
}

/* The share of a pixel's rays that see cell `cell` lit, and that see fronts at all, ray by ray. */
static void shares_by_hand(int column, int row, double *lit, double *front) {
  memset(lit, 0, CELLS * sizeof *lit);
  *front = 0.0;
  for (int ray = 0; ray < 16; ray++) {
    double right = column + (ray % 4 + 0.5) / 4, down = row + (ray / 4 + 0.5) / 4;
    clt_sightline_fate fate = fate_by_hand(right, down);
    double x = 0.05 + 1.4 * 1.1 * (2 * right / 100 - 1), z = 0.02 + 1.4 * 0.9 * (1 - 2 * down / 75);
    if (fate == CLT_SIGHTLINE_LIT) {
      int i = (int)(WIDTH * 0.5 * (1 + x / (3 * 0.44))), j = (int)(HEIGHT * 0.5 * (1 - z / (3 * 0.33)));
      lit[j * WIDTH + i] += 1.0 / 16;
    }
    *front += fate != CLT_SIGHTLINE_NOTHING ? 1.0 / 16 : 0.0;
  }
}

/* Weights are the rays' shares, though most pixels are traced by their corners and middle only; those of a pixel add up
 * to its share of fronts. */
static void weights_are_shares(void **state) {
  (void)state;
  clt_scene_description made;
  clt_view view = {0};
  clt_error error = {.status = CLT_OK};
  describe_shadow(&made);
  assert_ok(clt_view_init(&view, &made, &error), error);
  double total = 0.0;
  int mixed = 0;
  for (int pixel = 0; pixel < 100 * 75; pixel++) {
    double lit[CELLS], front, sum = 0.0;
    shares_by_hand(pixel % 100, pixel / 100, lit, &front);
    for (int k = view.pixels.start[pixel]; k < view.pixels.start[pixel + 1]; k++) {
      int element = view.pixels.element[k];
      sum += view.pixels.weight[k];
      if (element < CELLS) {
        assert_near(view.pixels.weight[k], lit[element], 1e-12);
        lit[element] = 0.0;
      }
    }
    for (int cell = 0; cell < CELLS; cell++) {
      assert_near(lit[cell], 0.0, 0.0);
    }
    assert_near(sum, front, 1e-12);
    mixed += view.pixels.start[pixel + 1] - view.pixels.start[pixel] > 1;
    total += front;
  }
  assert_true(mixed > 500);
  const double *share = view.share;
  assert_near(share[0] + share[1] + share[2] + share[3], 1.0, 1e-12);
  assert_near(1.0 - share[CLT_SIGHTLINE_NOTHING], total / (100 * 75), 1e-12);
  clt_view_finish(&view);
  clt_scene_description_finish(&made);
}

/* Behind the screen the camera sees nothing of these cells. */
static bool hidden_by_hand(int cell) {
  return cell % WIDTH >= 6 && cell % WIDTH <= 9 && (cell / WIDTH == 5 || cell / WIDTH == 6);
}

static int distance_squared(int cell, int column, int row) {
  int right = cell % WIDTH - column, down = cell / WIDTH - row;
  return right * right + down * down;
}

static int clamped(double value, int count) {
  return (int)fmin(fmax(value, 0.0), count - 1);
}

/* What the projector does not light shows the light, without the projector's own, of a cell of its surface nearest to
 * where the place lies in the picture, or to where it would: none is nearer, by trying them all. */
static void unlit_borrows_from_the_nearest(void **state) {
  (void)state;
  clt_scene_description made;
  clt_view view = {0};
  clt_error error = {.status = CLT_OK};
  describe_shadow(&made);
  assert_ok(clt_view_init(&view, &made, &error), error);
  int shadowed = 0, outside = 0;
  for (int pixel = 0; pixel < 100 * 75; pixel++) {
    double column = pixel % 100 + 0.5, row = pixel / 100 + 0.5;
    int first = view.pixels.start[pixel], nearest = CELLS * CELLS;
    if (view.pixels.start[pixel + 1] != first + 1 || view.pixels.element[first] < CELLS) {
      continue;
    }
    int found = view.pixels.element[first] - CELLS;
    double x = 0.05 + 1.4 * 1.1 * (2 * column / 100 - 1), z = 0.02 + 1.4 * 0.9 * (1 - 2 * row / 75);
    int i = clamped(WIDTH * 0.5 * (1 + x / (3 * 0.44)), WIDTH),
        j = clamped(HEIGHT * 0.5 * (1 - z / (3 * 0.33)), HEIGHT);
    for (int cell = 0; cell < CELLS; cell++) {
      nearest = hidden_by_hand(cell) ? nearest : (int)fmin(nearest, distance_squared(cell, i, j));
    }
    assert_false(hidden_by_hand(found));
    assert_int_equal(distance_squared(found, i, j), nearest);
    shadowed += fate_by_hand(column, row) == CLT_SIGHTLINE_SHADOWED && nearest > 0;
    outside += fate_by_hand(column, row) == CLT_SIGHTLINE_OUTSIDE;
  }
  assert_true(shadowed > 100 && outside > 100);
  clt_view_finish(&view);
  clt_scene_description_finish(&made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(at_the_projector),
      cmocka_unit_test(plane_from_aside),
      cmocka_unit_test(distortion_is_undone),
      cmocka_unit_test(distorted_image),
      cmocka_unit_test(shadow_edges),
      cmocka_unit_test(weights_are_shares),
      cmocka_unit_test(unlit_borrows_from_the_nearest),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
