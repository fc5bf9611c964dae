/* Which stderr is the journal's, and what is written where it is not. What the journal gets is tested in a guest that
 * has one (guest_service.py). */
#include <sys/stat.h>

#include "daemon/journal.h"
#include "support.h"

static void the_journal_is_told_by_device_and_inode(void **state) {
  (void)state;
  char stream[64];
  int ends[2];
  struct stat found;
  assert_int_equal(pipe(ends), 0);
  assert_int_equal(fstat(ends[1], &found), 0);
  unsetenv("JOURNAL_STREAM");
  assert_false(journal_takes(ends[1]));
  snprintf(stream, sizeof stream, "%llu:%llu", (unsigned long long)found.st_dev, (unsigned long long)found.st_ino);
  setenv("JOURNAL_STREAM", stream, 1);
  assert_true(journal_takes(ends[1]));
  assert_false(journal_takes(STDIN_FILENO));
  const char *const others[] = {"", "8", "no:numbers", "1:2"};
  for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
    setenv("JOURNAL_STREAM", others[i], 1);
    assert_false(journal_takes(ends[1]));
  }
  unsetenv("JOURNAL_STREAM");
  close(ends[0]);
  close(ends[1]);
}

static void elsewhere_the_line_alone_is_written(void **state) {
  (void)state;
  char text[128] = "";
  int ends[2], before = dup(STDERR_FILENO);
  const journal_field fields[] = {{"COUNTERLIGHT_STATE", "showing"}, {"COUNTERLIGHT_WHY", ""}};
  assert_int_equal(pipe(ends), 0);
  dup2(ends[1], STDERR_FILENO);
  journal_note(CLT_LOG_INFO, "showing 100 % of it", fields, 2);
  dup2(before, STDERR_FILENO);
  assert_int_equal(read(ends[0], text, sizeof text - 1), 20);
  assert_string_equal(text, "showing 100 % of it\n");
  close(before);
  close(ends[0]);
  close(ends[1]);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_journal_is_told_by_device_and_inode),
      cmocka_unit_test(elsewhere_the_line_alone_is_written),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
