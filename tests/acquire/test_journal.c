/* Acquisitions that are interrupted and go on from their journal. */
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>

#include "counterlight/acquire.h"
#include "dihedral.h"
#include "fake_rig.h"

/* A random picture, black and white come first, four times each at least and here at most eight; white, four of black
 * and the picture confirm them. */
enum { WIDTH = 16, HEIGHT = 12, CELLS = WIDTH * HEIGHT, FIRST = 1 + 8 + 8, CONFIRM = 6 };

static clt_acquire_options options_with(const char *journal, const char *scheme) {
  return (clt_acquire_options){.scheme = scheme, .error = 0.01, .checks = 1, .journal = journal};
}

/* Noise that depends on how many patterns were shown, as on a real rig. */
static fake_rig noisy_rig(const double *exact) {
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  rig.dark = 1e-4;
  return rig;
}

/* Acquires in a process of its own that is killed when it has shown `patterns`. */
static void acquire_killed(const double *exact, const char *journal, const char *scheme, long patterns) {
  const pid_t child = fork();
  assert_true(child >= 0);
  if (child == 0) {
    fake_rig rig = noisy_rig(exact);
    rig.dies_at = patterns;
    clt_transport *transport = NULL;
    clt_acquire_options options = options_with(journal, scheme);
    clt_acquire(&rig.base, &options, &transport, NULL);
    _exit(0);
  }
  int ended = 0;
  assert_int_equal(waitpid(child, &ended, 0), child);
  assert_true(WIFSIGNALED(ended) && WTERMSIG(ended) == SIGKILL);
}

static clt_transport *acquire(fake_rig *rig, const char *journal, const char *scheme) {
  clt_transport *transport = NULL;
  clt_error error = {0};
  clt_acquire_options options = options_with(journal, scheme);
  assert_ok(clt_acquire(&rig->base, &options, &transport, &error), error);
  return transport;
}

static void assert_same(const clt_transport *a, const clt_transport *b) {
  double x[CELLS], y[CELLS], z[CELLS];
  uint64_t state = 3;
  for (int j = 0; j < CELLS; j++) {
    x[j] = test_random(&state);
  }
  clt_transport_apply(a, 0, x, y);
  clt_transport_apply(b, 0, x, z);
  assert_memory_equal(y, z, sizeof y);
  assert_memory_equal(clt_transport_sigma(a, 0), clt_transport_sigma(b, 0), CELLS * sizeof(float));
}

/* Without noise the same T bit for bit; with noise that starts anew the first observations are the old ones. */
static void a_killed_acquisition_goes_on(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  static const char *const schemes[] = {"blocks", "hierarchical", "brute"};
  uint64_t random = 21;
  for (int n = 0; n < 3; n++) {
    fake_rig clean = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
    clt_transport *whole = acquire(&clean, NULL, schemes[n]);
    const long all = clean.patterns, killed = FIRST + 1 + (long)((double)(all - FIRST - 1) * test_random(&random));
    acquire_killed(exact, path, schemes[n], killed);
    fake_rig rig = noisy_rig(exact);
    clt_transport *resumed = acquire(&rig, path, schemes[n]);
    assert_int_equal(rig.patterns, clt_transport_origin(resumed)->patterns - (killed - 1));
    clt_transport_destroy(resumed);
    assert_int_equal(unlink(path), 0);
    /* the journal of a whole one repeats it with no more patterns than confirm it */
    clean.patterns = 0;
    resumed = acquire(&clean, path, schemes[n]);
    assert_same(whole, resumed);
    clt_transport_destroy(resumed);
    rig = noisy_rig(exact);
    resumed = acquire(&rig, path, schemes[n]);
    assert_int_equal(rig.patterns, CONFIRM);
    assert_same(whole, resumed);
    clt_transport_destroy(resumed);
    clt_transport_destroy(whole);
    unlink(path);
  }
  free(exact);
  rmdir(folder);
}

/* Cut off at every kind of place, or with a byte changed: what is whole before that is used, the rest made again. */
static void a_damaged_journal_is_used_as_far_as_it_is_whole(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  fake_rig clean = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  clt_transport *whole = acquire(&clean, path, "blocks");
  const long all = clean.patterns, record = 24 + 2 * CELLS * (long)sizeof(float), head = 24;
  assert_true(all > 25);
  static const struct {
    long records, more;
    bool flip;
  } cases[] = {{25, 0, false}, {25, 5, false}, {22, 30, false}, {19, 800, true}, {0, -3, false}, {0, 0, false}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    const long at = head + cases[n].records * record + cases[n].more;
    if (cases[n].flip) {
      FILE *file = fopen(path, "r+");
      fseek(file, at, SEEK_SET);
      int byte = fgetc(file);
      fseek(file, at, SEEK_SET);
      fputc(byte ^ 4, file);
      fclose(file);
    } else {
      assert_int_equal(truncate(path, at), 0);
    }
    clean.patterns = 0;
    clt_transport *resumed = acquire(&clean, path, "blocks");
    assert_int_equal(clean.patterns, all - cases[n].records + (cases[n].records > 0 ? CONFIRM : 0));
    assert_same(whole, resumed);
    clt_transport_destroy(resumed);
  }
  clt_transport_destroy(whole);
  free(exact);
  unlink(path);
  rmdir(folder);
}

/* What was observed before black and white were complete is of no use. */
static void an_early_interruption_begins_anew(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  fake_rig clean = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  clt_transport *whole = acquire(&clean, NULL, "hierarchical");
  acquire_killed(exact, path, "hierarchical", 10);
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
  clt_transport *again = acquire(&rig, path, "hierarchical");
  assert_int_equal(rig.patterns, FIRST - 9 + clean.patterns + 1);
  assert_same(whole, again);
  clt_transport_destroy(whole);
  clt_transport_destroy(again);
  unlink(path);
  free(exact);
  rmdir(folder);
}

/* The camera goes when black, white and 60 columns of 192 have been observed. */
static void interrupt(const double *exact, const char *path, const char *scheme) {
  unlink(path);
  fake_rig rig = noisy_rig(exact);
  rig.fails_with = CLT_GONE;
  rig.fails_at = FIRST + 60;
  clt_acquire_options options = options_with(path, scheme);
  options.journal_dispensable = true;
  clt_transport *transport = NULL;
  clt_error error = {0};
  assert_int_equal(clt_acquire(&rig.base, &options, &transport, &error), CLT_GONE);
}

static clt_transport *acquire_soon(fake_rig *rig, const char *journal, const char *scheme, int watch) {
  clt_transport *transport = NULL;
  clt_error error = {0};
  clt_acquire_options options = options_with(journal, scheme);
  options.patience_s = 0.05;
  options.watch = watch;
  assert_ok(clt_acquire(&rig->base, &options, &transport, &error), error);
  return transport;
}

/* ||T x - exact x|| / ||exact x|| of a random x. */
static double error_of(const clt_transport *transport, const double *exact) {
  double x[CELLS], y[CELLS], wrong = 0, light = 0;
  uint64_t state = 9;
  for (int j = 0; j < CELLS; j++) {
    x[j] = test_random(&state);
  }
  clt_transport_apply(transport, 0, x, y);
  for (int i = 0; i < CELLS; i++) {
    double wanted = 0;
    for (int j = 0; j < CELLS; j++) {
      wanted += exact[i * CELLS + j] * x[j];
    }
    wrong += (y[i] - wanted) * (y[i] - wanted);
    light += wanted * wanted;
  }
  return sqrt(wrong / light);
}

/* Pixels that see `part` of the neighbouring cell: a camera that was moved. */
static double *moved(const double *exact, double part) {
  double *out = malloc(sizeof *out * CELLS * CELLS);
  for (int i = 0; i < CELLS; i++) {
    const int next = i % WIDTH + 1 < WIDTH ? i + 1 : i;
    for (int j = 0; j < CELLS; j++) {
      out[i * CELLS + j] = (1 - part) * exact[i * CELLS + j] + part * exact[next * CELLS + j];
    }
  }
  return out;
}

/* Surfaces of 20 cells that give 0.9 of the light, and what they throw at others. */
static double *repainted(const double *exact) {
  double *out = malloc(sizeof *out * CELLS * CELLS);
  for (int i = 0; i < CELLS; i++) {
    const bool in = i % WIDTH >= 2 && i % WIDTH < 7 && i / WIDTH >= 3 && i / WIDTH < 7;
    for (int j = 0; j < CELLS; j++) {
      out[i * CELLS + j] = (in ? 0.9 : 1) * exact[i * CELLS + j];
    }
  }
  return out;
}

static double *scaled(const double *exact, double gain) {
  double *out = malloc(sizeof *out * CELLS * CELLS);
  for (int k = 0; k < CELLS * CELLS; k++) {
    out[k] = gain * exact[k];
  }
  return out;
}

/* What is different after the interruption is noticed, and T is that of the room as it is: without a single old value.
 */
static void what_changed_meanwhile_is_noticed(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  const struct {
    double *now;
    double black;
  } cases[] = {{moved(exact, 0.05), 0.01},
               {repainted(exact), 0.01},
               {scaled(exact, 1.05), 0.01},
               {scaled(exact, 0.5), 0.01},
               {scaled(exact, 1), 0.0104}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    interrupt(exact, path, "brute");
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, cases[n].now, 1);
    rig.dark = 1e-4;
    rig.black = cases[n].black;
    rig.random = 77;
    clt_transport *transport = acquire_soon(&rig, path, "brute", 0);
    const clt_provenance *origin = clt_transport_origin(transport);
    assert_null(strstr(origin->plan, "before an interruption"));
    assert_true(rig.patterns > FIRST + CELLS);
    fake_rig fresh = rig;
    clt_transport *whole = acquire_soon(&fresh, NULL, "brute", 0);
    const double error = error_of(transport, cases[n].now), expected = error_of(whole, cases[n].now);
    print_message("case %zu: error %.4f, measured at once %.4f\n", n, error, expected);
    assert_true(error < 1.3 * expected);
    clt_transport_destroy(transport);
    clt_transport_destroy(whole);
    free(cases[n].now);
  }
  unlink(path);
  free(exact);
  rmdir(folder);
}

/* Below what is noticed: T that is made of both is as exact as the tolerance, and without a change as one measured at
 * once. */
static void what_is_not_noticed_does_little_harm(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  double *const rooms[] = {scaled(exact, 1), scaled(exact, 1.008), moved(exact, 0.008)};
  for (size_t n = 0; n < sizeof rooms / sizeof rooms[0]; n++) {
    double most = 0;
    for (int seed = 0; seed < 2; seed++) {
      interrupt(exact, path, "brute");
      fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, rooms[n], 1);
      rig.dark = 1e-4;
      rig.random = 500 + (uint64_t)seed;
      clt_transport *transport = acquire_soon(&rig, path, "brute", 0);
      assert_int_equal(rig.patterns, clt_transport_origin(transport)->patterns - (FIRST + 59));
      assert_non_null(strstr(clt_transport_origin(transport)->plan, "76 patterns from before an interruption"));
      most = fmax(most, error_of(transport, rooms[n]));
      clt_transport_destroy(transport);
    }
    print_message("room %zu: error %.4f\n", n, most);
    assert_true(most < (n == 0 ? 0.003 : 0.013));
    free(rooms[n]);
  }
  unlink(path);
  free(exact);
  rmdir(folder);
}

/* Where looks take a lamp out, one that drifted meanwhile is no other room. */
static void a_lamp_that_drifted_is_taken_out_by_looks(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7), *dimmed = scaled(exact, 0.95);
  interrupt(exact, path, "brute");
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, dimmed, 1);
  rig.dark = 1e-4;
  rig.random = 31;
  clt_transport *transport = acquire_soon(&rig, path, "brute", 25);
  assert_non_null(strstr(clt_transport_origin(transport)->plan, "before an interruption"));
  assert_true(error_of(transport, exact) < 0.005);
  clt_transport_destroy(transport);
  unlink(path);
  free(dimmed);
  free(exact);
  rmdir(folder);
}

/* One that can be done without is begun anew where it is another's or too old, and left out where it cannot be. */
static void a_dispensable_journal_stops_nothing(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  const struct {
    const char *of, *path;
    int age_s;
    bool resumes;
  } cases[] = {{"this", path, 0, true},
               {"that", path, 0, false},
               {"this", path, 200, false},
               {"this", path, 50, true},
               {"this", "/proc/none", 0, false}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    clt_acquire_options options = options_with(path, "blocks");
    options.journal_of = "this";
    options.journal_age_s = 100;
    options.journal_dispensable = true;
    options.patience_s = 0.05;
    unlink(path);
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
    rig.fails_with = CLT_GONE;
    rig.fails_at = FIRST + 10;
    clt_transport *transport = NULL;
    clt_error error = {0};
    assert_int_equal(clt_acquire(&rig.base, &options, &transport, &error), CLT_GONE);
    const struct timespec then = {.tv_sec = time(NULL) - cases[n].age_s};
    assert_int_equal(utimensat(AT_FDCWD, path, (struct timespec[2]){then, then}, 0), 0);
    options.journal_of = cases[n].of;
    options.journal = cases[n].path;
    rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
    assert_ok(clt_acquire(&rig.base, &options, &transport, &error), error);
    const bool resumed = strstr(clt_transport_origin(transport)->plan, "before an interruption") != NULL;
    assert_int_equal(resumed, cases[n].resumes);
    clt_transport_destroy(transport);
  }
  unlink(path);
  free(exact);
  rmdir(folder);
}

/* A disk that is full in the midst, here a limit of the file's size: what is wanted fails, what is dispensable goes. */
static void a_full_disk_ends_only_a_journal_that_is_wanted(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  struct rlimit before, small;
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
  small = before;
  small.rlim_cur = 20 * 2 * CELLS * sizeof(float);
  signal(SIGXFSZ, SIG_IGN);
  for (int dispensable = 0; dispensable < 2; dispensable++) {
    clt_acquire_options options = options_with(path, "blocks");
    options.journal_dispensable = dispensable != 0;
    fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1);
    clt_transport *transport = NULL;
    clt_error error = {0};
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    const clt_status status = clt_acquire(&rig.base, &options, &transport, &error);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(status, dispensable != 0 ? CLT_OK : CLT_FAILED);
    assert_int_equal(access(path, F_OK) == 0, dispensable == 0);
    assert_true(dispensable != 0 || strstr(error.message, "could not write the journal") != NULL);
    clt_transport_destroy(transport);
  }
  signal(SIGXFSZ, SIG_DFL);
  free(exact);
  rmdir(folder);
}

static void another_rig_s_journal_is_refused(void **state) {
  (void)state;
  char folder[64], path[128];
  snprintf(path, sizeof path, "%s/journal", test_folder(folder));
  double *exact = dihedral_transport(WIDTH, HEIGHT, 0.7);
  fake_rig rig = fake_rig_make(WIDTH, HEIGHT, 1, exact, 1), other = fake_rig_make(HEIGHT, WIDTH, 1, exact, 1);
  clt_transport_destroy(acquire(&rig, path, "blocks"));
  clt_transport *transport = NULL;
  clt_error error = {0};
  clt_acquire_options options = options_with(path, "blocks");
  assert_int_equal(clt_acquire(&other.base, &options, &transport, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "another rig"));
  FILE *file = fopen(path, "w");
  fputs("this is a text of more than twenty-four bytes", file);
  fclose(file);
  assert_int_equal(clt_acquire(&rig.base, &options, &transport, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "no journal"));
  unlink(path);
  options.journal = folder;
  assert_int_equal(clt_acquire(&rig.base, &options, &transport, &error), CLT_FAILED);
  free(exact);
  rmdir(folder);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_killed_acquisition_goes_on),
      cmocka_unit_test(a_damaged_journal_is_used_as_far_as_it_is_whole),
      cmocka_unit_test(an_early_interruption_begins_anew),
      cmocka_unit_test(what_changed_meanwhile_is_noticed),
      cmocka_unit_test(what_is_not_noticed_does_little_harm),
      cmocka_unit_test(a_lamp_that_drifted_is_taken_out_by_looks),
      cmocka_unit_test(a_dispensable_journal_stops_nothing),
      cmocka_unit_test(a_full_disk_ends_only_a_journal_that_is_wanted),
      cmocka_unit_test(another_rig_s_journal_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
