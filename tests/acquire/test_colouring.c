#include "acquire/colouring.h"
#include "support.h"

/* A random row list: `length` or fewer distinct columns a row. */
static int64_t draw_rows(uint64_t *random, size_t rows, int length, int32_t columns, int64_t *start, int32_t *column) {
  start[0] = 0;
  for (size_t i = 0; i < rows; i++) {
    int64_t end = start[i];
    for (int k = 0; k < length; k++) {
      int32_t drawn = (int32_t)(test_random(random) * columns);
      int64_t e = start[i];
      while (e < end && column[e] != drawn) {
        e++;
      }
      if (e == end && test_random(random) < 0.8) {
        column[end++] = drawn;
      }
    }
    start[i + 1] = end;
  }
  return start[rows];
}

/* No row holds one colour twice, every used column is coloured, and there are at least as many colours as the longest
 * row needs and at most as many as the largest degree allows. */
static void check_colouring(size_t rows, const int64_t *start, const int32_t *column, int32_t columns) {
  int32_t *colour = calloc((size_t)columns, sizeof *colour), colours = 0;
  char *conflict = calloc((size_t)columns * (size_t)columns, 1), *used = calloc((size_t)columns, 1);
  clt_error error = {0};
  assert_ok(clt_colour_columns(rows, start, column, columns, colour, &colours, &error), error);
  int64_t longest = 0;
  for (size_t i = 0; i < rows; i++) {
    longest = start[i + 1] - start[i] > longest ? start[i + 1] - start[i] : longest;
    for (int64_t a = start[i]; a < start[i + 1]; a++) {
      used[column[a]] = 1;
      for (int64_t b = start[i]; b < a; b++) {
        assert_int_not_equal(colour[column[a]], colour[column[b]]);
        conflict[column[a] * columns + column[b]] = conflict[column[b] * columns + column[a]] = 1;
      }
    }
  }
  int degree = 0;
  for (int32_t k = 0; k < columns; k++) {
    int own = 0;
    for (int32_t l = 0; l < columns; l++) {
      own += conflict[k * columns + l];
    }
    degree = own > degree ? own : degree;
    assert_true(used[k] ? colour[k] >= 0 && colour[k] < colours : colour[k] == -1);
  }
  assert_true(colours >= longest && colours <= degree + 1);
  free(colour);
  free(conflict);
  free(used);
}

static void random_graphs_are_coloured_properly(void **state) {
  (void)state;
  enum { ROWS = 200, LENGTH = 12 };
  static int64_t start[ROWS + 1];
  static int32_t column[ROWS * LENGTH];
  uint64_t random = 11;
  for (int n = 0; n < 60; n++) {
    size_t rows = (size_t)(test_random(&random) * ROWS);
    int32_t columns = 1 + (int32_t)(test_random(&random) * 150);
    draw_rows(&random, rows, 1 + (int)(test_random(&random) * LENGTH), columns, start, column);
    check_colouring(rows, start, column, columns);
  }
}

/* A band matrix of width w needs exactly w colours, and columns apart share theirs. */
static void a_band_needs_its_width(void **state) {
  (void)state;
  enum { ROWS = 500, BAND = 5 };
  static int64_t start[ROWS + 1];
  static int32_t column[ROWS * BAND], colour[ROWS + BAND];
  for (int i = 0; i < ROWS; i++) {
    for (int k = 0; k < BAND; k++) {
      column[i * BAND + k] = i + k;
    }
    start[i + 1] = (i + 1) * BAND;
  }
  int32_t colours = 0;
  clt_error error = {0};
  assert_ok(clt_colour_columns(ROWS, start, column, ROWS + BAND, colour, &colours, &error), error);
  assert_in_range(colours, BAND, BAND + 2);
}

static void nothing_needs_no_colour(void **state) {
  (void)state;
  int64_t start[4] = {0};
  int32_t colour[3] = {7, 7, 7}, colours = 7, none[1] = {0};
  clt_error error = {0};
  assert_ok(clt_colour_columns(3, start, none, 3, colour, &colours, &error), error);
  assert_int_equal(colours, 0);
  assert_int_equal(colour[1], -1);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(random_graphs_are_coloured_properly),
      cmocka_unit_test(a_band_needs_its_width),
      cmocka_unit_test(nothing_needs_no_colour),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
