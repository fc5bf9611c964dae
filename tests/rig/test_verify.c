/* Frames that are not of their picture: taken again, or an error with numbers, never a wrong radiance. */
#include "counterlight/rig.h"
#include "noise.h"
#include "rig/agreement.h"
#include "rig/timing/patch.h"
#include "rough_room.h"
#include "wrapped_camera.h"

#define STEADY_PANEL "response = \"linear\"; bits = 16; latency_ms = 37;"

enum { COARSE_STEP = 16 };

static size_t frame_bytes(const clt_frame *frame) {
  return (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels * sizeof(uint16_t);
}

static bool strikes(wrapped_camera *self) {
  bool now = self->frames > 0 && test_random(&self->random) < self->strength;
  self->faults += now;
  return now;
}

/* By chance the samples that were delivered before, bit by bit. */
static void stuck(wrapped_camera *self, clt_frame *frame) {
  if (strikes(self)) {
    memcpy(self->samples, self->delivered, frame_bytes(frame));
  }
}

static void add_noise(wrapped_camera *self, const clt_frame *frame) {
  for (int k = 0; k < frame->width * frame->height * frame->channels; k++) {
    int noisy = self->samples[k] + (int)lrint(test_normal(&self->random));
    self->samples[k] = (uint16_t)(noisy < 0 ? 0 : noisy > 4095 ? 4095 : noisy);
  }
}

/* By chance what the frame before saw, with noise of its own, so that no two frames are equal. */
static void late(wrapped_camera *self, clt_frame *frame) {
  if (strikes(self)) {
    memcpy(self->samples, self->before, frame_bytes(frame));
  }
  add_noise(self, frame);
}

/* Eight bits widened to twelve: what noise there is seldom reaches the next step. */
static void coarsen(wrapped_camera *self, const clt_frame *frame) {
  for (int k = 0; k < frame->width * frame->height * frame->channels; k++) {
    int rounded = COARSE_STEP * ((self->samples[k] + COARSE_STEP / 2) / COARSE_STEP);
    self->samples[k] = (uint16_t)(rounded < 4095 ? rounded : 4095);
  }
}

static void coarse(wrapped_camera *self, clt_frame *frame) {
  coarsen(self, frame);
}

static void coarse_and_half_dark(wrapped_camera *self, clt_frame *frame) {
  if (strikes(self)) {
    memset(self->samples + frame->width * (frame->height / 2) * 3, 0, frame_bytes(frame) / 2);
  }
  coarsen(self, frame);
}

static void honest(wrapped_camera *self, clt_frame *frame) {
  (void)self;
  (void)frame;
}

/* For ever what the first frame saw, with noise of its own. */
static void frozen(wrapped_camera *self, clt_frame *frame) {
  static uint16_t first[WRAPPED_SAMPLES_MAX];
  if (self->frames == 0) {
    memcpy(first, frame->samples, frame_bytes(frame));
  }
  memcpy(self->samples, first, frame_bytes(frame));
  add_noise(self, frame);
}

/* By chance the lower half without light. */
static void half_dark(wrapped_camera *self, clt_frame *frame) {
  if (strikes(self)) {
    for (int k = frame->width * (frame->height / 2) * 3; k < frame->width * frame->height * 3; k++) {
      self->samples[k] = (uint16_t)lrint(64 + test_normal(&self->random));
    }
  }
}

/* Always what the frame before saw. */
static void always_late(wrapped_camera *self, clt_frame *frame) {
  memcpy(self->samples, self->frames > 0 ? self->before : frame->samples, frame_bytes(frame));
}

typedef struct outcome {
  int right, refused, wrong, left_out; /* pictures; values without a radiance */
  long faults;
  double worst; /* departure less six deviations, of white */
  char message[CLT_MESSAGE_MAX];
} outcome;

/* Blocks of 4 x 4 cells, bright, dim or dark by chance. */
static void draw(clt_image *drive, uint64_t *random) {
  for (int k = 0; k < 3 * ROUGH_CELLS; k++) {
    int x = k % ROUGH_WIDTH / 4, y = k % ROUGH_CELLS / ROUGH_WIDTH / 4;
    uint64_t block = *random + (uint64_t)(y * ROUGH_WIDTH + x + k / ROUGH_CELLS * 4096);
    double chance = test_random(&block);
    drive->data[k] = chance < 0.4 ? 0 : chance < 0.7 ? 0.1f : 1;
  }
  test_random(random);
}

static void compare(const rough_room *room, const clt_image *drive, const clt_image *seen, const clt_image *deviation,
                    double white, const clt_patch *patch, outcome *out) {
  clt_error error = {0};
  clt_image exact = {0};
  double worst = 0;
  assert_ok(clt_scene_appearance(room->scene, drive, &exact, &error), error);
  for (int k = 0; k < 3 * ROUGH_CELLS; k++) {
    int x = k % ROUGH_WIDTH, y = k % ROUGH_CELLS / ROUGH_WIDTH;
    if (clt_patch_covers(patch, x, y)) {
      assert_true(isinf(deviation->data[k]));
    } else if (isfinite(deviation->data[k])) {
      double off = fabs((double)seen->data[k] - (double)exact.data[k]) - 6 * (double)deviation->data[k];
      worst = fmax(worst, off / white);
    } else {
      out->left_out++;
    }
  }
  out->worst = fmax(out->worst, worst);
  out->right += worst < 0.005;
  out->wrong += worst >= 0.005;
  clt_image_finish(&exact);
}

typedef struct trouble {
  wrapped_trick *trick;
  double chance;
  bool verify;
  int side, exposures; /* of the patch, or 0; of the rig, or 0: as the scene suggests */
  double step;         /* of samples whose black is at 0; 0: fine ones above a pedestal */
} trouble;

/* Faults of the simulator itself. */
static const char simulated_faults[] =
    "cell_pixels = 2; faults = { dropped = 0.05; stuck = 0.05; torn = 0.05; late = 0.05; late_ms = 60.0; };";

static clt_rig *open_rig(rough_room *room, wrapped_camera *camera, const trouble *with, clt_rig_config *config) {
  clt_rig *rig = NULL;
  clt_error error = {0};
  clt_scene_rig_config(room->scene, config);
  config->verify = with->verify;
  config->patch = (clt_patch){2, 1, with->side};
  config->exposure_count = with->exposures > 0 ? with->exposures : config->exposure_count;
  assert_ok(clt_rig_open(config, room->projector, &camera->base, &rig, &error), error);
  return rig;
}

enum { PICTURES = 20 };

/* Twenty pictures seen by a camera with a trick. */
static outcome observe(unsigned seed, trouble with) {
  static wrapped_camera camera;
  rough_room room;
  clt_rig_config config;
  clt_error error = {0};
  clt_image drive = {0}, seen = {0}, deviation = {0}, *images[] = {&drive, &seen, &deviation};
  outcome out = {0};
  uint64_t random = seed;
  const char *keys = with.trick == NULL ? simulated_faults
                     : with.step > 0    ? "cell_pixels = 4; black_level = 0;"
                                        : "cell_pixels = 2;";
  rough_open(&room, seed, (rough_settings){STEADY_PANEL, keys, "ambient = 0.002;"});
  wrapped_init(&camera, room.camera, with.trick == NULL ? honest : with.trick, with.chance, seed);
  camera.step = with.step;
  clt_rig *rig = open_rig(&room, &camera, &with, &config);
  for (int n = 0; n < 3; n++) {
    assert_ok(clt_image_init(images[n], 3, ROUGH_HEIGHT, ROUGH_WIDTH, &error), error);
  }
  for (int n = 0; n < PICTURES; n++) {
    draw(&drive, &random);
    clt_status status = rig->operations->observe(rig, &drive, &seen, &deviation, &error);
    if (status == CLT_OK) { /* the panel is linear and as fine as the grid: codes are light */
      clt_patch_write(&config.patch, ROUGH_WIDTH, ROUGH_HEIGHT, &room.shots.panel, n + 1, drive.data);
      compare(&room, &drive, &seen, &deviation, 0.7 / (room.shots.sensor.responsivity / 60), &config.patch, &out);
    } else {
      out.refused++;
      memcpy(out.message, error.message, sizeof out.message);
    }
  }
  out.faults = camera.faults;
  for (int n = 0; n < 3; n++) {
    clt_image_finish(images[n]);
  }
  rig->operations->close(rig);
  rough_close(&room);
  printf("seed %u, chance %g, verify %d, patch %d: %d right, %d refused, %d wrong of 20 at %ld faults, worst %.1e of "
         "white\n",
         seed, with.chance, with.verify, with.side, out.right, out.refused, out.wrong, out.faults, out.worst);
  return out;
}

enum { SEEDS = 3 };

/* Two pixels that always say the same and one that is always full: their cells contradict themselves at every attempt,
 * and only they are left out. */
static void defective(wrapped_camera *self, clt_frame *frame) {
  self->samples[(5 * frame->width + 9) * 3] = 1900;
  self->samples[(30 * frame->width + 40) * 3 + 1] = 2500;
  self->samples[(20 * frame->width + 20) * 3 + 2] = 4095;
}

static void defective_pixels_do_not_stop_the_rig(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= SEEDS; seed++) {
    outcome out = observe(seed, (trouble){defective, 0, true, 0, 0, 0});
    assert_int_equal(out.right, PICTURES);
    assert_true(out.left_out > 0 && out.left_out <= 2 * PICTURES);
  }
}

static void honest_frames_pass(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= SEEDS; seed++) {
    assert_int_equal(observe(seed, (trouble){late, 0, true, 0, 0, 0}).right, PICTURES);
    assert_int_equal(observe(seed, (trouble){late, 0, true, 2, 0, 0}).right, PICTURES);
  }
}

static void stuck_frames_are_taken_again(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= SEEDS; seed++) {
    outcome out = observe(seed, (trouble){stuck, 0.15, false, 0, 0, 0});
    assert_true(out.right == PICTURES && out.faults > 5);
  }
}

/* The mean of a dark cell is rounded alike in all its samples: by 0.4 of a step, say, in every exposure, which is no
 * light that one saw and another did not. A rig that takes each code value for a step refuses such pictures. */
static void coarse_samples_do_not_contradict(void **state) {
  (void)state;
  int wrong = 0;
  assert_true(observe(1, (trouble){coarse, 0, true, 0, 0, 1}).refused > PICTURES / 2);
  for (unsigned seed = 1; seed < SEEDS; seed++) {
    assert_int_equal(observe(seed, (trouble){coarse, 0, true, 0, 0, COARSE_STEP}).right, PICTURES);
    wrong += observe(seed, (trouble){coarse_and_half_dark, 0.1, false, 0, 0, COARSE_STEP}).wrong;
    outcome out = observe(seed, (trouble){coarse_and_half_dark, 0.1, true, 0, 0, COARSE_STEP});
    assert_true(out.wrong == 0 && out.refused <= 1 && out.faults > 5);
  }
  assert_true(wrong > SEEDS);
}

/* What two exposures of 1 and 8 ms say of a grid of columns, every other of them so bright; the dark ones are half as
 * bright again in the longer. */
static size_t contradictions(double bright) {
  enum { WIDTH = 8, HEIGHT = 2, SIDE = 2, PIXELS = WIDTH * HEIGHT * SIDE * SIDE };
  static const clt_camera_info camera = {
      .width = WIDTH * SIDE, .height = HEIGHT * SIDE, .channels = 1, .bits = 12, .full_well = 1e6, .read_noise = 20};
  const double dark[2] = {20, 30}, seconds[2] = {1e-3, 8e-3};
  const clt_curve linear = {.kind = CLT_CURVE_LINEAR};
  clt_footprints footprints;
  clt_merge merge;
  clt_agreement agreement;
  clt_error error = {0};
  assert_ok(clt_footprints_align(WIDTH, HEIGHT, camera.width, camera.height, &footprints, &error), error);
  assert_ok(clt_merge_init(&merge, &camera, &linear, &footprints, 2, &error), error);
  assert_ok(clt_agreement_init(&agreement, WIDTH, HEIGHT, 1, &error), error);
  for (int k = 0; k < 2; k++) {
    uint16_t samples[PIXELS];
    for (int p = 0; p < PIXELS; p++) {
      double rate = p / SIDE % 2 == 0 ? bright : dark[k];
      samples[p] = (uint16_t)lrint(fmin(rate * seconds[k], 1) * 4095);
    }
    clt_frame frame = {camera.width, camera.height, 1, camera.bits, samples, 0, seconds[k], 0};
    clt_merge_add(&merge, k, &frame);
  }
  bool bad[CLT_EXPOSURES_MAX];
  size_t count = clt_agreement_check(&agreement, &merge, bad);
  clt_agreement_finish(&agreement);
  clt_merge_finish(&merge);
  clt_footprints_finish(&footprints);
  return count;
}

/* Where a camera halves its colour, a dark pixel has a part of that of a saturated one beside it. No cell alone
 * contradicts, as the light beside it is bright enough to explain that; nor may all dark ones together. */
static void cells_beside_saturated_ones_do_not_contradict(void **state) {
  (void)state;
  assert_int_equal(contradictions(800), 0);
  assert_true(contradictions(40) > 0);
}

/* Without proof such frames do give wrong radiances; with it none does. */
static void frames_that_contradict_are_taken_again(void **state) {
  (void)state;
  wrapped_trick *const tricks[] = {late, half_dark};
  for (int n = 0; n < 2; n++) {
    int refused = 0;
    for (unsigned seed = 1; seed <= SEEDS; seed++) {
      assert_true(observe(seed, (trouble){tricks[n], 0.1, false, 0, 0, 0}).wrong > 0);
      outcome out = observe(seed, (trouble){tricks[n], 0.1, true, 0, 0, 0});
      assert_true(out.wrong == 0 && out.faults > 5);
      refused += out.refused;
    }
    assert_true(refused <= SEEDS * PICTURES / 20);
  }
}

static void faults_of_the_simulator_are_survived(void **state) {
  (void)state;
  int wrong = 0, refused = 0;
  for (unsigned seed = 1; seed <= 2 * SEEDS; seed++) {
    wrong += observe(seed, (trouble){NULL, 0, false, 0, 0, 0}).wrong;
    outcome out = observe(seed, (trouble){NULL, 0, true, 0, 0, 0});
    assert_int_equal(out.wrong, 0);
    refused += out.refused;
  }
  assert_true(wrong > SEEDS && refused <= 2);
}

static void the_patch_tells_pictures_apart(void **state) {
  (void)state;
  for (unsigned seed = 1; seed <= SEEDS; seed++) {
    assert_true(observe(seed, (trouble){late, 0.3, false, 0, 1, 0}).wrong > 0);
    outcome out = observe(seed, (trouble){late, 0.3, false, 1, 1, 0});
    assert_true(out.wrong == 0 && out.refused <= 1 && out.faults > 2);
  }
}

static void a_device_that_keeps_failing_is_refused_with_numbers(void **state) {
  (void)state;
  outcome out = observe(1, (trouble){always_late, 0, true, 0, 0, 0});
  assert_int_equal(out.refused, PICTURES);
  assert_non_null(strstr(out.message, "picture 20: its exposures contradict each other"));
  assert_non_null(strstr(out.message, "contradicted the others"));
  out = observe(1, (trouble){frozen, 0, false, 1, 1, 0});
  assert_true(out.refused == PICTURES - 1 && out.wrong == 0);
  assert_non_null(strstr(out.message, "no frame shows its patch"));
  out = observe(1, (trouble){stuck, 1, false, 0, 0, 0});
  assert_int_equal(out.refused, PICTURES);
  assert_non_null(strstr(out.message, "the same samples again and again"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(honest_frames_pass),
      cmocka_unit_test(stuck_frames_are_taken_again),
      cmocka_unit_test(frames_that_contradict_are_taken_again),
      cmocka_unit_test(cells_beside_saturated_ones_do_not_contradict),
      cmocka_unit_test(coarse_samples_do_not_contradict),
      cmocka_unit_test(faults_of_the_simulator_are_survived),
      cmocka_unit_test(defective_pixels_do_not_stop_the_rig),
      cmocka_unit_test(the_patch_tells_pictures_apart),
      cmocka_unit_test(a_device_that_keeps_failing_is_refused_with_numbers),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
