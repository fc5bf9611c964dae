/* Video inputs as content. argv[1]: a node of vivid that shows its colour bars, where there is one. */
#include "daemon/input.h"

#include <time.h>

#include "daemon/player.h"
#include "support.h"

static const char missing[] = "/dev/counterlight-no-such-input";
static const char *bars;

/* It is content whether it is there or not; a grey picture stands for it. */
static void an_input_may_be_missing(void **state) {
  (void)state;
  clt_error error = {0};
  clt_image poster = {0};
  assert_true(input_is(missing) && !input_is("/srv/dev/film.avi"));
  assert_true(clt_film_moves(missing));
  assert_ok(input_poster(missing, &poster, &error), error);
  for (size_t k = 0; k < clt_image_size(&poster); k++) {
    assert_near(poster.data[k], 0.18, 1e-6);
  }
  clt_image_finish(&poster);
  clt_film_options options = {.width = 16, .height = 12, .picture_s = 1};
  clt_film *film = NULL;
  clt_film_frame frame;
  uint8_t codes[16 * 12 * 3];
  assert_ok(input_film(missing, &options, &film, &error), error);
  assert_true(clt_film_bytes(film) <= sizeof codes);
  for (int k = 0; k < 2; k++) {
    assert_int_equal(clt_film_next(film, codes, &frame, &error), CLT_GONE);
    assert_non_null(strstr(error.message, "counterlight-no-such-input"));
  }
  clt_film_close(film);
}

static void a_player_says_what_it_waits_for(void **state) {
  (void)state;
  clt_film_options options = {.width = 16, .height = 12, .picture_s = 1};
  clt_error error = {0};
  player *playing = NULL;
  player_frame frame = {0};
  int skipped = 0;
  assert_ok(player_create(missing, &options, &playing, &error), error);
  bool failed = false;
  for (int k = 0; k < 2000 && !failed; k++) {
    nanosleep(&(struct timespec){0, 5000000}, NULL);
    failed = player_failed(playing, &error);
  }
  assert_true(failed && strstr(error.message, "counterlight-no-such-input") != NULL);
  assert_false(player_take(playing, INT64_MAX, INT64_MAX, &frame, &skipped));
  player_destroy(playing);
}

/* White, yellow, cyan, green, magenta, red, blue, black; the middle of each, far from its edges. */
static void colour_bars_are_what_they_are(void **state) {
  (void)state;
  enum { WIDTH = 64, HEIGHT = 36, BARS = 8, OFF_MOST = 4 };
  static const int colours[BARS][3] = {{1, 1, 1}, {1, 1, 0}, {0, 1, 1}, {0, 1, 0},
                                       {1, 0, 1}, {1, 0, 0}, {0, 0, 1}, {0, 0, 0}};
  clt_film_options options = {.width = WIDTH, .height = HEIGHT, .picture_s = 1};
  clt_error error = {0};
  player *playing = NULL;
  player_frame frame = {0};
  int skipped = 0, taken = 0;
  if (bars == NULL) {
    skip();
  }
  assert_ok(player_create(bars, &options, &playing, &error), error);
  for (int k = 0; k < 3000 && taken < 10; k++) {
    taken += player_take(playing, INT64_MAX, INT64_MAX, &frame, &skipped);
    nanosleep(&(struct timespec){0, 10000000}, NULL);
  }
  assert_int_equal(taken, 10);
  assert_near(frame.shape.seconds, 0, 0);
  for (int bar = 0; bar < BARS; bar++) {
    int x = (2 * bar + 1) * frame.shape.width / (2 * BARS), y = frame.shape.height / 2;
    const uint8_t *code = frame.codes->data + ((size_t)y * (size_t)frame.shape.width + (size_t)x) * 3;
    for (int c = 0; c < 3; c++) {
      assert_near(code[c], 255 * colours[bar][c], OFF_MOST);
    }
  }
  player_codes_drop(frame.codes);
  player_destroy(playing);
}

int main(int count, char **arguments) {
  bars = count > 1 ? arguments[1] : NULL;
  const struct CMUnitTest tests[] = {cmocka_unit_test(an_input_may_be_missing),
                                     cmocka_unit_test(a_player_says_what_it_waits_for),
                                     cmocka_unit_test(colour_bars_are_what_they_are)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
