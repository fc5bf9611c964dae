/* Cutting a byte stream into lines, with a limit that is checked before anything is parsed. */
#ifndef CLT_DAEMON_LINES_H
#define CLT_DAEMON_LINES_H

#include <stddef.h>

enum { LINES_LONGEST = 64 * 1024 }; /* bytes in a line, its newline not counted */

typedef struct lines {
  size_t start, end; /* what has come and was not handed out is bytes[start..end) */
  char bytes[LINES_LONGEST + 1];
} lines;

typedef enum lines_outcome { LINES_NONE, LINES_READY, LINES_TOO_LONG } lines_outcome;

/* Where to put what comes next, and how much fits (0 only while a line is ready or too long). */
char *lines_space(lines *stream, size_t *room);
/* Says that `count` bytes were put there. */
void lines_add(lines *stream, size_t count);
/* Hands out the next whole line, without its newline; it is valid until the next lines_space. LINES_TOO_LONG once a
 * line passes the limit: the stream is of no more use then. */
lines_outcome lines_next(lines *stream, const char **line, size_t *length);

#endif
