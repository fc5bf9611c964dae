/* Damaged files: loading one ends in a transport or in an error with a message. A shortened file never breaks the
 * loader; of flipped bytes HDF5 1.10 itself does not survive all. */
#include <signal.h>
#include <stdbool.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "smooth.h"
#include "storages.h"

enum { DAMAGES = 200 };

/* A sanitizer, too, ends the child by a signal. */
const char *__asan_default_options(void);
const char *__asan_default_options(void) {
  return "abort_on_error=1";
}

typedef struct content {
  unsigned char *bytes;
  size_t size;
} content;

static content read_content(const char *path) {
  struct stat about;
  assert_int_equal(stat(path, &about), 0);
  content whole = {malloc((size_t)about.st_size), (size_t)about.st_size};
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  assert_int_equal(fread(whole.bytes, 1, whole.size, file), whole.size);
  fclose(file);
  return whole;
}

static void write_content(const char *path, const unsigned char *bytes, size_t size) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, size, file), size);
  fclose(file);
}

/* Loads what may be damaged; a transport that comes out must be good for products. Returns whether one did. */
static bool load_damaged(const char *path) {
  clt_transport *transport = NULL;
  clt_error error = {CLT_OK, ""};
  clt_status status = clt_transport_load(path, &transport, &error);
  if (status != CLT_OK) {
    assert_null(transport);
    assert_non_null(strstr(error.message, path));
    return false;
  }
  clt_transport_info info = clt_transport_describe(transport);
  uint64_t state = 1;
  double *x = random_vector(info.cols + info.rows, &state), *y = random_vector(info.cols + info.rows, &state);
  for (int c = 0; c < info.channels; c++) {
    clt_transport_apply(transport, c, x, y);
    for (size_t i = 0; i < info.rows; i++) {
      assert_true(isfinite(y[i]));
    }
    clt_transport_apply_transposed(transport, c, x, y);
  }
  assert_int_equal(strnlen(clt_transport_origin(transport)->source, CLT_TEXT_MAX) < CLT_TEXT_MAX, 1);
  clt_transport_destroy(transport);
  free(x);
  free(y);
  return true;
}

static void save_case(make_known make, const char *path) {
  const size_case size = {7, 5, 2, 35};
  uint64_t state = 4;
  clt_error error;
  known_transport known = make(&size, &state);
  assert_ok(clt_transport_keep_flood(known.transport, &error), error);
  strcpy(clt_transport_provenance(known.transport)->source, "a scene");
  assert_ok(clt_transport_save(known.transport, path, &error), error);
  finish_known(&known);
}

/* Loads in a child; returns whether it lived. Only HDF5 may end it, by a signal (the alarm's among them): cmocka's own
 * handlers would go on with the tests there. */
static bool survives(const char *path) {
  pid_t child = fork();
  assert_true(child >= 0);
  if (child == 0) {
    static const int crashes[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
    for (size_t i = 0; i < sizeof crashes / sizeof crashes[0]; i++) {
      signal(crashes[i], SIG_DFL);
    }
    alarm(20);
    load_damaged(path);
    _exit(0);
  }
  int outcome;
  assert_int_equal(waitpid(child, &outcome, 0), child);
  assert_true(WIFSIGNALED(outcome) || WEXITSTATUS(outcome) == 0);
  return WIFEXITED(outcome);
}

static void damage(make_known make, uint64_t seed) {
  char folder[64], path[CLT_PATH_MAX];
  snprintf(path, sizeof path, "%s/T.h5", test_folder(folder));
  save_case(make, path);
  assert_true(load_damaged(path));
  content whole = read_content(path);
  for (size_t k = 0; k < DAMAGES; k++) {
    write_content(path, whole.bytes, whole.size * k / DAMAGES);
    assert_false(load_damaged(path));
  }
  int broken = 0;
  for (size_t k = 0; k < DAMAGES; k++) {
    /* every other flip falls into the first part, where the structure of the file is */
    size_t span = k % 2 == 0 ? whole.size : whole.size / 4;
    size_t place = (size_t)((double)span * test_random(&seed));
    unsigned char before = whole.bytes[place];
    whole.bytes[place] ^= (unsigned char)(1 + 255 * test_random(&seed));
    write_content(path, whole.bytes, whole.size);
    broken += !survives(path);
    whole.bytes[place] = before;
  }
  assert_true(broken <= DAMAGES / 20);
  free(whole.bytes);
  unlink(path);
  rmdir(folder);
}

static void test_dense(void **unused) {
  (void)unused;
  damage(random_dense, 1);
}

static void test_tree(void **unused) {
  (void)unused;
  damage(random_tree, 2);
}

static void test_dense64(void **unused) {
  (void)unused;
  damage(contact_dense64, 3);
}

static void test_dense16(void **unused) {
  (void)unused;
  damage(contact_dense16, 4);
}

static void test_dense8(void **unused) {
  (void)unused;
  damage(contact_dense8, 5);
}

static void test_hierarchy(void **unused) {
  (void)unused;
  damage(random_hierarchy, 6);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_dense),   cmocka_unit_test(test_tree),
                                     cmocka_unit_test(test_dense64), cmocka_unit_test(test_dense16),
                                     cmocka_unit_test(test_dense8),  cmocka_unit_test(test_hierarchy)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
