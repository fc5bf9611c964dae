#include <stdbool.h>
#include <sys/stat.h>

#include "base/places.h"
#include "support.h"

static const char *const names[] = {"RUNTIME_DIRECTORY", "STATE_DIRECTORY",     "XDG_RUNTIME_DIR",
                                    "XDG_STATE_HOME",    "COUNTERLIGHT_SOCKET", "HOME"};

static int clean(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
    unsetenv(names[i]);
  }
  return 0;
}

static void systemd_and_the_environment_name_places(void **state) {
  (void)state;
  clt_error error = {0};
  char path[CLT_PATH_MAX];
  setenv("RUNTIME_DIRECTORY", "/run/a:/run/b", 1);
  assert_ok(clt_place_own_socket(path, &error), error);
  assert_string_equal(path, "/run/a/control.sock");
  setenv("STATE_DIRECTORY", "/var/lib/a:/var/lib/b", 1);
  assert_ok(clt_place_state(path, &error), error);
  assert_string_equal(path, "/var/lib/a");
  setenv("COUNTERLIGHT_SOCKET", "/x:y/s", 1);
  assert_ok(clt_place_socket(path, &error), error);
  assert_string_equal(path, "/x:y/s");
}

static void a_client_falls_back_to_the_systems_daemon(void **state) {
  (void)state;
  clt_error error = {0};
  char path[CLT_PATH_MAX];
  setenv("RUNTIME_DIRECTORY", "/no/such/folder", 1);
  assert_ok(clt_place_socket(path, &error), error);
  assert_string_equal(path, "/run/counterlight/control.sock");
}

static void users_have_places_of_their_own(void **state) {
  (void)state;
  clt_error error = {0};
  char path[CLT_PATH_MAX];
  bool root = geteuid() == 0;
  setenv("HOME", "/home/a", 1);
  assert_ok(clt_place_state(path, &error), error);
  assert_string_equal(path, root ? "/var/lib/counterlight" : "/home/a/.local/state/counterlight");
  assert_ok(clt_place_own_socket(path, &error), error);
  assert_string_equal(path, root ? "/run/counterlight/control.sock" : "/home/a/.local/state/counterlight/control.sock");
  setenv("XDG_RUNTIME_DIR", "/run/user/7", 1);
  assert_ok(clt_place_own_socket(path, &error), error);
  assert_string_equal(path, root ? "/run/counterlight/control.sock" : "/run/user/7/counterlight/control.sock");
}

static void too_long_places_are_refused(void **state) {
  (void)state;
  clt_error error = {0};
  char path[CLT_PATH_MAX], longer[2 * CLT_PATH_MAX];
  memset(longer, 'a', sizeof longer - 1);
  longer[sizeof longer - 1] = '\0';
  setenv("COUNTERLIGHT_SOCKET", longer, 1);
  assert_int_equal(clt_place_socket(path, &error), CLT_BAD_INPUT);
}

static void folders_are_made_with_those_above(void **state) {
  (void)state;
  clt_error error = {0};
  char top[64], path[96];
  struct stat found;
  test_folder(top);
  snprintf(path, sizeof path, "%s/a/b", top);
  assert_ok(clt_place_make_folder(path, 0700, &error), error);
  assert_ok(clt_place_make_folder(path, 0755, &error), error);
  assert_int_equal(stat(path, &found), 0);
  assert_int_equal(found.st_mode & 0777, 0700);
  assert_int_equal(clt_place_make_folder("/proc/nowhere/at/all", 0700, &error), CLT_FAILED);
  rmdir(path);
  snprintf(path, sizeof path, "%s/a", top);
  rmdir(path);
  rmdir(top);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(systemd_and_the_environment_name_places, clean, clean),
      cmocka_unit_test_setup_teardown(a_client_falls_back_to_the_systems_daemon, clean, clean),
      cmocka_unit_test_setup_teardown(users_have_places_of_their_own, clean, clean),
      cmocka_unit_test_setup_teardown(too_long_places_are_refused, clean, clean),
      cmocka_unit_test(folders_are_made_with_those_above),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
