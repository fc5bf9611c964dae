/* The decoder against panels seen by a simulated camera, whose true places are known. */
#include "rig/geometry/decode.h"
#include "rig/geometry/regions.h"
#include "structured.h"

typedef struct outcome {
  clt_pixel_map map;
  clt_decode_report report;
  clt_regions regions;
  double median, p99;  /* distance of decoded pixels within the panel from their true place, panel pixels */
  long decoded, wrong; /* more than 2 panel pixels and 1.5 camera pixels off */
} outcome;

static int compare(const void *left, const void *right) {
  double a = *(const double *)left, b = *(const double *)right;
  return (a > b) - (a < b);
}

/* Decodes a scene; distances from the nearer of both places where a mirror shows two. */
static outcome decode_scene(const seen_scene *s) {
  outcome out = {0};
  clt_pairs pairs;
  clt_error error = {0};
  uint8_t *detail = calloc(SEEN_PIXELS, 1);
  double *off = calloc(SEEN_PIXELS, sizeof *off);
  long inside = 0;
  seen_take(s, &pairs);
  assert_ok(clt_decode(&pairs, &out.map, detail, &out.report, &error), error);
  assert_ok(clt_regions_find(&out.map, detail, 100, &out.regions, &error), error);
  for (int i = 0; i < SEEN_PIXELS; i++) {
    if (out.map.fate[i] == CLT_PIXEL_DECODED) {
      double x, y;
      seen_place(s, i % SEEN_WIDTH, i / SEEN_WIDTH, false, &x, &y);
      double distance = hypot(out.map.x[i] - x, out.map.y[i] - y);
      out.wrong += distance > fmax(2, 1.5 * s->pitch);
      out.decoded++;
      if (x > 0 && y > 0 && x < PANEL_WIDTH && y < PANEL_HEIGHT) { /* beyond, the border's blurred light is seen */
        off[inside++] = distance;
      }
      assert_true(out.map.confidence[i] > 0 && out.map.confidence[i] <= 1);
    } else {
      assert_true(isnan(out.map.x[i]) && isnan(out.map.y[i]) && out.map.confidence[i] == 0);
    }
  }
  qsort(off, (size_t)inside, sizeof *off, compare);
  out.median = inside > 0 ? off[inside / 2] : INFINITY;
  out.p99 = inside > 0 ? off[inside * 99 / 100] : INFINITY;
  free(off);
  free(detail);
  clt_pairs_finish(&pairs);
  return out;
}

/* Pixels whose place is at least `margin` inside the panel. */
static long pixels_inside(const seen_scene *s, double margin) {
  long inside = 0;
  for (int i = 0; i < SEEN_PIXELS; i++) {
    double x, y;
    seen_place(s, i % SEEN_WIDTH, i / SEEN_WIDTH, false, &x, &y);
    inside += x > margin && y > margin && x < PANEL_WIDTH - margin && y < PANEL_HEIGHT - margin &&
              !seen_shadowed(s, i % SEEN_WIDTH);
  }
  return inside;
}

/* Cameras finer than the panel and coarser, sharp and soft, of several kinds. The panel's pixels are
 * resolved but by the last two of these: a blur of 3 pixels leaves nothing of the finest bit and 6 % of the next. */
static void places_are_found_to_a_tenth_of_a_pixel(void **state) {
  (void)state;
  static const struct {
    double pitch, blur, median, p99;
    int bits, channels;
    bool srgb;
  } cases[] = {{0.35, 0.3, 0.05, 0.3, 12, 1, false}, {0.7, 0.2, 0.05, 0.3, 12, 1, false},
               {0.7, 0.5, 0.05, 0.3, 12, 3, false},  {0.7, 1.5, 0.05, 0.3, 12, 1, false},
               {0.7, 0.6, 0.05, 0.3, 8, 3, true},    {1.0, 0.7, 0.05, 0.3, 12, 1, false},
               {0.5, 3.0, 0.2, 0.4, 12, 1, false},   {2.2, 0.7, 0.15, 0.6, 12, 1, false}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    seen_scene s = seen_wall(n + 1);
    s.pitch = cases[n].pitch;
    s.blur = cases[n].blur;
    s.bits = cases[n].bits;
    s.channels = cases[n].channels;
    s.srgb = cases[n].srgb;
    outcome out = decode_scene(&s);
    if (!(out.median < cases[n].median && out.p99 < cases[n].p99)) {
      fail_msg("pitch %g, blur %g: median %g, 99 %% %g panel pixels", s.pitch, s.blur, out.median, out.p99);
    }
    assert_int_equal(out.wrong, 0);
    assert_true((double)out.decoded > 0.95 * (double)pixels_inside(&s, 4 + 3 * s.blur));
    assert_near(out.report.pitch, s.pitch, 0.1 * s.pitch);
    clt_pixel_map_finish(&out.map);
  }
}

/* A surface behind another one, a shadow, little light: nothing may be decoded to a place where it is not. */
static void edges_and_shadows_are_masked(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    seen_scene s = seen_wall(seed);
    s.step = 9.0 + 5 * (double)seed;
    s.shadow = 0.15;
    s.light = seed == 3 ? 0.1 : 0.6;
    s.electrons = seed == 3 ? 2000 : 10000;
    outcome out = decode_scene(&s);
    assert_true(out.median < 0.1);
    assert_true((double)out.wrong < 2e-3 * (double)out.decoded);
    assert_true((double)out.decoded > 0.9 * (double)pixels_inside(&s, 4));
    assert_true((double)out.report.count[CLT_PIXEL_UNLIT] >= 0.95 * 0.15 * SEEN_PIXELS);
    assert_true(out.regions.count > 0 && out.regions.region[0].fate == CLT_PIXEL_UNLIT);
    assert_non_null(strstr(out.regions.region[0].text, "unlit"));
    clt_pixel_map_finish(&out.map);
  }
}

/* The lower half is lit from two places at nearly equal strength: no place is the right one. */
static void pixels_lit_from_two_places_are_masked(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    seen_scene s = seen_wall(seed);
    s.mirror = 0.8;
    s.light = 0.4;
    outcome out = decode_scene(&s);
    long lower = 0, doubled = 0;
    for (int i = SEEN_WIDTH * (SEEN_HEIGHT / 2 + 4); i < SEEN_PIXELS; i++) {
      lower += out.map.fate[i] == CLT_PIXEL_DECODED;
      doubled += out.map.fate[i] == CLT_PIXEL_DOUBLE;
    }
    assert_true((double)lower < 0.05 * SEEN_PIXELS / 2);
    assert_true(doubled > SEEN_PIXELS / 8);
    clt_pixel_map_finish(&out.map);
  }
}

/* A weak second light, as of a glossy wall, must not hurt. */
static void weak_light_from_elsewhere_is_borne(void **state) {
  (void)state;
  seen_scene s = seen_wall(5);
  s.mirror = 0.08;
  s.indirect = 1.0;
  s.light = 0.4;
  outcome out = decode_scene(&s);
  assert_true(out.median < 0.1);
  assert_true((double)out.decoded > 0.9 * (double)pixels_inside(&s, 4));
  clt_pixel_map_finish(&out.map);
}

static void overexposed_pixels_are_saturated(void **state) {
  (void)state;
  seen_scene s = seen_wall(6);
  s.light = 1.3;
  outcome out = decode_scene(&s);
  assert_true(out.report.count[CLT_PIXEL_SATURATED] > SEEN_PIXELS / 20);
  assert_int_equal(out.wrong, 0);
  for (int i = 0; i < SEEN_PIXELS; i++) {
    if (out.map.fate[i] == CLT_PIXEL_SATURATED) {
      assert_true(s.light * seen_albedo(i % SEEN_WIDTH, i / SEEN_WIDTH) * (1 + 0.5 * s.indirect) > 0.9);
    }
  }
  clt_pixel_map_finish(&out.map);
}

static void darkness_gives_an_empty_map(void **state) {
  (void)state;
  seen_scene s = seen_wall(7);
  s.shadow = 3;
  outcome out = decode_scene(&s);
  assert_int_equal(out.decoded, 0);
  assert_int_equal(out.report.count[CLT_PIXEL_UNLIT], SEEN_PIXELS);
  clt_pixel_map_finish(&out.map);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(places_are_found_to_a_tenth_of_a_pixel), cmocka_unit_test(edges_and_shadows_are_masked),
      cmocka_unit_test(pixels_lit_from_two_places_are_masked),  cmocka_unit_test(weak_light_from_elsewhere_is_borne),
      cmocka_unit_test(overexposed_pixels_are_saturated),       cmocka_unit_test(darkness_gives_an_empty_map),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
