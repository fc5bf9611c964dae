#include <math.h>

#include "base/file.h"
#include "support.h"
#include "tradeoff/chart.h"

static size_t read_file(const char *folder, const char *name, char *text, size_t size) {
  char path[CLT_PATH_MAX];
  clt_error error = {0};
  assert_ok(clt_file_join(folder, name, path, &error), error);
  FILE *file = fopen(path, "r");
  size_t got = file != NULL ? fread(text, 1, size - 1, file) : 0;
  text[got] = '\0';
  if (file != NULL) {
    fclose(file);
  }
  return got;
}

/* The table holds every point to nine digits; the drawing names each line, and leaves out what no logarithm has. */
static void a_chart_is_a_table_and_a_drawing(void **state) {
  (void)state;
  static char text[1 << 16];
  char folder[64];
  clt_error error = {0};
  clt_chart chart = {.title = "Decay", .across = "n", .up = "error", .log_up = true};
  clt_chart_line *line = clt_chart_add(&chart, "albedo %g", 0.5);
  clt_chart_point(line, 0, 1);
  clt_chart_point(line, 1, 0.123456789);
  clt_chart_point(line, 2, 0);
  clt_chart_point(line, 3, NAN);
  test_folder(folder);
  assert_ok(clt_chart_write(&chart, folder, "decay", &error), error);
  read_file(folder, "decay.csv", text, sizeof text);
  assert_string_equal(text, "line,x,y\n\"albedo 0.5\",0,1\n\"albedo 0.5\",1,0.123456789\n\"albedo 0.5\",2,0\n"
                            "\"albedo 0.5\",3,nan\n");
  if (!clt_chart_can_draw()) {
    print_message("gnuplot is not installed: no drawing to look at\n");
    return;
  }
  assert_true(read_file(folder, "decay.svg", text, sizeof text) > 1000);
  assert_non_null(strstr(text, "albedo 0.5"));
  assert_non_null(strstr(text, "Decay"));
}

static void a_folder_that_is_not_there_is_said(void **state) {
  (void)state;
  clt_error error = {0};
  clt_chart chart = {.title = "t", .across = "x", .up = "y"};
  clt_chart_point(clt_chart_add(&chart, "line"), 1, 1);
  assert_int_not_equal(clt_chart_write(&chart, "/nonexistent", "chart", &error), CLT_OK);
  assert_non_null(strstr(error.message, "/nonexistent"));
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_chart_is_a_table_and_a_drawing),
                                     cmocka_unit_test(a_folder_that_is_not_there_is_said)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
