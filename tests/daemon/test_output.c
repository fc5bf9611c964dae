#include "daemon/measure.h"
#include "daemon/output.h"
#include "support.h"

/* Each pixel of the panel shows the code of the cell that covers it. */
static void cells_cover_their_pixels(void **state) {
  (void)state;
  clt_error error = {0};
  output_drive picture = {.panel = clt_panel_of_curve(&(clt_curve){.kind = CLT_CURVE_GAMMA, .gamma = 2.0})};
  assert_ok(clt_image_init(&picture.drive, 3, 2, 3, &error), error);
  for (int i = 0; i < 18; i++) {
    picture.drive.data[i] = (float)i / 17;
  }
  const clt_projector_info panel = {.width = 12, .height = 4, .channels = 3};
  float codes[3 * 4 * 12];
  output_encode(&picture, &panel, codes);
  for (int c = 0; c < 3; c++) {
    for (int y = 0; y < 4; y++) {
      for (int x = 0; x < 12; x++) {
        double light = (double)(c * 6 + y / 2 * 3 + x / 4) / 17;
        assert_near(codes[(c * 4 + y) * 12 + x], sqrt(light), 1e-6);
      }
    }
  }
  clt_image_finish(&picture.drive);
}

static void one_channel_lights_all_of_the_panel(void **state) {
  (void)state;
  clt_error error = {0};
  output_drive picture = {.panel = {.mixes = false}};
  assert_ok(clt_image_init(&picture.drive, 1, 1, 2, &error), error);
  picture.drive.data[0] = 0.25F, picture.drive.data[1] = 2;
  const clt_projector_info panel = {.width = 2, .height = 1, .channels = 3};
  float codes[6];
  output_encode(&picture, &panel, codes);
  for (int c = 0; c < 3; c++) {
    assert_near(codes[2 * c], 0.25, 1e-7);
    assert_near(codes[2 * c + 1], 1, 0); /* never above full drive */
  }
  clt_image_finish(&picture.drive);
}

/* ||y - target|| / ||target|| over lit, seen cells, against sums made here. */
static void verified_errors_are_those_of_lit_seen_cells(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image images[4];
  for (uint64_t seed = 1; seed <= 5; seed++) {
    uint64_t random = seed;
    double off = 0, all = 0;
    for (int k = 0; k < 4; k++) {
      assert_ok(clt_image_init(&images[k], 3, 5, 4, &error), error);
    }
    for (int i = 0; i < 60; i++) {
      double seen = test_random(&random), target = test_random(&random);
      bool lit = test_random(&random) < 0.8, valid = test_random(&random) < 0.9;
      images[0].data[i] = (float)seen;
      images[1].data[i] = valid ? 0.01F : INFINITY;
      images[2].data[i] = (float)target;
      images[3].data[i] = lit ? 1 : 0;
      off += lit && valid ? (seen - target) * (seen - target) : 0;
      all += lit && valid ? target * target : 0;
    }
    assert_near(measure_error(&images[0], &images[1], &images[2], &images[3]), sqrt(off / all), 1e-6);
    for (int k = 0; k < 4; k++) {
      clt_image_finish(&images[k]);
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(cells_cover_their_pixels),
      cmocka_unit_test(one_channel_lights_all_of_the_panel),
      cmocka_unit_test(verified_errors_are_those_of_lit_seen_cells),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
