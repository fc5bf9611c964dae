/* What systemd hears, through a socket of its kind. */
#include <sys/socket.h>
#include <sys/un.h>

#include "daemon/notify.h"
#include "support.h"

static int manager;
static char folder[64], path[96];

static int set_up(void **state) {
  (void)state;
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  test_folder(folder);
  snprintf(path, sizeof path, "%s/notify", folder);
  strcpy(address.sun_path, path);
  manager = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
  assert_int_equal(bind(manager, (struct sockaddr *)&address, sizeof address), 0);
  setenv("NOTIFY_SOCKET", path, 1);
  return 0;
}

static int tear_down(void **state) {
  (void)state;
  unsetenv("NOTIFY_SOCKET");
  unsetenv("WATCHDOG_USEC");
  close(manager);
  unlink(path);
  rmdir(folder);
  return 0;
}

/* The next message, "" where there is none. */
static const char *hear(void) {
  static char text[512];
  ssize_t count = recv(manager, text, sizeof text - 1, 0);
  text[count > 0 ? count : 0] = '\0';
  return text;
}

static void ready_is_said_once_and_again_after_a_reload(void **state) {
  (void)state;
  notifier self;
  notify_init(&self);
  notify_reloaded(&self);
  assert_string_equal(hear(), "");
  notify_picture(&self);
  notify_picture(&self);
  assert_string_equal(hear(), "READY=1");
  assert_string_equal(hear(), "");
  notify_reloading();
  assert_int_equal(strncmp(hear(), "RELOADING=1\nMONOTONIC_USEC=", 27), 0);
  notify_reloaded(&self);
  assert_string_equal(hear(), "READY=1");
  notify_status("showing x");
  assert_string_equal(hear(), "STATUS=showing x");
  notify_stopping();
  assert_string_equal(hear(), "STOPPING=1");
}

static void a_stuck_output_starves_the_watchdog(void **state) {
  (void)state;
  notifier self;
  setenv("WATCHDOG_USEC", "123456", 1);
  notify_init(&self);
  assert_int_equal(self.watchdog_usec, 123456);
  notify_turns(&self, 5);
  assert_string_equal(hear(), "WATCHDOG=1");
  notify_turns(&self, 5);
  assert_string_equal(hear(), "");
  notify_turns(&self, 6);
  assert_string_equal(hear(), "WATCHDOG=1");
}

/* While devices are opened the watchdog waits longer, but not for ever; a unit that is more patient still is obeyed. */
static void patience_is_granted_and_taken_back(void **state) {
  (void)state;
  notifier self;
  setenv("WATCHDOG_USEC", "1500000", 1);
  notify_init(&self);
  notify_patience(&self, true);
  assert_string_equal(hear(), "WATCHDOG_USEC=120000000");
  notify_patience(&self, true);
  assert_string_equal(hear(), "");
  notify_patience(&self, false);
  assert_string_equal(hear(), "WATCHDOG_USEC=1500000");
  setenv("WATCHDOG_USEC", "600000000", 1);
  notify_init(&self);
  notify_patience(&self, true);
  assert_string_equal(hear(), "WATCHDOG_USEC=600000000");
  unsetenv("WATCHDOG_USEC");
  notify_init(&self);
  notify_patience(&self, true);
  notify_turns(&self, 5);
  assert_string_equal(hear(), "");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(ready_is_said_once_and_again_after_a_reload, set_up, tear_down),
      cmocka_unit_test_setup_teardown(a_stuck_output_starves_the_watchdog, set_up, tear_down),
      cmocka_unit_test_setup_teardown(patience_is_granted_and_taken_back, set_up, tear_down),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
