#include "rig/footprint.h"
#include "support.h"

/* Every camera pixel belongs to exactly the cell that lies over it. */
static void cells_share_out_the_camera(void **state) {
  (void)state;
  static const int cases[][4] = {{1, 1, 1, 1}, {4, 3, 4, 3}, {4, 3, 12, 9}, {5, 2, 35, 14}, {1, 3, 4, 12}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    int width = cases[n][0], camera_width = cases[n][2], camera_height = cases[n][3], k = camera_width / width;
    clt_footprints footprints = {0};
    clt_error error = {0};
    assert_ok(clt_footprints_align(width, cases[n][1], camera_width, camera_height, &footprints, &error), error);
    assert_int_equal(footprints.cells, width * cases[n][1]);
    assert_int_equal(footprints.start[footprints.cells], camera_width * camera_height);
    int seen[35 * 14] = {0};
    for (size_t i = 0; i < footprints.cells; i++) {
      assert_int_equal(footprints.start[i + 1] - footprints.start[i], k * k);
      for (int64_t p = footprints.start[i]; p < footprints.start[i + 1]; p++) {
        int x = footprints.pixel[p] % camera_width, y = footprints.pixel[p] / camera_width;
        assert_int_equal(y / k * width + x / k, i);
        seen[footprints.pixel[p]]++;
      }
    }
    for (int p = 0; p < camera_width * camera_height; p++) {
      assert_int_equal(seen[p], 1);
    }
    clt_footprints_finish(&footprints);
  }
}

static void sizes_that_do_not_fit_are_refused_with_both(void **state) {
  (void)state;
  static const int cases[][4] = {{4, 3, 13, 9}, {4, 3, 12, 6}, {4, 3, 3, 3}, {4, 3, 8, 9}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    clt_footprints footprints = {0};
    clt_error error = {0};
    assert_int_equal(clt_footprints_align(cases[n][0], cases[n][1], cases[n][2], cases[n][3], &footprints, &error),
                     CLT_BAD_INPUT);
    char camera[32];
    snprintf(camera, sizeof camera, "%d x %d pixels", cases[n][2], cases[n][3]);
    assert_non_null(strstr(error.message, camera));
    assert_non_null(strstr(error.message, "4 x 3 cells"));
    clt_footprints_finish(&footprints);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(cells_share_out_the_camera),
      cmocka_unit_test(sizes_that_do_not_fit_are_refused_with_both),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
