#include "daemon/lines.h"

#include <string.h>

char *lines_space(lines *stream, size_t *room) {
  memmove(stream->bytes, stream->bytes + stream->start, stream->end - stream->start);
  stream->end -= stream->start;
  stream->start = 0;
  *room = sizeof stream->bytes - stream->end;
  return stream->bytes + stream->end;
}

void lines_add(lines *stream, size_t count) {
  stream->end += count;
}

lines_outcome lines_next(lines *stream, const char **line, size_t *length) {
  const char *from = stream->bytes + stream->start;
  size_t waiting = stream->end - stream->start;
  const char *newline = memchr(from, '\n', waiting);
  if (newline == NULL) {
    return waiting > LINES_LONGEST ? LINES_TOO_LONG : LINES_NONE;
  }
  *line = from;
  *length = (size_t)(newline - from);
  stream->start += *length + 1;
  return LINES_READY;
}
