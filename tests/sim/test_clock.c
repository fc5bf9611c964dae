#include <pthread.h>

#include "rig_pair.h"

static const int64_t PERIOD = 16666667; /* ns from frame to frame at 60 per second */

static clt_status try_next(rig_pair *pair, int64_t not_before, double timeout_s, clt_frame *frame) {
  return pair->camera->driver->next(pair->camera, not_before, timeout_s, frame, NULL);
}

/* A picture is shown at the next refresh, one a refresh; the clock moves there and no further. */
static void presents_take_refreshes(void **state) {
  (void)state;
  rig_pair pair = pair_open(NULL);
  for (int n = 1; n <= 2000; n++) {
    assert_int_equal(pair_show_level(&pair, (float)(n % 2)), llround(n / 60.0 * 1e9));
  }
  pair_close(&pair);
}

/* Frames follow each other by 1 / fps, by the exposure where that is longer, and are counted. */
static void frames_follow_each_other(void **state) {
  (void)state;
  rig_pair pair = pair_open(NULL);
  clt_frame last = pair_frame(&pair, 0);
  for (int n = 0; n < 5; n++) {
    clt_frame frame = pair_frame(&pair, 0);
    assert_int_equal(frame.exposed_ns - last.exposed_ns, PERIOD);
    assert_int_equal(frame.sequence - last.sequence, 1);
    last = frame;
  }
  pair_expose(&pair, 0.1);
  last = pair_frame(&pair, 0);
  assert_int_equal(pair_frame(&pair, 0).exposed_ns - last.exposed_ns, 100000000);
  pair_expose(&pair, 0.001);
  last = pair_frame(&pair, 0);
  assert_int_equal(pair_frame(&pair, 0).exposed_ns - last.exposed_ns, PERIOD);
  pair_close(&pair);
}

/* Frames that nobody wants are dropped but counted; what ended before the clock's now is lost. */
static void frames_are_skipped(void **state) {
  (void)state;
  rig_pair pair = pair_open(NULL);
  clt_frame first = pair_frame(&pair, 0), frame = pair_frame(&pair, first.exposed_ns + 1000 * PERIOD - 5);
  assert_int_equal(frame.exposed_ns, first.exposed_ns + 1000 * PERIOD);
  assert_int_equal(frame.sequence, first.sequence + 1000);
  frame = pair_frame(&pair, frame.exposed_ns + 3600000000000); /* an hour on */
  assert_int_equal((frame.exposed_ns - first.exposed_ns) % PERIOD, 0);
  assert_int_equal((frame.exposed_ns - first.exposed_ns) / PERIOD, frame.sequence - first.sequence);
  int64_t shown = 0;
  for (int n = 0; n < 30; n++) {
    shown = pair_show_level(&pair, 0.01f * (float)n);
  }
  clt_frame after = pair_frame(&pair, 0);
  assert_true(after.exposed_ns + PERIOD >= shown && after.exposed_ns < shown + PERIOD);
  pair_close(&pair);
}

/* A new exposure holds `delay` frames after the next one that starts; the last of several requests wins. */
static void exposures_come_late(void **state) {
  (void)state;
  for (int delay = 0; delay <= 8; delay++) {
    char text[200];
    snprintf(text, sizeof text, "camera = { exposure_delay_frames = %d; };", delay);
    rig_pair pair = pair_open(text);
    pair_frame(&pair, 0);
    assert_int_equal(pair.camera->driver->set_exposure(pair.camera, 0.25, NULL), CLT_OK);
    assert_int_equal(pair.camera->driver->set_exposure(pair.camera, 0.002, NULL), CLT_OK);
    for (int n = 0; n < delay; n++) {
      assert_near(pair_frame(&pair, 0).exposure_s, 1.0 / 60.0, 1e-12);
      assert_int_equal(pair.camera->driver->set_exposure(pair.camera, 0.003 + 0.001 * n, NULL), CLT_OK);
    }
    assert_near(pair_frame(&pair, 0).exposure_s, 0.002, 0.0);
    for (int n = 0; n < delay; n++) {
      assert_near(pair_frame(&pair, 0).exposure_s, 0.003 + 0.001 * n, 0.0);
    }
    clt_error error = {.status = CLT_OK};
    assert_int_equal(pair.camera->driver->set_exposure(pair.camera, 5.0, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "1e-05 to 4 s"));
    assert_int_equal(pair.camera->driver->set_exposure(pair.camera, (double)NAN, NULL), CLT_BAD_INPUT);
    pair_close(&pair);
  }
}

/* Requests that pile up while only the projector moves the clock are all honoured or replaced, never lost. */
static void requests_without_frames(void **state) {
  (void)state;
  rig_pair pair = pair_open("camera = { exposure_delay_frames = 8; fps = 1000.0; };");
  double wanted = 0.0;
  for (int n = 0; n < 500; n++) {
    wanted = 1e-4 + 1e-5 * (n % 90);
    assert_int_equal(pair.camera->driver->set_exposure(pair.camera, wanted, NULL), CLT_OK);
    pair_show_level(&pair, (float)(n % 2));
  }
  clt_frame frame = {.exposure_s = 0.0};
  for (int n = 0; n < 10; n++) {
    frame = pair_frame(&pair, 0);
  }
  assert_near(frame.exposure_s, wanted, 0.0);
  pair_close(&pair);
}

/* A frame that starts too late is a timeout, which takes its time and nothing else. */
static void timeouts(void **state) {
  (void)state;
  rig_pair pair = pair_open(NULL);
  clt_frame first = pair_frame(&pair, 0), frame;
  int64_t now = first.exposed_ns + llround(first.exposure_s * 1e9);
  assert_int_equal(try_next(&pair, now + 2000000000, 0.5, &frame), CLT_TIMEOUT);
  assert_int_equal(try_next(&pair, INT64_MAX, 0.5, &frame), CLT_TIMEOUT);
  int64_t shown = pair_show_level(&pair, 0.5f);
  assert_true(shown > now + 1000000000 && shown <= now + 1000000000 + PERIOD);
  assert_int_equal(try_next(&pair, now + 2000000000, 1.1, &frame), CLT_OK);
  assert_int_equal((frame.exposed_ns - first.exposed_ns) / PERIOD, frame.sequence - first.sequence);
  pair_close(&pair);
}

static void one_of_each(void **state) {
  (void)state;
  rig_pair pair = pair_open(NULL);
  clt_error error = {.status = CLT_OK};
  clt_camera *camera = NULL;
  clt_projector *projector = NULL;
  assert_int_equal(clt_scene_open_camera(pair.scene, &camera, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "already open"));
  assert_int_equal(clt_scene_open_projector(pair.scene, &projector, &error), CLT_BAD_INPUT);
  pair.camera->driver->close(pair.camera);
  assert_ok(clt_scene_open_camera(pair.scene, &pair.camera, &error), error);
  pair.camera->driver->close(NULL);
  pair.projector->driver->close(NULL);
  pair_close(&pair);
}

static void *show_many(void *context) {
  rig_pair *pair = context;
  int64_t last = 0;
  for (int n = 0; n < 400; n++) {
    int64_t shown = 0;
    float codes[PAIR_CELLS] = {(float)(n % 7) / 7.0f};
    if (pair->projector->driver->present(pair->projector, codes, &shown, NULL) != CLT_OK || shown <= last) {
      return pair;
    }
    last = shown;
  }
  return NULL;
}

/* The projector and the camera may be called from two threads; time only ever moves on. */
static void two_threads(void **state) {
  (void)state;
  rig_pair pair = pair_open(NULL);
  pthread_t thread;
  assert_int_equal(pthread_create(&thread, NULL, show_many, &pair), 0);
  int64_t last = -1;
  for (int n = 0; n < 400; n++) {
    clt_frame frame = pair_frame(&pair, 0);
    assert_true(frame.exposed_ns > last);
    last = frame.exposed_ns;
  }
  void *failed = NULL;
  pthread_join(thread, &failed);
  assert_null(failed);
  pair_close(&pair);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(presents_take_refreshes),
      cmocka_unit_test(frames_follow_each_other),
      cmocka_unit_test(frames_are_skipped),
      cmocka_unit_test(exposures_come_late),
      cmocka_unit_test(requests_without_frames),
      cmocka_unit_test(timeouts),
      cmocka_unit_test(one_of_each),
      cmocka_unit_test(two_threads),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
