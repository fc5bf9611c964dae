/* The watch over an acquisition: what it takes for a change, a lamp or noise; when it looks; how the journal goes back.
 */
#include "acquire/watch.h"

#include "acquire/journal.h"
#include "dihedral.h"
#include "fake_rig.h"

enum { WIDTH = 40, HEIGHT = 24, CELLS = WIDTH * HEIGHT, VALUES = 2 * CELLS, TILE_COUNT = 2 * 16 * 16 };
#define NOISE 0.002
#define STEADY 0.01

/* Two channels of a white picture, black included, and one look at it. */
typedef struct views {
  clt_watch watch;
  clt_image black, seen, deviation;
} views;

static void make_views(views *v) {
  const clt_rig_info info = {.width = WIDTH, .height = HEIGHT, .channels = 2};
  const clt_acquire_options options = {.watch = 5};
  clt_error error = {0};
  assert_ok(clt_watch_init(&v->watch, &options, &info, &error), error);
  clt_image *const images[] = {&v->black, &v->seen, &v->deviation};
  for (int k = 0; k < 3; k++) {
    assert_ok(clt_image_init(images[k], 2, HEIGHT, WIDTH, &error), error);
  }
  for (int i = 0; i < VALUES; i++) {
    v->black.data[i] = 0.05f;
    v->watch.expected.data[i] = (float)(0.05 + 0.5 + 0.3 * sin(0.2 * (i % WIDTH)));
    v->watch.variance.data[i] = (float)(NOISE * NOISE / 8);
    v->deviation.data[i] = (float)NOISE;
  }
}

static void finish_views(views *v) {
  clt_watch_finish(&v->watch);
  clt_image_finish(&v->black);
  clt_image_finish(&v->seen);
  clt_image_finish(&v->deviation);
}

/* A look with lamps of these factors. */
static void look(views *v, double first, double second, uint64_t *random) {
  for (int i = 0; i < VALUES; i++) {
    double lamp = i < CELLS ? first : second, black = (double)v->black.data[i];
    double light = black + lamp * ((double)v->watch.expected.data[i] - black);
    v->seen.data[i] = (float)(light + NOISE * test_normal(random));
  }
}

static void darken(views *v, int x0, int x1, int y0, int y1, double factor) {
  for (int y = y0; y < y1; y++) {
    for (int x = x0; x < x1; x++) {
      v->seen.data[y * WIDTH + x] *= (float)factor;
    }
  }
}

static clt_change compare(const views *v) {
  return clt_watch_compare(&v->watch.expected, &v->watch.variance, &v->seen, &v->deviation, STEADY);
}

static void noise_is_no_change_and_a_dark_tile_is(void **state) {
  (void)state;
  views v;
  uint64_t random = 4;
  make_views(&v);
  for (int n = 0; n < 200; n++) {
    look(&v, 1, 1, &random);
    assert_true(compare(&v).share == 0);
  }
  for (int n = 0; n < 20; n++) {
    look(&v, 1, 1, &random);
    darken(&v, 5, 7, 3, 4, 0.9); /* of the tiles of 2 or 3 x 1 or 2 cells, some that are wholly or partly there */
    clt_change change = compare(&v);
    assert_true(change.share >= 1.0 / TILE_COUNT && change.share <= 4.0 / TILE_COUNT);
    assert_true(change.x >= 4 && change.x <= 8 && change.y >= 2 && change.y <= 5);
    assert_true(change.percent < -3 && change.percent > -10.5);
  }
  look(&v, 1, 1, &random);
  darken(&v, 0, WIDTH, 0, 12, 0.5);
  assert_near(compare(&v).share, 0.25, 1e-12);
  assert_near(compare(&v).percent, -50, 2);
  for (int i = 0; i < 12 * WIDTH; i++) {
    v.deviation.data[i] = INFINITY; /* not seen: says nothing */
  }
  assert_true(compare(&v).share == 0);
  finish_views(&v);
}

/* As a look does: a room that did not change tells of the lamp. */
static clt_change compare_lamp(views *v) {
  double lamp[2];
  clt_change change =
      clt_watch_compare_lamp(&v->watch.expected, &v->watch.variance, &v->black, &v->seen, &v->deviation, STEADY, lamp);
  memcpy(v->watch.lamp, change.share > 0 ? (double[2]){1, 1} : lamp, sizeof lamp);
  return change;
}

static void one_factor_for_all_cells_is_a_lamp(void **state) {
  (void)state;
  static const double lamps[][2] = {{0.93, 0.98}, {1.05, 1.0}, {0.999, 1.09}, {1, 1}};
  views v;
  uint64_t random = 8;
  make_views(&v);
  for (size_t n = 0; n < 4; n++) {
    look(&v, lamps[n][0], lamps[n][1], &random);
    assert_int_equal(compare(&v).share > 0, n < 3);
    assert_true(compare_lamp(&v).share == 0);
    assert_near(v.watch.lamp[0], lamps[n][0], 2e-3);
    assert_near(v.watch.lamp[1], lamps[n][1], 2e-3);
    clt_watch_correct(&v.watch, &v.black, &v.seen, &v.deviation);
    assert_true(compare(&v).share == 0);
    assert_near(v.deviation.data[0], NOISE / lamps[n][0], 1e-5);
    for (int i = 0; i < VALUES; i++) {
      v.deviation.data[i] = (float)NOISE;
    }
  }
  look(&v, 0.95, 0.95, &random);
  darken(&v, 0, 12, 0, 12, 0.7);
  clt_change change = compare_lamp(&v);
  assert_true(change.share > 0.05 && change.share < 0.12 && change.x < 12 && change.y < 12);
  assert_near(change.percent, -30, 4);
  look(&v, 0.85, 0.85, &random);
  assert_near(compare_lamp(&v).share, 1, 1e-12); /* another light */
  finish_views(&v);
}

/* Records of four values, each of a drive of its own. */
static void fill(clt_image *image, double value) {
  for (size_t i = 0; i < clt_image_size(image); i++) {
    image->data[i] = (float)value;
  }
}

static void the_journal_goes_back(void **state) {
  (void)state;
  clt_journal journal;
  clt_image drive = {0}, seen = {0}, deviation = {0};
  clt_error error = {0};
  off_t start = 0, good = 0;
  bool found = false;
  assert_ok(clt_image_init(&drive, 1, 2, 2, &error), error);
  assert_ok(clt_image_init(&seen, 1, 2, 2, &error), error);
  assert_ok(clt_image_init(&deviation, 1, 2, 2, &error), error);
  assert_ok(clt_journal_open_unnamed(&journal, &error), error);
  assert_false(clt_journal_is_replaying(&journal));
  for (int n = 0; n < 6; n++) {
    start = n == 1 ? clt_journal_here(&journal) : start;
    good = n == 4 ? clt_journal_here(&journal) : good;
    fill(&drive, n);
    fill(&seen, 10 + n);
    fill(&deviation, 0.5);
    assert_ok(clt_journal_add(&journal, &drive, &seen, &deviation, &error), error);
  }
  assert_ok(clt_journal_go_back(&journal, start, good, &error), error);
  for (int n = 1; n < 4; n++) {
    assert_true(clt_journal_is_replaying(&journal));
    fill(&drive, n + 1);
    assert_int_equal(clt_journal_next_is(&journal, &drive), false);
    fill(&drive, n);
    assert_int_equal(clt_journal_next_is(&journal, &drive), true);
    assert_ok(clt_journal_replay(&journal, &drive, &seen, &deviation, &found, &error), error);
    assert_true(found && seen.data[3] == (float)(10 + n));
  }
  fill(&drive, 4);
  assert_false(clt_journal_next_is(&journal, &drive));
  assert_ok(clt_journal_replay(&journal, &drive, &seen, &deviation, &found, &error), error);
  assert_false(found || clt_journal_is_replaying(&journal));
  fill(&seen, 99);
  assert_ok(clt_journal_add(&journal, &drive, &seen, &deviation, &error), error);
  assert_ok(clt_journal_go_back(&journal, good, clt_journal_here(&journal), &error), error);
  assert_ok(clt_journal_replay(&journal, &drive, &seen, &deviation, &found, &error), error);
  assert_true(found && seen.data[0] == 99.0f);
  clt_journal_close(&journal);
  clt_image_finish(&drive);
  clt_image_finish(&seen);
  clt_image_finish(&deviation);
}

enum { ROOM_WIDTH = 16, ROOM_HEIGHT = 12, ROOM_CELLS = ROOM_WIDTH * ROOM_HEIGHT };

/* ||T - exact|| / ||exact||, and the patterns that it took. */
static double acquire_error(fake_rig *rig, const clt_acquire_options *options, int *patterns) {
  clt_transport *transport = NULL;
  clt_error error = {0};
  double x[ROOM_CELLS] = {0}, y[ROOM_CELLS], off = 0, whole = 0;
  assert_ok(clt_acquire(&rig->base, options, &transport, &error), error);
  for (int j = 0; j < ROOM_CELLS; j++) {
    x[j] = 1;
    clt_transport_apply(transport, 0, x, y);
    x[j] = 0;
    for (int i = 0; i < ROOM_CELLS; i++) {
      double exact = rig->transport[i * ROOM_CELLS + j];
      off += (y[i] - exact) * (y[i] - exact);
      whole += exact * exact;
    }
  }
  *patterns = clt_transport_origin(transport)->patterns;
  clt_transport_destroy(transport);
  return sqrt(off / whole);
}

static void a_lamp_that_drifts_is_scaled_out(void **state) {
  (void)state;
  double *exact = dihedral_transport(ROOM_WIDTH, ROOM_HEIGHT, 0.7);
  static const char *const schemes[] = {"brute", "hierarchical"};
  for (int n = 0; n < 2; n++) {
    int unwatched = 0, watched = 0;
    fake_rig rig = fake_rig_make(ROOM_WIDTH, ROOM_HEIGHT, 1, exact, 1);
    rig.lamp_gain = 0.04;
    double without = acquire_error(&rig, &(clt_acquire_options){.scheme = schemes[n], .repeats = 1}, &unwatched);
    rig.patterns = 0;
    double with = acquire_error(&rig, &(clt_acquire_options){.scheme = schemes[n], .repeats = 1, .watch = 2}, &watched);
    printf("%s: T off by %.2f %% (%d patterns), with looks by %.2f %% (%d)\n", schemes[n], 100 * without, unwatched,
           100 * with, watched);
    assert_true(with < 0.35 * without && watched < 2 * unwatched);
  }
  free(exact);
}

/* By patterns, by the devices' time, and after a doubt. */
static void looks_are_made_when_they_are_due(void **state) {
  (void)state;
  double *exact = dihedral_transport(ROOM_WIDTH, ROOM_HEIGHT, 0.7);
  fake_rig rig = fake_rig_make(ROOM_WIDTH, ROOM_HEIGHT, 1, exact, 1);
  int plain = 0, each10 = 0, by_time = 0, by_itself = 0;
  clt_acquire_options options = {.scheme = "brute", .repeats = 8};
  acquire_error(&rig, &options, &plain);
  assert_int_equal(plain, 16 + ROOM_CELLS);
  options.watch = 10;
  acquire_error(&rig, &options, &each10);
  assert_int_equal(each10, plain + 2 * ((ROOM_CELLS + 9) / 10)); /* a sum and white */
  options.watch = -1;
  acquire_error(&rig, &options, &by_itself);
  assert_int_equal(by_itself, plain + 2 * ((ROOM_CELLS + 24) / 25));
  assert_true(by_itself - plain <= 0.08 * plain);
  options.watch = 0;
  options.watch_s = 4;
  rig.pattern_s = 0.5;
  acquire_error(&rig, &options, &by_time);
  assert_true(abs(by_time - plain - 2 * (ROOM_CELLS / 8)) <= 2);
  free(exact);
}

/* A caller that opens devices again hears of them at once; what moves in the room is waited for all the same. */
static void devices_are_left_to_a_caller_that_opens_them_again(void **state) {
  (void)state;
  enum { GOOD = 40 };
  double *exact = dihedral_transport(ROOM_WIDTH, ROOM_HEIGHT, 0.7);
  const struct {
    clt_status status;
    bool moving, reopens, tried_once;
  } cases[] = {{CLT_GONE, false, true, true},
               {CLT_TIMEOUT, false, true, true},
               {CLT_TIMEOUT, true, true, false},
               {CLT_GONE, false, false, false},
               {CLT_TIMEOUT, false, false, false}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    fake_rig rig = fake_rig_make(ROOM_WIDTH, ROOM_HEIGHT, 1, exact, 1);
    rig.fails_with = cases[n].status;
    rig.moving = cases[n].moving;
    rig.fails_at = GOOD + 1;
    const clt_acquire_options options = {
        .scheme = "brute", .watch = -1, .patience_s = 0.05, .reopens = cases[n].reopens};
    clt_transport *transport = NULL;
    clt_error error = {0};
    assert_int_equal(clt_acquire(&rig.base, &options, &transport, &error), cases[n].status);
    assert_int_equal(rig.patterns == GOOD + 1, cases[n].tried_once);
    assert_int_equal(strstr(error.message, "tried ") == NULL, cases[n].tried_once);
  }
  free(exact);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(noise_is_no_change_and_a_dark_tile_is),
      cmocka_unit_test(one_factor_for_all_cells_is_a_lamp),
      cmocka_unit_test(the_journal_goes_back),
      cmocka_unit_test(a_lamp_that_drifts_is_scaled_out),
      cmocka_unit_test(looks_are_made_when_they_are_due),
      cmocka_unit_test(devices_are_left_to_a_caller_that_opens_them_again),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
