/* libcamera where there is no camera: its formats against DRM's own words on them, and that looking for cameras leaves
 * nothing behind. What needs a camera is done in the guest (libcamera_probe.c). */
#include <dirent.h>

#include "device/camera/libcamera.h"
#include "device/camera/libcamera_formats.h"
#include "device/camera/libcamera_list.h"
#include "device/camera/pixels.h"
#include "support.h"

/* A word of a pixel, its components from the highest bit to the lowest as drm_fourcc.h writes them. */
typedef struct word {
  const char *drm, *order;
  int bits; /* of a component */
} word;

static const word words[] = {{"RG24", "RGB", 8},  {"BG24", "BGR", 8},  {"XR24", "xRGB", 8}, {"XB24", "xBGR", 8},
                             {"RX24", "RGBx", 8}, {"BX24", "BGRx", 8}, {"AR24", "xRGB", 8}, {"AB24", "xBGR", 8},
                             {"RA24", "RGBx", 8}, {"BA24", "BGRx", 8}};
enum { WORDS = sizeof words / sizeof words[0], SIDE = 2, BYTES = 64 };

static const clt_pixel_format *find(const char *drm) {
  clt_libcamera_format found = clt_libcamera_format_find(clt_pixels_code(drm), 0);
  if (found.code == 0) {
    fail_msg("%s has no decoder", drm);
  }
  return clt_pixels_find(found.code);
}

static void decode(const clt_pixel_format *format, size_t pixel_bytes, const uint8_t *bytes, uint16_t *samples) {
  clt_picture_layout layout = {
      .width = SIDE, .height = SIDE, .stride = SIDE * pixel_bytes, .size = SIDE * SIDE * pixel_bytes};
  clt_error error = {0};
  assert_int_equal(format->decode(format, &layout, bytes, layout.size, samples, &error), CLT_OK);
}

static void words_are_decoded(void **state) {
  (void)state;
  uint64_t random = 5;
  for (int k = 0; k < WORDS; k++) {
    size_t parts = strlen(words[k].order);
    uint8_t bytes[BYTES] = {0};
    uint16_t samples[3 * SIDE * SIDE], expected[3 * SIDE * SIDE];
    for (size_t at = 0; at < (size_t)SIDE * SIDE * parts; at++) {
      /* little-endian: the component of the lowest bits comes first */
      const char *place = strchr("RGB", words[k].order[parts - 1 - at % parts]);
      bytes[at] = (uint8_t)(test_random(&random) * 255);
      if (place != NULL) {
        expected[3 * (at / parts) + (size_t)(*place == 'R' ? 0 : *place == 'G' ? 1 : 2)] = bytes[at];
      }
    }
    decode(find(words[k].drm), parts, bytes, samples);
    assert_memory_equal(samples, expected, sizeof expected);
  }
}

/* The two rows of a filter, from left to right: what lies at each of the four pixels. */
static void filters_are_decoded(void **state) {
  (void)state;
  static const struct {
    const char *drm, *filter;
    size_t bytes;
  } filters[] = {{"RGGB", "RGGB", 1}, {"GRBG", "GRBG", 1}, {"GBRG", "GBRG", 1}, {"BA81", "BGGR", 1},
                 {"RG10", "RGGB", 2}, {"BA10", "GRBG", 2}, {"GB10", "GBRG", 2}, {"BG10", "BGGR", 2},
                 {"RG12", "RGGB", 2}, {"BA12", "GRBG", 2}, {"GB12", "GBRG", 2}, {"BG12", "BGGR", 2}};
  for (size_t k = 0; k < sizeof filters / sizeof filters[0]; k++) {
    uint8_t bytes[BYTES] = {0};
    uint16_t samples[3];
    for (size_t p = 0; p < 4; p++) {
      char colour = filters[k].filter[p];
      bytes[p * filters[k].bytes] = colour == 'R' ? 200 : colour == 'G' ? 100 : 50;
    }
    const clt_pixel_format *format = find(filters[k].drm);
    decode(format, filters[k].bytes, bytes, samples);
    for (int c = 0; c < 3; c++) { /* two bits more than the camera's */
      double full = ldexp(1, format->bits) - 1, sent = ldexp(1, format->depth) - 1;
      assert_float_equal(samples[c] / full, (c == 0 ? 200 : c == 1 ? 100 : 50) / sent, 1 / full);
    }
  }
}

static void grey_is_as_deep_as_it_is_called(void **state) {
  (void)state;
  assert_int_equal(find("R8  ")->depth, 8);
  assert_int_equal(find("R10 ")->depth, 10);
  assert_int_equal(find("R12 ")->depth, 12);
  assert_int_equal(find("R8  ")->channels, 1);
}

/* Packed ones and RGB565, whose code means a filter to Video4Linux. */
static void others_are_told_apart(void **state) {
  (void)state;
  uint64_t csi2_packed = UINT64_C(11) << 56 | 1;
  assert_int_equal(clt_libcamera_format_find(clt_pixels_code("RG10"), csi2_packed).code, 0);
  assert_int_equal(find("RG16")->depth, 5);
  assert_true(clt_libcamera_format_find(clt_pixels_code("RG12"), 0).rank >
              clt_libcamera_format_find(clt_pixels_code("RG10"), 0).rank);
  assert_true(clt_libcamera_format_find(clt_pixels_code("YUYV"), 0).rank >
              clt_libcamera_format_find(clt_pixels_code("MJPG"), 0).rank);
}

static int count_entries(const char *folder) {
  int count = 0;
  DIR *directory = opendir(folder);
  while (readdir(directory) != NULL) {
    count++;
  }
  closedir(directory);
  return count;
}

static void looking_leaves_nothing_behind(void **state) {
  (void)state;
  static const clt_camera_config config = {.device = "no such camera", .format = "auto", .gain = -1, .focus = -1};
  int descriptors = 0, threads = 0;
  for (int k = 0; k < 10; k++) {
    clt_libcamera_cameras cameras;
    clt_camera *camera = NULL;
    clt_error error = {0};
    assert_int_equal(clt_libcamera_list(&cameras, &error), CLT_OK);
    clt_libcamera_cameras_finish(&cameras);
    assert_int_equal(clt_libcamera_camera_open(&config, &camera, &error), CLT_GONE);
    assert_null(camera);
    assert_non_null(strstr(error.message, "no such camera"));
    descriptors = k == 0 ? count_entries("/proc/self/fd") : descriptors;
    threads = k == 0 ? count_entries("/proc/self/task") : threads;
  }
  assert_int_equal(count_entries("/proc/self/fd"), descriptors);
  assert_int_equal(count_entries("/proc/self/task"), threads);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(words_are_decoded), cmocka_unit_test(filters_are_decoded),
                                     cmocka_unit_test(grey_is_as_deep_as_it_is_called),
                                     cmocka_unit_test(others_are_told_apart),
                                     cmocka_unit_test(looking_leaves_nothing_behind)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
