#include <dirent.h>
#include <sys/stat.h>

#include "base/file.h"
#include "counterlight/image.h"
#include "support.h"

static char folder[64];

static int make_folder(void **state) {
  (void)state;
  test_folder(folder);
  return 0;
}

/* Fails where a test left a file, a temporary one included. */
static int remove_folder(void **state) {
  (void)state;
  return rmdir(folder);
}

static const char *in_folder(const char *name) {
  static char path[CLT_PATH_MAX];
  assert_int_equal(clt_file_join(folder, name, path, NULL), CLT_OK);
  return path;
}

static clt_image random_image(int channels, int height, int width, double low, double high) {
  clt_image image;
  clt_error error = {0};
  uint64_t seed = 9;
  assert_ok(clt_image_init(&image, channels, height, width, &error), error);
  for (size_t i = 0; i < clt_image_size(&image); i++) {
    image.data[i] = (float)(low + (high - low) * test_random(&seed));
  }
  return image;
}

/* Writes, reads back into *back, removes the file. */
static void there_and_back(const char *name, const clt_curve *curve, const clt_image *image, clt_image *back) {
  clt_error error = {0};
  const char *path = in_folder(name);
  assert_ok(clt_image_write(path, curve, image, &error), error);
  assert_ok(clt_image_read(path, curve, back, &error), error);
  assert_int_equal(unlink(path), 0);
  assert_int_equal(back->channels, image->channels);
  assert_int_equal(back->height, image->height);
  assert_int_equal(back->width, image->width);
}

static void linear_files_keep_every_bit(void **state) {
  (void)state;
  static const char *const names[] = {"a.exr", "a.npy", "B.NPY", "c.d.EXR"};
  for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
    for (int channels = 1; channels <= 3; channels += 2) {
      clt_image image = random_image(channels, 11, 19, -10, 1000), back;
      there_and_back(names[k], NULL, &image, &back);
      assert_memory_equal(back.data, image.data, clt_image_size(&image) * sizeof(float));
      clt_image_finish(&image);
      clt_image_finish(&back);
      assert_true(clt_image_path_is_linear(names[k]));
    }
  }
  assert_false(clt_image_path_is_linear("npy") || clt_image_path_is_linear("a.npy/b.png"));
  assert_false(clt_image_path_is_linear("a.JPG") || clt_image_path_is_linear(""));
}

static void a_png_keeps_every_code_value(void **state) {
  (void)state;
  static const char *const texts[] = {"srgb", "linear", "gamma 2.2", "gamma 5", "gamma 0.2"};
  for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
    clt_curve curve;
    clt_error error = {0};
    clt_image image, back;
    assert_ok(clt_curve_parse(texts[k], &curve, &error), error);
    assert_ok(clt_image_init(&image, 3, 16, 16, &error), error);
    for (int i = 0; i < 768; i++) {
      image.data[i] = (float)clt_curve_decode(&curve, (i * 7 % 256) / 255.0);
    }
    there_and_back("a.png", &curve, &image, &back);
    assert_memory_equal(back.data, image.data, 768 * sizeof(float));
    clt_image_finish(&back);
    clt_image_finish(&image);
  }
}

static void a_png_rounds_to_the_nearest_code_and_clips(void **state) {
  (void)state;
  clt_image image = random_image(1, 30, 40, -0.2, 1.2), back;
  const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  there_and_back("a.png", NULL, &image, &back);
  for (size_t i = 0; i < clt_image_size(&image); i++) {
    double l = fmin(1, fmax(0, image.data[i]));
    double code = 255 * (l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055);
    assert_near(clt_curve_encode(&srgb, back.data[i]) * 255, code, 0.5 + 1e-4);
  }
  clt_image_finish(&back);
  clt_image_finish(&image);
}

static void a_jpeg_is_near(void **state) {
  (void)state;
  static const char *const names[] = {"a.jpg", "a.jpeg"};
  for (size_t k = 0; k < 2; k++) {
    clt_error error = {0};
    clt_image image, back;
    assert_ok(clt_image_init(&image, 3, 32, 32, &error), error);
    for (int i = 0; i < 1024; i++) { /* red ramp, green flat, blue the other ramp: a swap of channels shows */
      image.data[i] = (float)(i % 32) / 31;
      image.data[1024 + i] = 0.5F;
      image.data[2048 + i] = (float)(i / 32) / 31;
    }
    there_and_back(names[k], NULL, &image, &back);
    const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
    double square = 0;
    for (int i = 0; i < 3072; i++) {
      double off = 255 * (clt_curve_encode(&srgb, back.data[i]) - clt_curve_encode(&srgb, image.data[i]));
      square += off * off / 3072;
    }
    assert_true(sqrt(square) < 5);
    clt_image_finish(&back);
    clt_image_finish(&image);
  }
}

static void what_cannot_be_written_is_said_and_nothing_is_lost(void **state) {
  (void)state;
  clt_image four = random_image(4, 3, 3, 0, 1), one = random_image(1, 3, 3, 0, 1), empty = {0}, back;
  clt_error error = {0};
  static const char *const endings[] = {".png", ".jpg", ".exr", ".npy"};
  for (size_t k = 0; k < 4; k++) {
    char nowhere[64], name[16];
    snprintf(nowhere, sizeof nowhere, "/no/such/folder/a%s", endings[k]);
    assert_int_equal(clt_image_write(nowhere, NULL, &one, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "/no/such/folder"));
    snprintf(name, sizeof name, "a%s", endings[k]);
    const char *path = in_folder(name);
    assert_int_equal(mkdir(path, 0700), 0); /* a folder of this name is kept, no temporary file stays */
    assert_int_not_equal(clt_image_write(path, NULL, &one, &error), CLT_OK);
    assert_int_equal(rmdir(path), 0);
    assert_int_equal(clt_image_write(path, NULL, &empty, &error), CLT_BAD_INPUT);
    if (k < 3) {
      assert_ok(clt_image_write(path, NULL, &one, &error), error);
      assert_int_equal(clt_image_write(path, NULL, &four, &error), CLT_BAD_INPUT);
      assert_non_null(strstr(error.message, "4"));
      assert_ok(clt_image_read(path, NULL, &back, &error), error); /* the earlier picture is still there */
      assert_int_equal(back.channels, 1);
      clt_image_finish(&back);
      unlink(path);
    }
  }
  assert_int_equal(clt_image_write(in_folder("a.gif"), NULL, &one, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_image_write(in_folder("noending"), NULL, &one, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_image_write(in_folder(".png/x"), NULL, &one, &error), CLT_BAD_INPUT);
  clt_image_finish(&four);
  clt_image_finish(&one);
}

static void four_channels_travel_as_npy(void **state) {
  (void)state;
  clt_image image = random_image(4, 3, 5, -1, 1), back;
  there_and_back("a.npy", NULL, &image, &back);
  assert_memory_equal(back.data, image.data, clt_image_size(&image) * sizeof(float));
  clt_image_finish(&image);
  clt_image_finish(&back);
}

static void what_is_no_file_is_refused(void **state) {
  (void)state;
  static const char *const names[] = {"a.png", "a.jpg", "a.exr", "a.npy"};
  for (size_t k = 0; k < 4; k++) {
    clt_error error = {0};
    clt_image image;
    const char *path = in_folder(names[k]);
    assert_int_equal(clt_image_read(path, NULL, &image, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, path));
    assert_null(image.data);
    assert_int_equal(mkdir(path, 0700), 0);
    assert_int_equal(clt_image_read(path, NULL, &image, &error), CLT_BAD_INPUT);
    rmdir(path);
    assert_int_equal(mkfifo(path, 0600), 0); /* must not wait for a writer */
    assert_int_equal(clt_image_read(path, NULL, &image, &error), CLT_BAD_INPUT);
    unlink(path);
    assert_int_equal(clt_image_read(path, NULL, &image, NULL), CLT_BAD_INPUT); /* nobody asks for the message */
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(linear_files_keep_every_bit),
      cmocka_unit_test(a_png_keeps_every_code_value),
      cmocka_unit_test(a_png_rounds_to_the_nearest_code_and_clips),
      cmocka_unit_test(a_jpeg_is_near),
      cmocka_unit_test(what_cannot_be_written_is_said_and_nothing_is_lost),
      cmocka_unit_test(four_channels_travel_as_npy),
      cmocka_unit_test(what_is_no_file_is_refused),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
