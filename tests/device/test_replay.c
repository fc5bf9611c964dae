/* Recording and replaying: what went through comes back sample by sample; what does not fit or is damaged is refused.
 */
#include "counterlight/replay.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "image/samples.h"
#include "support.h"

enum { WIDTH = 13, HEIGHT = 9, CHANNELS = 3, SAMPLES = WIDTH * HEIGHT * CHANNELS, PANEL = 4 * 3, PATTERNS = 5 };

/* Devices that answer every call with noise of their own. */
typedef struct source {
  clt_projector projector;
  clt_camera camera;
  uint64_t random;
  int64_t now_ns;
  double exposure_s;
  uint32_t sequence;
  int closed;
  uint16_t samples[SAMPLES];
} source;

static source *of_projector(const clt_projector *projector) {
  return (source *)(uintptr_t)projector;
}

static source *of_camera(const clt_camera *camera) {
  return (source *)((char *)(uintptr_t)camera - offsetof(source, camera));
}

static void describe_projector(const clt_projector *projector, clt_projector_info *info) {
  (void)projector;
  *info = (clt_projector_info){4, 3, 1, 8, 1 / 60.0, false};
}

static void describe_camera(const clt_camera *camera, clt_camera_info *info) {
  (void)camera;
  *info = (clt_camera_info){.width = WIDTH,
                            .height = HEIGHT,
                            .channels = CHANNELS,
                            .bits = 12,
                            .frame_s = 1 / 30.0,
                            .exposure_min_s = 1e-4,
                            .exposure_max_s = 0.1,
                            .black_level = 64,
                            .responsivity = 3.25,
                            .full_well = 8000,
                            .read_noise = 4.5,
                            .own_pixels = true,
                            .step = 12.75};
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  (void)codes;
  (void)error;
  *shown_ns = of_projector(projector)->now_ns += 16666667;
  return CLT_OK;
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  (void)error;
  of_camera(camera)->exposure_s = seconds;
  return CLT_OK;
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  (void)timeout_s;
  (void)error;
  source *s = of_camera(camera);
  s->now_ns = (not_before_ns > s->now_ns ? not_before_ns : s->now_ns) + 1234567;
  for (int k = 0; k < SAMPLES; k++) {
    s->samples[k] = (uint16_t)(4096 * test_random(&s->random));
  }
  s->sequence += 2;
  *frame = (clt_frame){WIDTH, HEIGHT, CHANNELS, 12, s->samples, s->now_ns, s->exposure_s, s->sequence};
  return CLT_OK;
}

static void close_projector(clt_projector *projector) {
  of_projector(projector)->closed++;
}

static void close_camera(clt_camera *camera) {
  of_camera(camera)->closed++;
}

static void source_init(source *s, uint64_t seed) {
  static const clt_projector_driver projector_driver = {
      .name = "source", .describe = describe_projector, .present = present, .close = close_projector};
  static const clt_camera_driver camera_driver = {"source", describe_camera, set_exposure, next, close_camera};
  *s = (source){.projector = {&projector_driver}, .camera = {&camera_driver}, .random = seed};
}

/* Codes of a pattern, off the panel's steps by less than half of one. */
static void draw(int pattern, double off, float *codes) {
  for (int k = 0; k < PANEL; k++) {
    codes[k] = (float)(((pattern * 31 + k * 7) % 256 + off) / 255);
  }
}

/* What a program saw. */
typedef struct seen {
  int64_t shown_ns;
  clt_frame frame;
  uint16_t samples[SAMPLES];
} seen;

/* Shows the patterns and takes two frames of each, at two exposure times. */
static void use(clt_projector *projector, clt_camera *camera, double off, seen *out) {
  clt_error error = {0};
  float codes[PANEL];
  for (int p = 0; p < PATTERNS; p++) {
    int64_t shown;
    draw(p, off, codes);
    assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
    for (int k = 0; k < 2; k++, out++) {
      out->shown_ns = shown;
      assert_ok(camera->driver->set_exposure(camera, 0.01 * (k + 1), &error), error);
      assert_ok(camera->driver->next(camera, shown + 5000000, 1, &out->frame, &error), error);
      memcpy(out->samples, out->frame.samples, sizeof out->samples);
    }
  }
}

/* Records a session into a fresh folder. */
static void record(char *folder, char recording[80], seen *out) {
  source s;
  clt_projector *projector;
  clt_camera *camera;
  clt_error error = {0};
  test_folder(folder);
  snprintf(recording, 80, "%s/recording", folder);
  source_init(&s, 42);
  assert_ok(clt_recording_open(recording, &s.projector, &s.camera, &projector, &camera, &error), error);
  use(projector, camera, 0, out);
  projector->driver->close(projector);
  camera->driver->close(camera);
  assert_int_equal(s.closed, 0);
}

static void remove_folder(const char *folder) {
  char command[128];
  snprintf(command, sizeof command, "rm -r '%s'", folder);
  assert_int_equal(system(command), 0);
}

static void a_recording_comes_back_sample_by_sample(void **state) {
  (void)state;
  char folder[64], recording[80];
  static seen was[2 * PATTERNS], is[2 * PATTERNS];
  clt_projector *projector;
  clt_camera *camera;
  clt_error error = {0};
  clt_camera_info wanted, sensor;
  record(folder, recording, was);
  assert_true(clt_replay_is_recording(recording));
  assert_false(clt_replay_is_recording(folder));
  double longest_s;
  assert_ok(clt_replay_longest_exposure(recording, &longest_s, &error), error);
  assert_true(longest_s == 0.02);
  assert_ok(clt_replay_open(recording, &projector, &camera, &error), error);
  describe_camera(NULL, &wanted);
  camera->driver->describe(camera, &sensor);
  assert_true(sensor.width == wanted.width && sensor.height == wanted.height && sensor.channels == wanted.channels);
  assert_true(sensor.bits == wanted.bits && sensor.frame_s == wanted.frame_s);
  assert_true(sensor.exposure_min_s == wanted.exposure_min_s && sensor.exposure_max_s == wanted.exposure_max_s);
  assert_true(sensor.black_level == wanted.black_level && sensor.responsivity == wanted.responsivity);
  assert_true(sensor.full_well == wanted.full_well && sensor.read_noise == wanted.read_noise);
  assert_true(sensor.own_pixels == wanted.own_pixels && sensor.step == wanted.step);
  use(projector, camera, 0.3, is);
  for (int k = 0; k < 2 * PATTERNS; k++) {
    assert_int_equal(is[k].shown_ns, was[k].shown_ns);
    assert_int_equal(is[k].frame.exposed_ns, was[k].frame.exposed_ns);
    assert_true(is[k].frame.exposure_s == was[k].frame.exposure_s);
    assert_int_equal(is[k].frame.sequence, was[k].frame.sequence);
    assert_int_equal(is[k].frame.bits, 12);
    assert_memory_equal(is[k].samples, was[k].samples, sizeof was[k].samples);
  }
  clt_frame frame;
  int64_t shown;
  float codes[PANEL];
  draw(PATTERNS, 0, codes);
  assert_int_equal(camera->driver->next(camera, 0, 1, &frame, &error), CLT_GONE);
  assert_int_equal(projector->driver->present(projector, codes, &shown, &error), CLT_GONE);
  assert_non_null(strstr(error.message, "ends after 5 patterns"));
  camera->driver->close(camera);
  projector->driver->close(projector);
  remove_folder(folder);
}

static void other_patterns_and_more_frames_are_refused(void **state) {
  (void)state;
  char folder[64], recording[80];
  static seen was[2 * PATTERNS];
  clt_projector *projector;
  clt_camera *camera;
  clt_error error = {0};
  clt_frame frame;
  int64_t shown;
  float codes[PANEL];
  record(folder, recording, was);
  assert_ok(clt_replay_open(recording, &projector, &camera, &error), error);
  draw(0, 0, codes);
  assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
  assert_ok(camera->driver->next(camera, was[1].frame.exposed_ns, 1, &frame, &error), error);
  assert_int_equal(frame.sequence, was[1].frame.sequence); /* the first began too early */
  assert_int_equal(camera->driver->next(camera, 0, 1, &frame, &error), CLT_TIMEOUT);
  assert_non_null(strstr(error.message, "no more frames of pattern 1"));
  draw(1, 1, codes);
  assert_int_equal(projector->driver->present(projector, codes, &shown, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "recorded for another pattern"));
  assert_int_equal(camera->driver->set_exposure(camera, 1, &error), CLT_BAD_INPUT);
  projector->driver->close(projector);
  camera->driver->close(camera);
  source s;
  source_init(&s, 1);
  assert_int_equal(clt_recording_open(recording, &s.projector, &s.camera, &projector, &camera, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "there is a recording already"));
  remove_folder(folder);
}

/* Writes the first size bytes of text in place of a file. */
static void put(const char *path, const char *text, size_t size) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  assert_int_equal(fwrite(text, 1, size, file), size);
  fclose(file);
}

static void damaged_recordings_are_refused_with_file_and_line(void **state) {
  (void)state;
  char folder[64], recording[80], path[128], text[8192] = "";
  static seen was[2 * PATTERNS];
  clt_projector *projector;
  clt_camera *camera;
  clt_error error = {0};
  record(folder, recording, was);
  snprintf(path, sizeof path, "%s/index.txt", recording);
  FILE *file = fopen(path, "r");
  size_t size = fread(text, 1, sizeof text - 1, file);
  fclose(file);
  assert_true(size > 500 && size < sizeof text - 1);
  for (size_t cut = 0; cut < size; cut += 7) { /* every cut but those at a line's end */
    if (cut > 0 && text[cut - 1] == '\n') {
      continue;
    }
    put(path, text, cut);
    assert_int_equal(clt_replay_open(recording, &projector, &camera, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "index.txt:"));
  }
  static const char *const bad[][2] = {{"frame-000000", "../frame-000"},
                                       {"camera 13", "camera -1"},
                                       {"panel 4", "panel x"},
                                       {"counterlight-recording 1", "counterlight-recording 9"},
                                       {"frame 4 1", "frame 4 9"}};
  for (size_t n = 0; n < sizeof bad / sizeof bad[0]; n++) {
    char changed[8192];
    memcpy(changed, text, size + 1);
    char *at = strstr(changed, bad[n][0]);
    assert_non_null(at);
    memcpy(at, bad[n][1], strlen(bad[n][1]));
    put(path, changed, size);
    assert_int_equal(clt_replay_open(recording, &projector, &camera, &error), CLT_BAD_INPUT);
  }
  static char before[sizeof text]; /* as a recording that knows no step */
  char *known = strstr(text, " 12.75\n");
  assert_non_null(known);
  int length = snprintf(before, sizeof before, "%.*s%s", (int)(known - text), text, known + strlen(" 12.75"));
  put(path, before, (size_t)length);
  assert_ok(clt_replay_open(recording, &projector, &camera, &error), error);
  clt_camera_info sensor;
  camera->driver->describe(camera, &sensor);
  assert_true(sensor.step == 0 && sensor.own_pixels);
  camera->driver->close(camera);
  projector->driver->close(projector);
  put(path, text, size);
  snprintf(path, sizeof path, "%s/frame-000000.png", recording);
  put(path, "\x89PNG\r\n\x1a\nnothing", 15);
  assert_ok(clt_replay_open(recording, &projector, &camera, &error), error);
  float codes[PANEL];
  int64_t shown;
  clt_frame frame;
  draw(0, 0, codes);
  assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
  assert_int_equal(camera->driver->next(camera, 0, 1, &frame, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "frame-000000.png"));
  projector->driver->close(projector);
  camera->driver->close(camera);
  remove_folder(folder);
  assert_int_equal(clt_replay_open("/nowhere", &projector, &camera, &error), CLT_BAD_INPUT);
}

/* No file may grow beyond a limit, as on a full disk. */
static void a_full_disk_leaves_a_whole_recording(void **state) {
  (void)state;
  char folder[64], recording[80];
  source s;
  clt_projector *projector;
  clt_camera *camera;
  clt_error error = {0};
  clt_frame frame;
  struct rlimit before, tight = {700, 700};
  test_folder(folder);
  snprintf(recording, sizeof recording, "%s/recording", folder);
  source_init(&s, 3);
  float codes[PANEL];
  int64_t shown;
  assert_ok(clt_recording_open(recording, &s.projector, &s.camera, &projector, &camera, &error), error);
  draw(0, 0, codes);
  assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
  s.exposure_s = 0.01;
  assert_ok(camera->driver->next(camera, 0, 1, &frame, &error), error);
  signal(SIGXFSZ, SIG_IGN);
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
  tight.rlim_max = before.rlim_max;
  assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
  clt_status status = camera->driver->next(camera, 0, 1, &frame, &error);
  assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
  assert_int_equal(status, CLT_FAILED);
  assert_non_null(strstr(error.message, "free some space"));
  projector->driver->close(projector);
  camera->driver->close(camera);
  assert_ok(clt_replay_open(recording, &projector, &camera, &error), error);
  assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
  assert_ok(camera->driver->next(camera, 0, 1, &frame, &error), error);
  assert_int_equal(camera->driver->next(camera, 0, 1, &frame, &error), CLT_GONE);
  projector->driver->close(projector);
  camera->driver->close(camera);
  remove_folder(folder);
}

static void write_picture(const char *folder, const char *name, int width, uint16_t value) {
  char path[128];
  uint16_t samples[64];
  clt_error error = {0};
  for (int k = 0; k < width * 2; k++) {
    samples[k] = (uint16_t)(value + k);
  }
  snprintf(path, sizeof path, "%s/%s", folder, name);
  const clt_samples picture = {width, 2, 1, 16, samples};
  assert_ok(clt_samples_write(path, &picture, &error), error);
}

/* Presents and takes one frame of each picture; their first samples must be those. */
static void check_pictures(const char *path, const int *values, int count) {
  clt_projector *projector;
  clt_camera *camera;
  clt_error error = {0};
  clt_frame frame;
  int64_t shown;
  int pictures;
  float codes[64] = {0};
  assert_ok(clt_replay_open_pictures(path, 8, 6, &projector, &camera, &pictures, &error), error);
  assert_int_equal(pictures, count);
  for (int k = 0; k < count; k++) {
    assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
    assert_ok(camera->driver->set_exposure(camera, 0.02, &error), error);
    assert_ok(camera->driver->next(camera, shown + 1000, 1, &frame, &error), error);
    assert_int_equal(frame.samples[0], values[k]);
    assert_int_equal(frame.samples[7], values[k] + 7);
    assert_true(frame.exposed_ns >= shown + 1000 && frame.exposure_s == 0.02 && frame.bits == 16);
    clt_status once_more = camera->driver->next(camera, 0, 1, &frame, &error);
    assert_int_equal(once_more, k + 1 < count ? CLT_TIMEOUT : CLT_GONE);
  }
  assert_int_equal(projector->driver->present(projector, codes, &shown, &error), CLT_GONE);
  camera->driver->close(camera);
  projector->driver->close(projector);
}

static void pictures_are_served_in_the_order_of_names_or_list(void **state) {
  (void)state;
  char folder[64], path[128];
  clt_projector *projector;
  clt_camera *camera;
  clt_error error = {0};
  int pictures;
  test_folder(folder);
  assert_int_equal(clt_replay_open_pictures(folder, 8, 6, &projector, &camera, &pictures, &error), CLT_BAD_INPUT);
  write_picture(folder, "b.png", 4, 2000);
  write_picture(folder, "a.png", 4, 1000);
  write_picture(folder, "c.png", 4, 3000);
  check_pictures(folder, (const int[]){1000, 2000, 3000}, 3);
  snprintf(path, sizeof path, "%s/other.yaml", folder);
  static const char list[] = "%YAML:1.0\nsize: 3\nnames:\n   - \"c.png\"\n   - \"a.png\"\n";
  put(path, list, sizeof list - 1);
  check_pictures(path, (const int[]){3000, 1000}, 2);
  put(path, "%YAML:1.0\nsize: 3\n", 18);
  assert_int_equal(clt_replay_open_pictures(path, 8, 6, &projector, &camera, &pictures, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "no sequence of names"));
  snprintf(path, sizeof path, "%s/list.yaml", folder);
  put(path, list, sizeof list - 1);
  check_pictures(folder, (const int[]){3000, 1000}, 2);
  write_picture(folder, "a.png", 5, 1000);
  assert_ok(clt_replay_open_pictures(folder, 8, 6, &projector, &camera, &pictures, &error), error);
  int64_t shown;
  clt_frame frame;
  float codes[64] = {0};
  assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
  assert_ok(projector->driver->present(projector, codes, &shown, &error), error);
  assert_int_equal(camera->driver->next(camera, 0, 1, &frame, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "a.png: has 5 x 2"));
  projector->driver->close(projector);
  camera->driver->close(camera);
  remove_folder(folder);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_recording_comes_back_sample_by_sample),
      cmocka_unit_test(other_patterns_and_more_frames_are_refused),
      cmocka_unit_test(damaged_recordings_are_refused_with_file_and_line),
      cmocka_unit_test(a_full_disk_leaves_a_whole_recording),
      cmocka_unit_test(pictures_are_served_in_the_order_of_names_or_list),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
