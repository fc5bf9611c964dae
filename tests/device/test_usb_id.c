/* Names of USB devices, and how often one may be reset. */
#include "device/usb/usb.h"

#include <time.h>

#include "base/clock.h"
#include "support.h"

static void names_are_read(void **state) {
  (void)state;
  clt_usb_id id;
  clt_error error = {0};
  assert_ok(clt_usb_parse("usb:046d:0825", &id, &error), error);
  assert_int_equal(id.vendor, 0x046d);
  assert_int_equal(id.product, 0x0825);
  assert_string_equal(id.serial, "");
  assert_ok(clt_usb_parse("usb:1D6B:0104:A 1:b", &id, &error), error);
  assert_int_equal(id.vendor, 0x1d6b);
  assert_string_equal(id.serial, "A 1:b");
  assert_ok(clt_usb_parse("port:1-2.3", &id, &error), error);
  assert_string_equal(id.port, "1-2.3");
  assert_int_equal(id.vendor, -1);
}

static void wrong_names_are_refused(void **state) {
  (void)state;
  static const char *const wrong[] = {"",        "usb:",     "usb:046d",   "usb:046d:",  "usb:x:y",   "usb:046d:0825x",
                                      "port:",   "port:1",   "port:-1",    "port:1-2 3", "046d:0825", "PORT:1-2",
                                      "usb 1:2", "port:a-b", "/dev/video0"};
  char longest[300];
  clt_usb_id id;
  for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
    clt_error error = {0};
    assert_int_equal(clt_usb_parse(wrong[k], &id, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "write \""));
  }
  memset(longest, 'a', sizeof longest);
  memcpy(longest, "usb:046d:0825:", 14);
  longest[sizeof longest - 1] = '\0';
  assert_int_equal(clt_usb_parse(longest, &id, NULL), CLT_BAD_INPUT);
  memset(longest, '1', sizeof longest - 1);
  memcpy(longest, "port:1-", 7);
  assert_int_equal(clt_usb_parse(longest, &id, NULL), CLT_BAD_INPUT);
}

static void what_is_not_said_matches_all(void **state) {
  (void)state;
  const clt_usb_id device = {0x046d, 0x0825, "S1", "1-2.3"};
  static const struct {
    const char *name;
    bool matches;
  } cases[] = {{"usb:046d:0825", true},  {"usb:046d:0825:S1", true}, {"usb:046d:0825:S", false},
               {"usb:046d:0826", false}, {"usb:046e:0825", false},   {"port:1-2.3", true},
               {"port:1-2", false},      {"port:2-2.3", false}};
  for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
    clt_usb_id which;
    assert_int_equal(clt_usb_parse(cases[k].name, &which, NULL), CLT_OK);
    assert_int_equal(clt_usb_matches(&which, &device), cases[k].matches);
  }
}

/* A description is a name that is read again. */
static void descriptions_are_names(void **state) {
  (void)state;
  static const char *const names[] = {"usb:046d:0825", "usb:046d:0825:S 1", "port:3-1.4.2"};
  for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
    clt_usb_id which;
    char text[192];
    assert_int_equal(clt_usb_parse(names[k], &which, NULL), CLT_OK);
    clt_usb_describe(&which, text, sizeof text);
    assert_string_equal(text, names[k]);
  }
}

/* At once, then after 1, 2, 4 ... 64 s and 64 s for ever: asked every 100 ms of simulated time for an hour. */
static void resets_become_rare(void **state) {
  (void)state;
  static const double waits[] = {1, 2, 4, 8, 16, 32, 64};
  clt_usb_backoff backoff = {0};
  int64_t last_ns = -1;
  int resets = 0;
  for (int64_t now_ns = 5000000000; now_ns < 3605000000000; now_ns += 100000000) {
    if (!clt_usb_backoff_take(&backoff, now_ns)) {
      continue;
    }
    if (last_ns >= 0) {
      assert_near((double)(now_ns - last_ns) * 1e-9, waits[resets - 1 < 6 ? resets - 1 : 6], 0.1001);
    }
    last_ns = now_ns;
    resets++;
  }
  assert_in_range(resets, 3600 / 64, 3600 / 64 + 7);
}

/* Whoever waits for a camera that is away leaves the processor to the picture. */
static void waiting_takes_no_processor(void **state) {
  (void)state;
  const clt_usb_id nobody = {0xffff, 0xffff, "", ""};
  clt_error error = {0};
  int64_t start_ns = clt_clock_ns();
  clock_t start = clock();
  clt_status status = clt_usb_wait(&nobody, 1, &error);
  double taken_s = (double)(clock() - start) / CLOCKS_PER_SEC, passed_s = clt_clock_since(start_ns);
  if (status == CLT_FAILED) {
    skip(); /* this machine lets nobody look at USB */
  }
  assert_int_equal(status, CLT_TIMEOUT);
  assert_true(taken_s < 0.05 * passed_s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(names_are_read),
      cmocka_unit_test(wrong_names_are_refused),
      cmocka_unit_test(what_is_not_said_matches_all),
      cmocka_unit_test(descriptions_are_names),
      cmocka_unit_test(resets_become_rare),
      cmocka_unit_test(waiting_takes_no_processor),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
