#include "daemon/lines.h"
#include "support.h"

/* Puts text in as the socket would, in pieces of at most `piece` bytes, and hands every line to `take`. */
static lines_outcome feed(lines *stream, const char *text, size_t length, size_t piece,
                          void (*take)(void *context, const char *line, size_t length), void *context) {
  lines_outcome outcome = LINES_NONE;
  for (size_t done = 0; done < length && outcome != LINES_TOO_LONG;) {
    size_t room, count = length - done < piece ? length - done : piece;
    char *space = lines_space(stream, &room);
    count = count < room ? count : room;
    assert_true(count > 0);
    memcpy(space, text + done, count);
    lines_add(stream, count);
    done += count;
    const char *line;
    size_t size;
    while ((outcome = lines_next(stream, &line, &size)) == LINES_READY) {
      take(context, line, size);
    }
  }
  return outcome;
}

typedef struct collected {
  char text[1 << 20];
  size_t used;
  int count;
} collected;

static void collect(void *context, const char *line, size_t length) {
  collected *all = context;
  assert_true(length <= LINES_LONGEST);
  memcpy(all->text + all->used, line, length);
  all->text[all->used + length] = '\n';
  all->used += length + 1;
  all->count++;
}

static void whole_half_and_several_lines_come_out_as_they_went_in(void **state) {
  (void)state;
  static const char text[] = "one\n\n{\"two\": 2}\nthree and\tmore\nfour\n";
  static collected got;
  for (size_t piece = 1; piece < sizeof text; piece++) {
    lines *stream = calloc(1, sizeof *stream);
    got.used = 0, got.count = 0;
    assert_int_equal(feed(stream, text, sizeof text - 1, piece, collect, &got), LINES_NONE);
    assert_int_equal(got.count, 5);
    assert_int_equal(got.used, sizeof text - 1);
    assert_memory_equal(got.text, text, got.used);
    free(stream);
  }
}

static void a_line_without_end_waits(void **state) {
  (void)state;
  static collected got;
  lines *stream = calloc(1, sizeof *stream);
  got.used = 0, got.count = 0;
  assert_int_equal(feed(stream, "half", 4, 4, collect, &got), LINES_NONE);
  assert_int_equal(got.count, 0);
  assert_int_equal(feed(stream, " a line\n", 8, 8, collect, &got), LINES_NONE);
  assert_int_equal(got.count, 1);
  assert_memory_equal(got.text, "half a line\n", 12);
  free(stream);
}

static void the_limit_is_64_kib_to_the_byte(void **state) {
  (void)state;
  static collected got;
  char *text = malloc(LINES_LONGEST + 2);
  memset(text, 'x', LINES_LONGEST + 1);
  lines *stream = calloc(1, sizeof *stream);
  got.used = 0, got.count = 0;
  text[LINES_LONGEST] = '\n';
  for (int i = 0; i < 3; i++) {
    assert_int_equal(feed(stream, text, LINES_LONGEST + 1, 5000, collect, &got), LINES_NONE);
  }
  assert_int_equal(got.count, 3);
  text[LINES_LONGEST] = 'x';
  assert_int_equal(feed(stream, text, LINES_LONGEST + 1, 5000, collect, &got), LINES_TOO_LONG);
  assert_int_equal(got.count, 3);
  free(stream);
  free(text);
}

/* Random lines in random pieces: what comes out is what went in. */
static void random_streams_survive_random_pieces(void **state) {
  (void)state;
  enum { SIZE = 200000 };
  static collected got;
  char *text = malloc(SIZE);
  for (uint64_t seed = 1; seed <= 20; seed++) {
    uint64_t random = seed;
    for (int i = 0; i < SIZE; i++) {
      text[i] = test_random(&random) < 0.001 * (double)seed ? '\n' : (char)(1 + test_random(&random) * 255);
    }
    text[SIZE - 1] = '\n';
    lines *stream = calloc(1, sizeof *stream);
    got.used = 0, got.count = 0;
    size_t piece = 1 + (size_t)(test_random(&random) * 3000);
    assert_int_equal(feed(stream, text, SIZE, piece, collect, &got), LINES_NONE);
    assert_int_equal(got.used, SIZE);
    assert_memory_equal(got.text, text, SIZE);
    free(stream);
  }
  free(text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(whole_half_and_several_lines_come_out_as_they_went_in),
      cmocka_unit_test(a_line_without_end_waits),
      cmocka_unit_test(the_limit_is_64_kib_to_the_byte),
      cmocka_unit_test(random_streams_survive_random_pieces),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
