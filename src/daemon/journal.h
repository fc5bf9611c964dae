/* Log lines that carry fields of their own into the journal: journalctl COUNTERLIGHT_STATE=holding. */
#ifndef CLT_DAEMON_JOURNAL_H
#define CLT_DAEMON_JOURNAL_H

#include <stdbool.h>
#include <stddef.h>

#include "base/log.h"

enum { JOURNAL_FIELDS_MOST = 8 };

/* An empty value is left out. */
typedef struct journal_field {
  const char *name, *value;
} journal_field;

/* Logs the line; with at most JOURNAL_FIELDS_MOST fields where stderr is the journal, else as clt_log does. */
void journal_note(clt_log_level level, const char *line, const journal_field *fields, size_t count);
/* True where the descriptor is the stream that systemd connected to the journal (JOURNAL_STREAM). */
bool journal_takes(int descriptor);

#endif
