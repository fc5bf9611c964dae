#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>

#include "base/file.h"
#include "support.h"

static int entries_in(const char *folder) {
  DIR *stream = opendir(folder);
  assert_non_null(stream);
  int count = -2; /* "." and ".." */
  while (readdir(stream) != NULL) {
    count++;
  }
  closedir(stream);
  return count;
}

static void content_is(const char *path, const char *wanted) {
  char text[64] = "";
  FILE *file = fopen(path, "r");
  assert_non_null(file);
  assert_true(fread(text, 1, sizeof text - 1, file) > 0);
  fclose(file);
  assert_string_equal(text, wanted);
}

static void a_file_is_replaced_whole_and_leaves_nothing_behind(void **state) {
  (void)state;
  char folder[64], path[CLT_PATH_MAX], temporary[CLT_PATH_MAX];
  clt_error error = {0};
  test_folder(folder);
  assert_ok(clt_file_join(folder, "picture.png", path, &error), error);
  assert_ok(clt_file_write(path, "old", 3, &error), error);
  content_is(path, "old");
  assert_ok(clt_file_begin(path, temporary, &error), error);
  assert_string_equal(temporary + strlen(temporary) - 4, ".png");
  FILE *half = fopen(temporary, "w");
  fputs("ne", half);
  fclose(half);
  content_is(path, "old"); /* a half-written new content is not seen */
  clt_file_abandon(temporary);
  assert_ok(clt_file_write(path, "new", 3, &error), error);
  content_is(path, "new");
  assert_int_equal(entries_in(folder), 1);
  unlink(path);
  rmdir(folder);
}

static void what_cannot_be_written_is_said(void **state) {
  (void)state;
  clt_error error = {0};
  assert_int_equal(clt_file_write("/no/such/folder/x.png", "a", 1, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "/no/such/folder"));
  assert_int_equal(clt_file_write("/tmp/", "a", 1, &error), CLT_BAD_INPUT);
  char longer[2 * CLT_PATH_MAX];
  memset(longer, 'a', sizeof longer - 1);
  longer[sizeof longer - 1] = '\0';
  char out[CLT_PATH_MAX];
  assert_int_equal(clt_file_write(longer, "a", 1, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_file_join("/tmp", longer, out, &error), CLT_BAD_INPUT);
}

static void a_target_that_is_a_folder_is_kept(void **state) {
  (void)state;
  char folder[64], path[CLT_PATH_MAX];
  clt_error error = {0};
  test_folder(folder);
  assert_ok(clt_file_join(folder, "sub", path, &error), error);
  assert_int_equal(mkdir(path, 0700), 0);
  assert_int_equal(clt_file_write(path, "a", 1, &error), CLT_FAILED);
  assert_int_equal(entries_in(folder), 1);
  rmdir(path);
  rmdir(folder);
}

static void a_text_becomes_a_file_only_where_all_went_well(void **state) {
  (void)state;
  char folder[64], path[CLT_PATH_MAX];
  clt_error error = {0};
  clt_text text;
  test_folder(folder);
  assert_ok(clt_file_join(folder, "page.html", path, &error), error);
  assert_ok(clt_text_open(&text, path, &error), error);
  fprintf(text.to, "%s", "whole");
  assert_int_equal(entries_in(folder), 0);
  assert_ok(clt_text_close(&text, CLT_OK, &error), error);
  content_is(path, "whole");
  assert_ok(clt_text_open(&text, path, &error), error);
  fprintf(text.to, "half");
  assert_int_equal(clt_text_close(&text, CLT_FAILED, &error), CLT_FAILED);
  content_is(path, "whole");
  assert_int_equal(entries_in(folder), 1);
}

static void a_stamp_is_of_a_file_as_it_is(void **state) {
  (void)state;
  char folder[64], path[CLT_PATH_MAX], stamp[CLT_STAMP_MAX];
  const struct timespec times[] = {{5, 0}, {1764158400, 7}};
  clt_error error = {0};
  test_folder(folder);
  assert_ok(clt_file_join(folder, "picture.png", path, &error), error);
  clt_file_stamp(path, stamp);
  assert_string_equal(stamp, "");
  assert_ok(clt_file_write(path, "picture", 7, &error), error);
  assert_int_equal(utimensat(AT_FDCWD, path, times, 0), 0);
  clt_file_stamp(path, stamp);
  assert_string_equal(stamp, "1764158400.000000007, 7");
  clt_file_stamp(folder, stamp);
  assert_string_equal(stamp, "");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_file_is_replaced_whole_and_leaves_nothing_behind),
      cmocka_unit_test(what_cannot_be_written_is_said),
      cmocka_unit_test(a_target_that_is_a_folder_is_kept),
      cmocka_unit_test(a_text_becomes_a_file_only_where_all_went_well),
      cmocka_unit_test(a_stamp_is_of_a_file_as_it_is),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
