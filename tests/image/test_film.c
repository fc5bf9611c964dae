/* Films: what comes when, in which size, and that they begin again. argv[1]: make_film. */
#include "image/film.h"

#include <sys/stat.h>

#include "support.h"

static const char *make_film;
static char folder[64];

static const char *in_folder(const char *name) {
  static char path[4][128];
  static int turn;
  char *text = path[turn++ % 4];
  snprintf(text, 128, "%s/%s", folder, name);
  return text;
}

static void write_picture(const char *name, int width, int height, double level) {
  clt_image picture = {0};
  clt_error error = {0};
  assert_ok(clt_image_init(&picture, 3, height, width, &error), error);
  for (size_t i = 0; i < clt_image_size(&picture); i++) {
    picture.data[i] = (float)level;
  }
  assert_ok(clt_image_write(in_folder(name), NULL, &picture, &error), error);
  clt_image_finish(&picture);
}

static clt_film *open_film(const char *path, int width, int height) {
  clt_film *film = NULL;
  clt_error error = {0};
  clt_film_options options = {.width = width, .height = height, .picture_s = 2.5};
  assert_ok(clt_film_open(path, &options, &film, &error), error);
  return film;
}

static clt_film_frame next(clt_film *film, uint8_t *codes) {
  clt_film_frame frame = {0};
  clt_error error = {0};
  assert_ok(clt_film_next(film, codes, &frame, &error), error);
  assert_true((size_t)frame.width * (size_t)frame.height * 3 <= clt_film_bytes(film));
  return frame;
}

/* sRGB, IEC 61966-2-1. */
static double code_of(double light) {
  return 255 * (light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1 / 2.4) - 0.055);
}

static void a_picture_is_shown_for_ever(void **state) {
  (void)state;
  uint8_t codes[8 * 6 * 3];
  write_picture("one.png", 16, 12, 0.25);
  clt_film *film = open_film(in_folder("one.png"), 8, 6);
  clt_film_frame frame = next(film, codes);
  assert_int_equal(frame.width, 8);
  assert_int_equal(frame.height, 6);
  assert_true(isinf(frame.seconds));
  for (int i = 0; i < 8 * 6 * 3; i++) {
    assert_near(codes[i], code_of(0.25), 0.51);
  }
  clt_film_close(film);
  assert_false(clt_film_moves(in_folder("one.png")));
  unlink(in_folder("one.png"));
}

/* In the order of the names, without what is no picture or damaged, again and again; what goes away is left out. */
static void a_folder_is_shown_in_turn(void **state) {
  (void)state;
  uint8_t codes[8 * 6 * 3];
  assert_int_equal(mkdir(in_folder("show"), 0700), 0);
  const double levels[] = {0.1, 0.2, 0.4};
  write_picture("show/a.png", 8, 6, levels[0]);
  write_picture("show/b.npy", 20, 6, levels[1]);
  write_picture("show/c.png", 5, 9, levels[2]);
  FILE *file = fopen(in_folder("show/bad.png"), "w");
  fputs("no picture", file);
  fclose(file);
  clt_film *film = open_film(in_folder("show"), 8, 6);
  assert_true(clt_film_moves(in_folder("show")));
  for (int k = 0; k < 7; k++) {
    clt_film_frame frame = next(film, codes);
    assert_near(frame.seconds, 2.5, 0);
    assert_near(codes[0], code_of(levels[k % 3]), 0.51);
  }
  const char *const names[] = {"show/a.png", "show/b.npy", "show/c.png", "show/bad.png"};
  unlink(in_folder(names[1]));
  next(film, codes); /* c */
  for (int k = 0; k < 2; k++) {
    next(film, codes);
    assert_near(codes[0], code_of(levels[2 * k]), 0.51);
  }
  for (int k = 0; k < 4; k++) {
    unlink(in_folder(names[k]));
  }
  clt_error error = {0};
  clt_film_frame frame;
  assert_int_equal(clt_film_next(film, codes, &frame, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "nothing in it can be decoded"));
  clt_film_close(film);
  rmdir(in_folder("show"));
}

/* All frames of a video, then the first again; cropped to the panel's aspect and made smaller where it has more
 * pixels, by area means of light: against means over the larger frames made here. */
static void a_video_loops(void **state) {
  (void)state;
  enum { WIDE = 64, HIGH = 48, FRAMES = 50 };
  static uint8_t whole[2][WIDE * HIGH * 3], small[16 * 12 * 3], first[WIDE * HIGH * 3];
  char command[512];
  snprintf(command, sizeof command, "%s %s %d %d %d 24", make_film, in_folder("film.avi"), WIDE, HIGH, FRAMES);
  assert_int_equal(system(command), 0);
  clt_film *large = open_film(in_folder("film.avi"), 200, 150), *less = open_film(in_folder("film.avi"), 16, 12);
  assert_true(clt_film_moves(in_folder("film.avi")));
  int same = 0;
  for (int k = 0; k < 2 * FRAMES + 1; k++) {
    clt_film_frame frame = next(large, whole[k % 2]), reduced = next(less, small);
    assert_int_equal(frame.width, WIDE); /* not made larger */
    assert_int_equal(reduced.width, 16);
    assert_near(frame.seconds, 1.0 / 24, 1e-9);
    if (k == 0) {
      memcpy(first, whole[0], sizeof first);
    }
    assert_int_equal(memcmp(first, whole[k % 2], sizeof first) == 0, k % FRAMES == 0);
    same += k > 0 && memcmp(whole[0], whole[1], sizeof first) == 0;
    double mean = 0;
    for (int i = 0; i < 16; i++) {
      double v = whole[k % 2][((20 + i / 4) * WIDE + 24 + i % 4) * 3 + 1] / 255.0;
      mean += (v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4)) / 16;
    }
    assert_near(small[(5 * 16 + 6) * 3 + 1], code_of(mean), 0.51);
  }
  assert_int_equal(same, 0);
  clt_film_close(large);
  clt_film_close(less);
  clt_film *square = open_film(in_folder("film.avi"), 200, 200);
  clt_film_frame frame = next(square, whole[0]);
  assert_int_equal(frame.width, HIGH);
  assert_int_equal(frame.height, HIGH);
  assert_memory_equal(whole[0], first + (WIDE - HIGH) / 2 * 3, HIGH * 3);
  clt_film_close(square);
  clt_image poster = {0};
  clt_error error = {0};
  assert_ok(clt_film_poster(in_folder("film.avi"), &poster, &error), error);
  assert_int_equal(poster.width, WIDE);
  assert_near(code_of((double)poster.data[WIDE * HIGH + 7]), first[7 * 3 + 1], 0.01);
  clt_image_finish(&poster);
  unlink(in_folder("film.avi"));
}

/* A device that first gives a picture of the panel's size, then nothing once, then one that is larger and too wide. */
typedef struct device {
  int calls, closed;
  uint8_t small[6 * 4 * 3], large[18 * 8 * 3];
} device;

static clt_status next_of_device(void *self, const uint8_t **codes, int *width, int *height, clt_error *error) {
  device *from = self;
  bool large = from->calls++ > 1;
  *codes = large ? from->large : from->small;
  *width = large ? 18 : 6;
  *height = large ? 8 : 4;
  return from->calls == 2 ? clt_fail(error, CLT_TIMEOUT, "nothing comes") : CLT_OK;
}

static void close_device(void *self) {
  ((device *)self)->closed++;
}

/* Codes come as they were taken, whatever failed before; of a larger picture the middle that has the panel's aspect, in
 * means over 2 x 2 equal pixels. */
static void a_source_is_shown_as_it_comes(void **state) {
  (void)state;
  device from = {0};
  uint64_t seed = 3;
  for (size_t i = 0; i < sizeof from.small; i++) {
    from.small[i] = (uint8_t)(256 * test_random(&seed));
  }
  for (int y = 0; y < 8; y++) {
    for (int x = 0; x < 18 * 3; x++) {
      int column = x / 3 - 3;
      from.large[y * 18 * 3 + x] =
          column >= 0 && column < 12 ? from.small[(y / 2 * 6 + column / 2) * 3 + x % 3] : (uint8_t)(37 * x);
    }
  }
  clt_film_options options = {.width = 6, .height = 4, .picture_s = 1};
  clt_film *film = NULL;
  clt_film_frame frame;
  clt_error error = {0};
  uint8_t codes[6 * 4 * 3];
  assert_ok(clt_film_of_source(&(clt_film_source){&from, next_of_device, close_device}, &options, &film, &error),
            error);
  assert_int_equal(clt_film_bytes(film), sizeof codes);
  for (int k = 0; k < 3; k++) {
    memset(codes, 0, sizeof codes);
    clt_status status = clt_film_next(film, codes, &frame, &error);
    assert_int_equal(status, k == 1 ? CLT_TIMEOUT : CLT_OK);
    if (status == CLT_OK) {
      assert_int_equal(frame.width, 6);
      assert_int_equal(frame.height, 4);
      assert_near(frame.seconds, 0, 0);
      assert_memory_equal(codes, from.small, sizeof codes);
    }
  }
  clt_film_close(film);
  assert_int_equal(from.closed, 1);
}

static void what_is_no_film_is_refused(void **state) {
  (void)state;
  clt_film_options options = {.width = 8, .height = 6, .picture_s = 1};
  clt_film *film = NULL;
  clt_error error = {0};
  clt_image poster = {0};
  assert_int_equal(clt_film_open(in_folder("nothing.avi"), &options, &film, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "no video"));
  assert_int_equal(clt_film_poster(in_folder("nothing.avi"), &poster, &error), CLT_BAD_INPUT);
  assert_int_equal(mkdir(in_folder("empty"), 0700), 0);
  assert_int_equal(clt_film_open(in_folder("empty"), &options, &film, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "no pictures"));
  assert_int_equal(clt_film_poster(in_folder("empty"), &poster, &error), CLT_BAD_INPUT);
  rmdir(in_folder("empty"));
}

int main(int count, char **arguments) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_picture_is_shown_for_ever),
      cmocka_unit_test(a_folder_is_shown_in_turn),
      cmocka_unit_test(a_video_loops),
      cmocka_unit_test(a_source_is_shown_as_it_comes),
      cmocka_unit_test(what_is_no_film_is_refused),
  };
  if (count != 2) {
    return 2;
  }
  make_film = arguments[1];
  test_folder(folder);
  int failed = cmocka_run_group_tests(tests, NULL, NULL);
  rmdir(folder);
  return failed;
}
