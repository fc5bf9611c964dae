/* Saving and loading: nothing is lost, and an earlier file survives every failure. */
#include <dirent.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "storages.h"

static void fill_all(clt_transport *transport, uint64_t *state) {
  clt_error error;
  clt_transport_info info = clt_transport_describe(transport);
  assert_ok(clt_transport_keep_flood(transport, &error), error);
  assert_ok(clt_transport_keep_sigma(transport, &error), error);
  for (int c = 0; c < info.channels; c++) {
    for (size_t i = 0; i < info.rows; i++) {
      clt_transport_black(transport, c)[i] = (float)(test_random(state) - 0.5);
      clt_transport_flood_values(transport, c)[i] = (float)test_random(state);
      clt_transport_sigma_values(transport, c)[i] = i % 5 == 0 ? INFINITY : (float)test_random(state);
    }
  }
  clt_provenance *origin = clt_transport_provenance(transport);
  strcpy(origin->scheme, "hierarchical");
  strcpy(origin->source, "Zwei W\xc3\xa4nde");
  memset(origin->response, 'r', CLT_TEXT_MAX - 1);
  origin->acquired = 1791234567;
  origin->patterns = 87;
  origin->frames = 261;
  origin->seconds = 12.0625;
  origin->error = 0.007;
}

static void assert_same_planes(const clt_transport *a, const clt_transport *b) {
  clt_transport_info info = clt_transport_describe(a);
  for (int c = 0; c < info.channels; c++) {
    assert_memory_equal(clt_transport_black(a, c), clt_transport_black(b, c), info.rows * sizeof(float));
    assert_memory_equal(clt_transport_flood(a, c), clt_transport_flood(b, c), info.rows * sizeof(float));
    assert_memory_equal(clt_transport_sigma(a, c), clt_transport_sigma(b, c), info.rows * sizeof(float));
  }
}

/* Products with a random vector agree in every bit; one entry that differs would change them. */
static void assert_same_entries(const clt_transport *a, const clt_transport *b, uint64_t *state) {
  clt_transport_info info = clt_transport_describe(a);
  double *x = random_vector(info.cols, state);
  double *ya = calloc(info.rows, sizeof *ya), *yb = calloc(info.rows, sizeof *yb);
  for (int c = 0; c < info.channels; c++) {
    clt_transport_apply(a, c, x, ya);
    clt_transport_apply(b, c, x, yb);
    assert_memory_equal(ya, yb, info.rows * sizeof *ya);
  }
  free(x);
  free(ya);
  free(yb);
}

static void round_trip(make_known make, const size_case *size, uint64_t seed) {
  clt_error error;
  char folder[64], path[CLT_PATH_MAX];
  snprintf(path, sizeof path, "%s/T.h5", test_folder(folder));
  known_transport known = make(size, &seed);
  fill_all(known.transport, &seed);
  assert_ok(clt_transport_save(known.transport, path, &error), error);
  clt_transport *loaded;
  assert_ok(clt_transport_load(path, &loaded, &error), error);
  clt_transport_info before = clt_transport_describe(known.transport), after = clt_transport_describe(loaded);
  assert_int_equal(before.width, after.width);
  assert_int_equal(before.height, after.height);
  assert_int_equal(before.channels, after.channels);
  assert_int_equal(before.rows, after.rows);
  assert_int_equal(before.cols, after.cols);
  assert_int_equal(before.bytes, after.bytes);
  assert_string_equal(before.storage, after.storage);
  assert_memory_equal(clt_transport_origin(known.transport), clt_transport_origin(loaded), sizeof(clt_provenance));
  assert_same_planes(known.transport, loaded);
  assert_same_entries(known.transport, loaded, &seed);
  clt_transport_destroy(loaded);
  finish_known(&known);
  unlink(path);
  assert_int_equal(rmdir(folder), 0); /* and no temporary file stays behind */
}

static void test_round_trips(void **unused) {
  (void)unused;
  for (size_t k = 0; k + 1 < SIZE_CASES; k++) {
    round_trip(random_dense, &size_cases[k], k);
    round_trip(random_tree, &size_cases[k], k);
  }
}

static void test_storages(void **unused) {
  (void)unused;
  for (size_t k = 0; k + 1 < SIZE_CASES; k++) {
    round_trip(contact_dense64, &size_cases[k], k);
    round_trip(contact_dense16, &size_cases[k], k);
    round_trip(contact_dense8, &size_cases[k], k);
  }
}

static void test_plain(void **unused) {
  (void)unused;
  clt_error error;
  char folder[64], path[CLT_PATH_MAX];
  snprintf(path, sizeof path, "%s/T.h5", test_folder(folder));
  clt_transport *made, *loaded;
  assert_ok(clt_transport_create_dense(3, 2, 2, 4, &made, &error), error);
  assert_ok(clt_transport_save(made, path, &error), error);
  assert_ok(clt_transport_load(path, &loaded, &error), error);
  assert_null(clt_transport_flood(loaded, 1));
  assert_null(clt_transport_sigma(loaded, 1));
  assert_null(clt_transport_flood_values(loaded, 1));
  assert_true(clt_transport_origin(loaded)->error < 0);
  assert_string_equal(clt_transport_origin(loaded)->scheme, "");
  for (int i = 0; i < 4; i++) {
    assert_near(clt_transport_black(loaded, 1)[i], 0, 0);
  }
  clt_transport_destroy(loaded);
  clt_transport_destroy(made);
  clt_transport_destroy(NULL);
  unlink(path);
  rmdir(folder);
}

static void assert_first_entry(const char *path, float wanted) {
  clt_transport *loaded;
  clt_error error;
  assert_ok(clt_transport_load(path, &loaded, &error), error);
  assert_near(clt_transport_entries(loaded, 0)[0], wanted, 0);
  clt_transport_destroy(loaded);
}

static int count_files(const char *folder) {
  DIR *listing = opendir(folder);
  int count = 0;
  for (struct dirent *entry; (entry = readdir(listing)) != NULL;) {
    count += strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0;
  }
  closedir(listing);
  return count;
}

/* A transport that loading would refuse is not saved over one that it accepts. */
static void test_bad_values(void **unused) {
  (void)unused;
  clt_error error;
  char folder[64], path[CLT_PATH_MAX];
  snprintf(path, sizeof path, "%s/T.h5", test_folder(folder));
  clt_transport *made;
  assert_ok(clt_transport_create_dense(3, 2, 1, 6, &made, &error), error);
  float *entries = clt_transport_entries(made, 0);
  entries[0] = 0.5f;
  entries[7] = -0.004f; /* within noise */
  assert_ok(clt_transport_save(made, path, &error), error);
  const float bad[] = {NAN, INFINITY, -0.006f};
  for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
    entries[8] = bad[k];
    assert_int_equal(clt_transport_save(made, path, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "/dense[0, 1, 2]"));
  }
  entries[8] = 0;
  assert_ok(clt_transport_keep_sigma(made, &error), error);
  clt_transport_sigma_values(made, 0)[5] = -1;
  assert_int_equal(clt_transport_save(made, path, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "/sigma[0, 5]"));
  clt_transport_destroy(made);
  assert_first_entry(path, 0.5f);
  assert_int_equal(count_files(folder), 1);
  unlink(path);
  rmdir(folder);
}

/* A disk that is full after `room` bytes: the save fails, the old file stays as it was, nothing is left behind. */
static void test_full_disk(void **unused) {
  (void)unused;
  clt_error error;
  char folder[64], path[CLT_PATH_MAX];
  snprintf(path, sizeof path, "%s/T.h5", test_folder(folder));
  clt_transport *made;
  assert_ok(clt_transport_create_dense(20, 10, 1, 200, &made, &error), error);
  clt_transport_entries(made, 0)[0] = 1;
  assert_ok(clt_transport_save(made, path, &error), error);
  clt_transport_entries(made, 0)[0] = 2;
  struct stat about;
  assert_int_equal(stat(path, &about), 0);
  struct rlimit before, limit;
  getrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, SIG_IGN);
  const rlim_t size = (rlim_t)about.st_size;
  const rlim_t rooms[] = {0, 1, 100, 2000, 4096, 10000, size / 2, size - 3000, size - 1};
  for (size_t k = 0; k < sizeof rooms / sizeof rooms[0]; k++) {
    limit = (struct rlimit){rooms[k], before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
    clt_status status = clt_transport_save(made, path, &error);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(status, CLT_FAILED);
    assert_non_null(strstr(error.message, "File too large"));
    assert_int_equal(count_files(folder), 1);
    assert_first_entry(path, 1);
  }
  assert_ok(clt_transport_save(made, path, &error), error);
  assert_first_entry(path, 2);
  clt_transport_destroy(made);
  unlink(path);
  rmdir(folder);
}

static void test_no_place(void **unused) {
  (void)unused;
  clt_error error;
  clt_transport *made;
  assert_ok(clt_transport_create_dense(3, 2, 1, 6, &made, &error), error);
  assert_int_equal(clt_transport_save(made, "/nonexistent/T.h5", &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "/nonexistent"));
  clt_transport_destroy(made);
  assert_int_equal(clt_transport_create_dense(16384, 16384, 4, (size_t)1 << 28, &made, &error), CLT_FAILED);
  assert_null(made);
  assert_non_null(strstr(error.message, "GiB"));
  assert_int_equal(clt_transport_create_dense(3, 2, 1, 0, &made, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_transport_create_dense(3, 2, 1, ((size_t)1 << 28) + 1, &made, &error), CLT_BAD_INPUT);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_round_trips), cmocka_unit_test(test_storages),
                                     cmocka_unit_test(test_plain),       cmocka_unit_test(test_bad_values),
                                     cmocka_unit_test(test_full_disk),   cmocka_unit_test(test_no_place)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
