/* The journal of an acquisition: every observation in order, so that one that was interrupted goes on where it was.
 *
 * A file of one head and any number of records, in this machine's byte order. A record counts when it is complete and
 * its sum is right: whatever a killed process or a full disk left half written at the end is cut off. */
#ifndef CLT_ACQUIRE_JOURNAL_H
#define CLT_ACQUIRE_JOURNAL_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/image.h"
#include "counterlight/rig.h"
#include "counterlight/status.h"

typedef struct clt_journal {
  int file; /* -1: none is kept */
  bool replaying;
  const char *path; /* not owned */
} clt_journal;

/* Opens or begins the journal at path (NULL: none). It belongs to a rig's source, grid, channels and response:
 * CLT_BAD_INPUT where the file is one of another rig, or no journal. */
clt_status clt_journal_open(clt_journal *journal, const char *path, const clt_rig_info *info, clt_error *error);
void clt_journal_close(clt_journal *journal);

/* The next record, if it is of this drive: seen and deviation are filled, *found is true. Otherwise the records from
 * here on are dropped, and clt_journal_add continues in their place. */
clt_status clt_journal_replay(clt_journal *journal, const clt_image *drive, clt_image *seen, clt_image *deviation,
                              bool *found, clt_error *error);
/* Appends an observation and brings it to the disk. */
clt_status clt_journal_add(clt_journal *journal, const clt_image *drive, const clt_image *seen,
                           const clt_image *deviation, clt_error *error);

#endif
