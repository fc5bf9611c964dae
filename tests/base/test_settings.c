#include "base/settings.h"
#include "support.h"

/* Reads the little format below from text; returns the message of the first problem, "" where there is none. */
static const char *read_text(const char *text, double *width, int *colour) {
  static clt_error error;
  static const char *const colours[] = {"red", "green", NULL};
  char path[] = "/tmp/counterlight-settings-XXXXXX";
  int descriptor = mkstemp(path);
  assert_true(descriptor >= 0);
  assert_int_equal(write(descriptor, text, strlen(text)), strlen(text));
  close(descriptor);
  clt_settings *settings = NULL;
  error = (clt_error){0};
  if (clt_settings_open(path, &settings, &error) == CLT_OK) {
    clt_section root = clt_settings_root(settings);
    *width = clt_read_number(clt_section_group(root, "grid"), "width", 5, 1, 100);
    *colour = clt_read_choice(root, "colour", 1, colours);
    clt_section_leave(root, "other");
    for (int i = 0; i < clt_section_count(root, "walls"); i++) {
      clt_section wall = clt_section_item(root, "walls", i);
      double corner[3];
      if (clt_read_numbers(wall, "corner", corner, 3, 3, -10, 10) == 0) {
        clt_section_fail(wall, NULL, "a wall needs a corner");
      }
      clt_read_integer(wall, "elements", 8, 1, 64);
      clt_read_flag(wall, "lit", true);
    }
    clt_settings_finish(settings, &error);
    clt_settings_close(settings);
  }
  unlink(path);
  return error.message;
}

static void good_files_are_read(void **state) {
  (void)state;
  double width;
  int colour;
  assert_string_equal(read_text("", &width, &colour), "");
  assert_near(width, 5, 0);
  assert_int_equal(colour, 1);
  const char *text =
      "grid = { width = 7; };\ncolour = \"red\";\nother = { any = ( { thing = 1; } ); };\n"
      "walls = ( { corner = (1, 2.5, -3); }, { corner = [0.0, 0.0, 0.0]; elements = 3; lit = false; } );";
  assert_string_equal(read_text(text, &width, &colour), "");
  assert_near(width, 7, 0);
  assert_int_equal(colour, 0);
}

static void mistakes_are_named_with_line_key_and_range(void **state) {
  (void)state;
  static const struct {
    const char *text, *wanted;
  } cases[] = {
      {"\ngrid = { width = 700; };", ":2: width: is 700; legal is 1 to 100"},
      {"grid = { width = \"wide\"; };", ":1: width: must be a number"},
      {"grid = { width = 5;\n hight = 6; };", ":2: hight: is not a known key"},
      {"grid = 5;", ":1: grid: must be a group"},
      {"colour = \"blue\";", "is \"blue\"; legal is \"red\", \"green\""},
      {"walls = ( { corner = [1, 2]; } );", "corner: has 2 values; legal is 3 to 3"},
      {"walls = ( { corner = [1, 2, 3]; elements = 2.5; } );", "must be a whole number"},
      {"walls = ( { corner = [1, 2, 3]; lit = 1; } );", "lit: must be true or false"},
      {"walls = ( {\n lit = true; } );", "a wall needs a corner"},
      {"walls = ( 1, 2 );", "must be a list of groups"},
      {"walls = ( { corner = [1, 2, 11]; } );", "is 11; legal is -10 to 10"},
      {"grid = { width = ", "syntax error"},
      {"surprise = 1;", ":1: surprise: is not a known key"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    double width;
    int colour;
    const char *message = read_text(cases[i].text, &width, &colour);
    if (strstr(message, cases[i].wanted) == NULL) {
      fail_msg("%s gave \"%s\", wanted \"%s\"", cases[i].text, message, cases[i].wanted);
    }
  }
  clt_error error = {0};
  clt_settings *settings = NULL;
  assert_int_equal(clt_settings_open("/no/such/file.cfg", &settings, &error), CLT_BAD_INPUT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(good_files_are_read),
      cmocka_unit_test(mistakes_are_named_with_line_key_and_range),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
