#include <pthread.h>

#include "base/clock.h"
#include "base/mailbox.h"
#include "support.h"

static int dropped;

static void count_drop(void *letter) {
  free(letter);
  dropped++;
}

static int *letter(int value) {
  int *box = malloc(sizeof *box);
  assert_non_null(box);
  *box = value;
  return box;
}

static void newest_letter_wins(void **state) {
  (void)state;
  clt_error error = {0};
  clt_mailbox *mailbox = NULL;
  assert_ok(clt_mailbox_create(count_drop, &mailbox, &error), error);
  dropped = 0;
  assert_null(clt_mailbox_take(mailbox, 0));
  for (int i = 1; i <= 3; i++) {
    clt_mailbox_put(mailbox, letter(i));
  }
  int *got = clt_mailbox_take(mailbox, 0);
  assert_int_equal(*got, 3);
  free(got);
  assert_int_equal(dropped, 2);
  clt_mailbox_put(mailbox, letter(4));
  clt_mailbox_destroy(mailbox);
  assert_int_equal(dropped, 3);
  clt_mailbox_destroy(NULL);
}

static void *put_later(void *mailbox) {
  usleep(30000);
  clt_mailbox_put(mailbox, letter(7));
  return NULL;
}

static void take_waits_for_a_letter_and_for_no_longer_than_asked(void **state) {
  (void)state;
  clt_error error = {0};
  clt_mailbox *mailbox = NULL;
  assert_ok(clt_mailbox_create(free, &mailbox, &error), error);
  int64_t start = clt_clock_ns();
  assert_null(clt_mailbox_take(mailbox, 0.02));
  assert_true(clt_clock_since(start) >= 0.0199);
  pthread_t thread;
  assert_int_equal(pthread_create(&thread, NULL, put_later, mailbox), 0);
  int *got = clt_mailbox_take(mailbox, -1);
  assert_int_equal(*got, 7);
  free(got);
  pthread_join(thread, NULL);
  clt_mailbox_close(mailbox);
  assert_null(clt_mailbox_take(mailbox, -1));
  clt_mailbox_destroy(mailbox);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(newest_letter_wins),
      cmocka_unit_test(take_waits_for_a_letter_and_for_no_longer_than_asked),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
