#include "base/log.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

void clt_log(clt_log_level level, const char *format, ...) {
  char line[1024];
  int used = getenv("JOURNAL_STREAM") != NULL ? snprintf(line, sizeof line, "<%d>", (int)level) : 0;
  va_list arguments;
  va_start(arguments, format);
  int more = vsnprintf(line + used, sizeof line - (size_t)used - 1, format, arguments);
  va_end(arguments);
  if (more < 0) {
    return;
  }
  size_t length = (size_t)used + (size_t)more;
  if (length > sizeof line - 2) {
    length = sizeof line - 2;
  }
  line[length] = '\n';
  if (write(STDERR_FILENO, line, length + 1) < 0) {
    return; /* a closed stderr must not stop the exhibit */
  }
}
