/* The journal of an acquisition: every observation in order, so that one that was interrupted goes on where it was.
 *
 * A file of one head and any number of records, in this machine's byte order. A record counts when it is complete and
 * its sum is right: whatever a killed process or a full disk left half written at the end is cut off. */
#ifndef CLT_ACQUIRE_JOURNAL_H
#define CLT_ACQUIRE_JOURNAL_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "counterlight/acquire.h"
#include "counterlight/image.h"

typedef struct clt_journal {
  int file; /* -1: none is kept */
  bool replaying, unnamed;
  bool inherited;   /* what is replayed was observed before the journal was opened */
  bool dispensable; /* without it the acquisition goes on all the same */
  const char *path; /* not owned; of an unnamed one, for messages */
} clt_journal;

/* Opens or begins options->journal (NULL: none). It belongs to a rig's source, grid, channels and response and to
 * options->journal_of: CLT_BAD_INPUT where the file is one of another, or no journal. A dispensable one is then begun
 * anew, also where it is older than options->journal_age_s, and left out where it cannot be written. */
clt_status clt_journal_open(clt_journal *journal, const clt_acquire_options *options, const clt_rig_info *info,
                            clt_error *error);
/* One without a name, gone when it is closed, to begin an acquisition again from within. */
clt_status clt_journal_open_unnamed(clt_journal *journal, clt_error *error);
void clt_journal_close(clt_journal *journal);

/* The next record, if it is of this drive: seen and deviation are filled, *found is true. Otherwise the records from
 * here on are dropped, and clt_journal_add continues in their place. */
clt_status clt_journal_replay(clt_journal *journal, const clt_image *drive, clt_image *seen, clt_image *deviation,
                              bool *found, clt_error *error);
/* While observations are taken from the journal, and another whole one is there. */
bool clt_journal_is_replaying(const clt_journal *journal);
/* Whether the record that would be replayed next is of this drive; nothing is taken. */
bool clt_journal_next_is(const clt_journal *journal, const clt_image *drive);
/* Appends an observation and brings it to the disk; a dispensable one is left to the system to write, which survives
 * the end of the process, and given up where it cannot be written. */
clt_status clt_journal_add(clt_journal *journal, const clt_image *drive, const clt_image *seen,
                           const clt_image *deviation, clt_error *error);

/* Where the next record is read or written; 0 without a journal. */
off_t clt_journal_here(const clt_journal *journal);
/* Drops the records from `end` on, and replays from `start`. */
clt_status clt_journal_go_back(clt_journal *journal, off_t start, off_t end, clt_error *error);

#endif
