/* Reading a command's words by its table of options. */
#include "support.h"

#include "cli/command.h"

static const cli_option options[] = {{"target", 't', "PIC", "a picture"},
                                     {"tolerance", 0, "X", "a number"},
                                     {"count", 'n', "N", "a whole number"},
                                     {"dual", 0, NULL, "a flag"},
                                     {NULL, 0, NULL, NULL}};
static const cli_command command = {.name = "try",
                                    .synopsis = "FILE --target PIC",
                                    .summary = "tries",
                                    .options = options,
                                    .positional_least = 1,
                                    .positional_most = 2};

typedef struct outcome {
  clt_status status;
  cli_arguments arguments;
  bool wants_help;
  clt_error error;
} outcome;

static outcome parse(int count, char *const *words) {
  outcome o = {0};
  o.status = cli_parse(&command, count, words, &o.arguments, &o.wants_help, &o.error);
  return o;
}

#define PARSE(...) parse(sizeof((char *[]){__VA_ARGS__}) / sizeof(char *), (char *[]){__VA_ARGS__})

static void takes_options_in_every_form_and_place(void **state) {
  (void)state;
  const outcome all[] = {PARSE("T.h5", "--target", "a.png", "--tolerance", "1e-3", "--dual", "-q"),
                         PARSE("--target=a.png", "-q", "--tolerance=1e-3", "--dual", "T.h5"),
                         PARSE("-ta.png", "--dual", "--quiet", "T.h5", "--tolerance", "1e-3"),
                         PARSE("-q", "-t", "a.png", "--dual", "--tolerance=1e-3", "--", "T.h5")};
  for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
    double tolerance = 7;
    clt_error error = {0};
    assert_ok(all[i].status, all[i].error);
    assert_string_equal(cli_value(&command, &all[i].arguments, "target"), "a.png");
    assert_non_null(cli_value(&command, &all[i].arguments, "dual"));
    assert_null(cli_value(&command, &all[i].arguments, "count"));
    assert_ok(cli_number(&command, &all[i].arguments, "tolerance", 0, 1, &tolerance, &error), error);
    assert_near(tolerance, 1e-3, 0);
    assert_true(all[i].arguments.quiet && !all[i].arguments.json && !all[i].wants_help);
    assert_int_equal(all[i].arguments.positional_count, 1);
    assert_string_equal(all[i].arguments.positional[0], "T.h5");
  }
}

static void words_after_two_dashes_are_no_options(void **state) {
  (void)state;
  outcome o = PARSE("--", "--target", "-q");
  assert_ok(o.status, o.error);
  assert_int_equal(o.arguments.positional_count, 2);
  assert_string_equal(o.arguments.positional[0], "--target");
  assert_false(o.arguments.quiet);
}

static void help_wins_over_what_is_missing(void **state) {
  (void)state;
  outcome o = PARSE("--help");
  assert_ok(o.status, o.error);
  assert_true(o.wants_help);
}

static void refuses_with_the_word_at_fault(void **state) {
  (void)state;
  const struct {
    outcome got;
    const char *names;
  } cases[] = {
      {PARSE("T.h5", "--colour"), "--colour"},
      {PARSE("T.h5", "-z"), "-z"},
      {PARSE("T.h5", "--targe", "a"), "--targe"},
      {PARSE("T.h5", "--target"), "--target"},
      {PARSE("T.h5", "--dual=1"), "--dual"},
      {PARSE("T.h5", "--json=1"), "--json"},
      {PARSE("--dual"), "usage: counterlight try"},
      {PARSE("a", "b", "c"), "'c'"},
      {PARSE("T.h5", "-qx"), "-q"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    assert_int_equal(cases[i].got.status, CLT_BAD_INPUT);
    if (!strstr(cases[i].got.error.message, cases[i].names)) {
      fail_msg("case %zu: '%s' does not name %s", i, cases[i].got.error.message, cases[i].names);
    }
  }
}

static void numbers_keep_to_their_range(void **state) {
  (void)state;
  static char *const bad[] = {"", "x", "1e-3x", "-1", "1.5", "nan", "inf", "1e999"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    double value = 7;
    clt_error error = {0};
    outcome o = PARSE("T.h5", "--tolerance", bad[i]);
    assert_int_equal(cli_number(&command, &o.arguments, "tolerance", 0, 1, &value, &error), CLT_BAD_INPUT);
    assert_non_null(strstr(error.message, "--tolerance"));
    assert_near(value, 7, 0);
  }
}

static void whole_numbers_are_whole(void **state) {
  (void)state;
  clt_error error = {0};
  int count = 3;
  outcome absent = PARSE("T.h5"), whole = PARSE("T.h5", "-n", "12"), half = PARSE("T.h5", "-n", "2.5");
  assert_ok(cli_integer(&command, &absent.arguments, "count", 1, 256, &count, &error), error);
  assert_int_equal(count, 3);
  assert_ok(cli_integer(&command, &whole.arguments, "count", 1, 256, &count, &error), error);
  assert_int_equal(count, 12);
  assert_int_equal(cli_integer(&command, &half.arguments, "count", 1, 256, &count, &error), CLT_BAD_INPUT);
  assert_int_equal(count, 12);
}

static void a_required_option_is_asked_for_by_name(void **state) {
  (void)state;
  const char *value = NULL;
  clt_error error = {0};
  outcome absent = PARSE("T.h5"), empty = PARSE("T.h5", "--target="), given = PARSE("T.h5", "--target", "a");
  assert_int_equal(cli_required(&command, &absent.arguments, "target", &value, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "--target PIC"));
  assert_int_equal(cli_required(&command, &empty.arguments, "target", &value, &error), CLT_BAD_INPUT);
  assert_ok(cli_required(&command, &given.arguments, "target", &value, &error), error);
  assert_string_equal(value, "a");
}

static void exit_codes_tell_bad_input_from_failure(void **state) {
  (void)state;
  clt_error error = {0};
  assert_int_equal(cli_fail(&command, (clt_fail(&error, CLT_BAD_INPUT, "wrong"), &error)), 2);
  assert_int_equal(cli_fail(&command, (clt_fail(&error, CLT_FAILED, "failed"), &error)), 1);
  assert_int_equal(cli_fail(&command, (clt_fail(&error, CLT_CANCELLED, "stopped"), &error)), 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(takes_options_in_every_form_and_place),
      cmocka_unit_test(words_after_two_dashes_are_no_options),
      cmocka_unit_test(help_wins_over_what_is_missing),
      cmocka_unit_test(refuses_with_the_word_at_fault),
      cmocka_unit_test(numbers_keep_to_their_range),
      cmocka_unit_test(whole_numbers_are_whole),
      cmocka_unit_test(a_required_option_is_asked_for_by_name),
      cmocka_unit_test(exit_codes_tell_bad_input_from_failure),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
