#include "daemon/journal.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

enum { FIELD_MAX = 1024 };

bool journal_takes(int descriptor) {
  const char *stream = getenv("JOURNAL_STREAM");
  unsigned long long device, inode;
  struct stat found;
  return stream != NULL && sscanf(stream, "%llu:%llu", &device, &inode) == 2 && fstat(descriptor, &found) == 0 &&
         found.st_dev == device && found.st_ino == inode;
}

/* Sends the line with its fields to the journal. False where that is not there. */
static bool send_fields(clt_log_level level, const char *line, const journal_field *fields, size_t count) {
  char texts[JOURNAL_FIELDS_MOST + 2][FIELD_MAX];
  struct iovec parts[JOURNAL_FIELDS_MOST + 2];
  int used = 2;
  snprintf(texts[0], FIELD_MAX, "MESSAGE=%s", line);
  snprintf(texts[1], FIELD_MAX, "PRIORITY=%d", (int)level);
  for (size_t i = 0; i < count && i < JOURNAL_FIELDS_MOST; i++) {
    if (fields[i].value[0] != '\0') {
      snprintf(texts[used++], FIELD_MAX, "%s=%s", fields[i].name, fields[i].value);
    }
  }
  for (int i = 0; i < used; i++) {
    parts[i] = (struct iovec){texts[i], strlen(texts[i])};
  }
  return sd_journal_sendv(parts, used) == 0;
}

void journal_note(clt_log_level level, const char *line, const journal_field *fields, size_t count) {
  if (!journal_takes(STDERR_FILENO) || !send_fields(level, line, fields, count)) {
    clt_log(level, "%s", line);
  }
}
