/* A loop that the threads of a team share so that each works on what it worked on before. */
#ifndef CLT_BASE_TURNS_H
#define CLT_BASE_TURNS_H

#include <stdbool.h>
#include <stddef.h>

/* The turns 0..count - 1 of one loop. A thread takes its own first, the same in every loop of as many turns by as many
 * threads, so that what they read and wrote lies in its caches; then those of threads that are behind. */
enum { CLT_TURNS_OWNERS = 16, CLT_TURNS_LINE = 64 / sizeof(size_t) };
typedef struct clt_turns {
  size_t count;
  size_t taken[CLT_TURNS_OWNERS][CLT_TURNS_LINE]; /* [0]: of each thread's own, changed atomically; cache lines apart */
} clt_turns;

static inline clt_turns clt_turns_of(size_t count) {
  return (clt_turns){.count = count};
}

/* The next turn of the calling thread, into *turn; false where all are taken. The turns are shared by the whole team of
 * the innermost parallel region, and are used up once. Nobody waits here. */
bool clt_turns_next(clt_turns *turns, size_t *turn);

/* For loops over many small things: the turns of `at_once` of `count` things each, and the things of the next turn. */
static inline clt_turns clt_turns_of_few(size_t count, size_t at_once) {
  return clt_turns_of((count + at_once - 1) / at_once);
}
static inline bool clt_turns_next_few(clt_turns *turns, size_t count, size_t at_once, size_t *first, size_t *end) {
  size_t turn = 0;
  if (!clt_turns_next(turns, &turn)) {
    return false;
  }
  *first = turn * at_once;
  *end = count - *first < at_once ? count : *first + at_once;
  return true;
}

#endif
