/* Moving pictures on their way to the glass: when each goes up, what is passed over, and what is counted. */
#include "daemon/reel.h"

#include <stdlib.h>

#include "base/clock.h"
#include "support.h"

static const int64_t refresh_ns = 16666667;
static const double refresh_s = 1.0 / 60;

static reel *make_reel(void) {
  clt_error error = {0};
  reel *made = NULL;
  assert_ok(reel_create(&made, &error), error);
  return made;
}

/* A picture with a content of its own, or with that of another one. */
static void put(reel *on, uint64_t serial, int64_t due_ns, player_codes *content) {
  reel_picture *picture = reel_blank(on, 64);
  assert_non_null(picture);
  assert_null(picture->content);
  picture->serial = serial;
  picture->due_ns = due_ns;
  picture->content = player_codes_hold(content);
  if (content == NULL) {
    picture->content = calloc(1, sizeof *picture->content);
    assert_non_null(picture->content);
    atomic_init(&picture->content->holders, 1);
  }
  reel_put(on, picture);
}

static void assert_counts(reel *on, uint64_t shown, uint64_t late, uint64_t skipped) {
  const reel_counts counts = reel_count(on);
  assert_int_equal(counts.shown, shown);
  assert_int_equal(counts.late, late);
  assert_int_equal(counts.skipped, skipped);
}

/* A picture that is ready before its time goes up at the refresh nearest to it. */
static void nothing_goes_up_early(void **state) {
  (void)state;
  reel *on = make_reel();
  reel_picture *shown = NULL;
  const int64_t start_ns = 1000 * refresh_ns;
  for (int k = 0; k < REEL_AHEAD; k++) {
    put(on, (uint64_t)k, start_ns + (2 * k + 4) * refresh_ns, NULL);
  }
  for (int refresh = 0; refresh < 12; refresh++) {
    const int due = (refresh - 4) / 2;
    reel_take(on, start_ns + refresh * refresh_ns - refresh_ns / 3, refresh_s, &shown);
    if (refresh < 4) {
      assert_null(shown);
    } else {
      assert_int_equal(shown->serial, due < REEL_AHEAD ? due : REEL_AHEAD - 1);
    }
  }
  assert_counts(on, REEL_AHEAD, 0, 0);
  put(on, 7, start_ns + 20 * refresh_ns, NULL);
  assert_false(reel_take(on, start_ns + 20 * refresh_ns - refresh_ns * 51 / 100, refresh_s, &shown));
  assert_true(reel_take(on, start_ns + 20 * refresh_ns - refresh_ns * 49 / 100, refresh_s, &shown));
  reel_picture_free(shown);
  reel_destroy(on);
}

/* Whatever the phase, a film as fast as the refresh shows each frame once, though turns begin up to a fifth of a
 * refresh early or late. */
static void a_film_of_the_refresh_s_rate_loses_nothing(void **state) {
  (void)state;
  enum { PHASES = 16, SETTLING = 3, FRAMES = 400 };
  for (uint64_t phase = 0; phase < PHASES; phase++) {
    reel *on = make_reel();
    reel_picture *shown = NULL;
    uint64_t random = phase + 1;
    int64_t put_until = 0, same = 0, over = 0, before = -1;
    for (int64_t refresh = 0; refresh < FRAMES; refresh++) {
      while (put_until < refresh + REEL_AHEAD - 1) {
        put(on, (uint64_t)put_until, 1000 * refresh_ns + put_until * refresh_ns + (int64_t)phase * refresh_ns / PHASES,
            NULL);
        put_until++;
      }
      const double early = 0.4 * test_random(&random) - 0.2;
      reel_take(on, (1000 + refresh) * refresh_ns + (int64_t)(early * (double)refresh_ns), refresh_s, &shown);
      const int64_t serial = shown != NULL ? (int64_t)shown->serial : -1;
      same += refresh > SETTLING && serial == before;
      over += refresh > SETTLING && serial > before + 1;
      before = serial;
    }
    assert_true(same + over <= 1); /* the window is found once */
    assert_true(before >= FRAMES - 3);
    reel_picture_free(shown);
    reel_destroy(on);
  }
}

/* A turn that was missed passes over what is no longer due; a picture that is put late is told so. */
static void what_comes_too_late_is_told(void **state) {
  (void)state;
  reel *on = make_reel();
  reel_picture *shown = NULL;
  const int64_t start_ns = 1000 * refresh_ns;
  for (int k = 0; k < 3; k++) {
    put(on, (uint64_t)k, start_ns + k * refresh_ns, NULL);
  }
  assert_true(reel_take(on, start_ns + 2 * refresh_ns, refresh_s, &shown));
  assert_int_equal(shown->serial, 2);
  assert_counts(on, 1, 0, 2);
  put(on, 3, start_ns + 3 * refresh_ns, NULL);
  assert_true(reel_take(on, start_ns + 4 * refresh_ns + 2, refresh_s, &shown));
  assert_counts(on, 1, 1, 0);
  assert_false(reel_take(on, start_ns + 5 * refresh_ns, refresh_s, &shown));
  assert_counts(on, 0, 0, 0);
  reel_picture_free(shown);
  reel_destroy(on);
}

/* What has no time of its own goes up at once, the latest of it; a repetition is no other frame. */
static void what_is_due_at_once_goes_up_at_once(void **state) {
  (void)state;
  reel *on = make_reel();
  reel_picture *shown = NULL;
  put(on, 0, 0, NULL);
  put(on, 1, 0, NULL);
  assert_true(reel_take(on, 1, refresh_s, &shown));
  assert_int_equal(shown->serial, 1);
  assert_counts(on, 1, 0, 1);
  put(on, 2, 0, shown->content);
  put(on, 3, 0, shown->content);
  assert_true(reel_take(on, 2, refresh_s, &shown));
  assert_int_equal(shown->serial, 3);
  assert_counts(on, 0, 0, 0);
  reel_picture_free(shown);
  reel_destroy(on);
}

/* Other content: nothing of what was computed ahead is shown, and none of it is kept. */
static void what_waits_is_dropped_where_the_content_changes(void **state) {
  (void)state;
  reel *on = make_reel();
  reel_picture *shown = NULL;
  put(on, 1, 0, NULL);
  assert_true(reel_take(on, refresh_ns, refresh_s, &shown));
  player_codes *content = shown->content;
  put(on, 1, refresh_ns, content);
  put(on, 1, 2 * refresh_ns, content);
  assert_int_equal(atomic_load(&content->holders), 3);
  reel_clear(on);
  assert_int_equal(atomic_load(&content->holders), 1);
  assert_false(reel_take(on, INT64_MAX / 2, refresh_s, &shown));
  put(on, 2, 0, NULL);
  assert_true(reel_take(on, 3 * refresh_ns, refresh_s, &shown));
  assert_int_equal(shown->serial, 2);
  reel_picture_free(shown);
  reel_destroy(on);
}

/* As many pictures as may wait, whoever takes them or does not; the same memory again and again. */
static void a_reel_is_full_and_stays_as_large(void **state) {
  (void)state;
  reel *on = make_reel();
  reel_picture *shown = NULL;
  const int64_t now_ns = clt_clock_ns(), hour_ns = 3600 * INT64_C(1000000000);
  for (int k = 0; k < REEL_AHEAD; k++) {
    assert_near(reel_wait(on, refresh_s), 0, 0);
    put(on, (uint64_t)k, now_ns + hour_ns, NULL);
  }
  assert_near(reel_wait(on, refresh_s), 3600 + refresh_s, 30);
  reel_clear(on);
  for (int k = 0; k < REEL_AHEAD; k++) {
    put(on, (uint64_t)k, now_ns - hour_ns, NULL);
  }
  assert_near(reel_wait(on, refresh_s), 0, 0);
  put(on, REEL_AHEAD, now_ns, NULL);
  assert_counts(on, 0, 0, 1);
  assert_true(reel_take(on, now_ns - hour_ns, refresh_s, &shown));
  assert_int_equal(shown->serial, REEL_AHEAD - 1);
  const float *seen[REEL_AHEAD + 2] = {NULL};
  int different = 0;
  for (int k = 0; k < 20; k++) {
    put(on, 9, 0, NULL);
    assert_true(reel_take(on, now_ns, refresh_s, &shown));
    int at = 0;
    while (at < different && seen[at] != shown->fields) {
      at++;
    }
    assert_true(at < REEL_AHEAD + 2);
    seen[at] = shown->fields;
    different += at == different;
  }
  reel_picture_free(shown);
  reel_destroy(on);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(nothing_goes_up_early),
      cmocka_unit_test(a_film_of_the_refresh_s_rate_loses_nothing),
      cmocka_unit_test(what_comes_too_late_is_told),
      cmocka_unit_test(what_is_due_at_once_goes_up_at_once),
      cmocka_unit_test(what_waits_is_dropped_where_the_content_changes),
      cmocka_unit_test(a_reel_is_full_and_stays_as_large),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
