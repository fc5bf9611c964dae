/* A camera whose automatic controls are on is named for each of them, and an honest one is not. */
#include "rig/photometry/photometry.h"
#include "rough_room.h"
#include "wrapped_camera.h"

static void honest(wrapped_camera *self, clt_frame *frame) {
  (void)self;
  (void)frame;
}

/* Gain follows the picture's mean with a time constant of a second, within a fifth to either side. */
static void automatic_gain(wrapped_camera *self, clt_frame *frame) {
  double mean = wrapped_mean(self, frame, 1), now = 1e-9 * (double)frame->exposed_ns;
  double wanted = fmin(fmax(0.2 / fmax(mean, 1e-6), 1 - self->strength), 1 + self->strength);
  double gain = self->frames > 0 ? self->state[0] : 1;
  self->state[0] = gain + (wanted - gain) * (1 - exp(-(now - self->state[1])));
  self->state[1] = now;
  for (int c = 0; c < 3; c++) {
    wrapped_scale(self, frame, c, gain);
  }
}

/* Red and blue are drawn towards green. */
static void automatic_white(wrapped_camera *self, clt_frame *frame) {
  double now = 1e-9 * (double)frame->exposed_ns, green = wrapped_mean(self, frame, 1);
  for (int c = 0; c < 3; c += 2) {
    double wanted =
        fmin(fmax(green / fmax(wrapped_mean(self, frame, c), 1e-6), 1 - self->strength), 1 + self->strength);
    double gain = self->frames > 0 ? self->state[c] : 1;
    self->state[c] = gain + (wanted - gain) * (1 - exp(-0.3 * (now - self->state[1])));
    wrapped_scale(self, frame, c, gain);
  }
  self->state[1] = now;
}

/* Every few seconds the lens hunts: a blur over neighbours that comes and goes. */
static void automatic_focus(wrapped_camera *self, clt_frame *frame) {
  double now = 1e-9 * (double)frame->exposed_ns, share = self->strength * fmax(sin(2 * M_PI * now / 5), 0);
  for (int y = 0; y < frame->height; y++) {
    for (int x = 0; x < frame->width; x++) {
      for (int c = 0; c < 3; c++) {
        int at = (y * frame->width + x) * 3 + c, left = x > 0 ? at - 3 : at, right = x + 1 < frame->width ? at + 3 : at;
        self->samples[at] = (uint16_t)lrint((1 - share) * frame->samples[at] +
                                            0.5 * share * (frame->samples[left] + frame->samples[right]));
      }
    }
  }
}

static clt_findings watch(unsigned seed, wrapped_trick *trick, double strength, double fixed_s) {
  rough_room room;
  static wrapped_camera camera;
  clt_error error = {0};
  clt_findings findings = {0};
  clt_field_bench bench;
  clt_locks locks;
  double base_s = 0;
  rough_open(&room, seed,
             (rough_settings){"response = \"srgb\"; latency_ms = 37; " ROUGH_PANEL, "cell_pixels = 1;", ROUGH_LIGHT});
  wrapped_init(&camera, room.camera, trick, strength, seed);
  camera.fixed_s = fixed_s;
  clt_shots_init(&room.shots, room.projector, &camera.base, room.shots.latency_s, 10, 3);
  assert_ok(clt_field_bench_init(&bench, &room.shots, &error), error);
  assert_ok(clt_exposure_base(&bench, &base_s, &findings, &error), error);
  assert_ok(clt_field_find_groups(&bench, base_s, 3, &error), error);
  assert_ok(clt_locks_check(&bench, base_s, 20, &locks, &findings, &error), error);
  clt_field_bench_finish(&bench);
  rough_close(&room);
  return findings;
}

static void expect(const clt_findings *findings, const char *text) {
  assert_int_equal(findings->count, 1);
  assert_true(findings->item[0].serious);
  if (strstr(findings->item[0].text, text) == NULL) {
    fail_msg("\"%s\" does not say \"%s\"", findings->item[0].text, text);
  }
}

static void each_automatic_control_is_named(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 2; seed++) {
    clt_findings gain = watch(seed, automatic_gain, 0.2, 0), white = watch(seed, automatic_white, 0.1, 0),
                 focus = watch(seed, automatic_focus, 0.6, 0), exposure = watch(seed, honest, 0, 1 / 60.);
    expect(&gain, "gain or exposure is automatic");
    expect(&white, "white balance is automatic: its red/blue ratio moved");
    expect(&focus, "focus is automatic");
    expect(&exposure, "does not obey its exposure time");
  }
}

static void an_honest_camera_is_not_accused(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= 10; seed++) {
    assert_int_equal(watch(seed, honest, 0, 0).count, 0);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(each_automatic_control_is_named),
      cmocka_unit_test(an_honest_camera_is_not_accused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
