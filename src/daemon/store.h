/* The state directory: what survives the end of the daemon.
 *
 *   calibration.h5 a geometry that was measured again (geometry.c)
 *   transport.h5   the transport in use, replaced only by a complete newer one
 *   content.EXT    the picture that `show` brought, as it came
 *   drive.npy      the last drive
 *   acquisition.journal  what an acquisition under way has measured, with .starts behind it how many starts went on
 *                        with that (resume.c)
 *   state.json     which content, and of what content the drive is
 *   snapshot/      the pictures of the last snapshot
 *
 * Where the folder cannot be written, everything works and nothing survives. */
#ifndef CLT_DAEMON_STORE_H
#define CLT_DAEMON_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/file.h"
#include "counterlight/image.h"
#include "counterlight/transport.h"

typedef struct store {
  char folder[CLT_PATH_MAX];
  int lock; /* held while the daemon runs; -1: none */
  bool writable;
} store;

/* A file as it was when it was read. */
typedef struct store_source {
  char path[CLT_PATH_MAX];
  char stamp[CLT_STAMP_MAX]; /* clt_file_stamp; empty: not known */
} store_source;

/* What state.json says. */
typedef struct store_record {
  char configured[CLT_PATH_MAX]; /* the configuration's content when `show` was asked; empty: no `show` */
  char content[64];              /* file in the folder that is shown instead; empty: the configured one */
  char name[CLT_PATH_MAX];       /* what people call that */
  uint64_t drive_of;             /* content that the stored drive is for (content.identity); 0: none */
  store_source drive_from;       /* what that was read from */
} store_record;

/* Makes the folder, takes its lock and removes what an earlier daemon left half-written. CLT_FAILED where another
 * daemon uses it. A folder that cannot be written is a warning. */
clt_status store_open(const char *folder, store *out, clt_error *error);
void store_close(store *state); /* accepts a zeroed one */
/* The path of a file in the folder; out has room for CLT_PATH_MAX. */
clt_status store_path(const store *state, const char *name, char *out, clt_error *error);
/* That of the journal of the acquisition under way; empty where the path is too long. */
void store_journal_path(const char *folder, char path[CLT_PATH_MAX]);

/* Empty where there is none or it cannot be read. */
void store_read_record(const store *state, store_record *record);
clt_status store_write_record(const store *state, const store_record *record, clt_error *error);

/* Says why a transport does not serve this rig, or gives false. A width of 0 and an empty source are not known yet. */
bool store_is_foreign(const clt_transport *transport, int width, int height, int channels, const char *source,
                      char *why, size_t size);
/* The stored transport where it has the grid and was measured on the source (where both are known), else NULL, and the
 * log says why. A file that cannot be read is moved aside as transport.h5.bad-TIME, one of another rig as
 * transport.h5.old. */
clt_transport *store_load_transport(const store *state, int width, int height, int channels, const char *source);
clt_status store_save_transport(const store *state, const clt_transport *transport, clt_error *error);

clt_status store_save_drive(const store *state, const clt_image *drive, clt_error *error);
/* False where there is none that can be read. */
bool store_load_drive(const store *state, clt_image *drive);

#endif
