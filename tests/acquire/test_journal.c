/* Acquisitions that are interrupted and go on from their journal. */
#include <signal.h>
#include <sys/wait.h>

#include "counterlight/acquire.h"
#include "dihedral.h"
#include "fake_rig.h"

enum { WIDTH = 16, HEIGHT = 12, CELLS = WIDTH * HEIGHT };

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
    const long all = clean.patterns, killed = 2 + (long)((double)(all - 3) * test_random(&random));
    acquire_killed(exact, path, schemes[n], killed);
    fake_rig rig = noisy_rig(exact);
    clt_transport *resumed = acquire(&rig, path, schemes[n]);
    assert_int_equal(rig.patterns, clt_transport_origin(resumed)->patterns - (killed - 1));
    clt_transport_destroy(resumed);
    assert_int_equal(unlink(path), 0);
    /* the journal of a whole one repeats it without a single pattern */
    clean.patterns = 0;
    resumed = acquire(&clean, path, schemes[n]);
    assert_same(whole, resumed);
    clt_transport_destroy(resumed);
    rig = noisy_rig(exact);
    resumed = acquire(&rig, path, schemes[n]);
    assert_int_equal(rig.patterns, 0);
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
  assert_true(all > 20);
  static const struct {
    long records, more;
    bool flip;
  } cases[] = {{10, 0, false}, {10, 5, false}, {7, 30, false}, {5, 800, true}, {0, -3, false}, {0, 0, false}};
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
    assert_int_equal(clean.patterns, all - cases[n].records);
    assert_same(whole, resumed);
    clt_transport_destroy(resumed);
  }
  clt_transport_destroy(whole);
  free(exact);
  unlink(path);
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
      cmocka_unit_test(another_rig_s_journal_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
