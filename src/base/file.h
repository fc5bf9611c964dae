/* Files that are replaced as a whole: a reader sees the old content or the new, never half of it. */
#ifndef CLT_BASE_FILE_H
#define CLT_BASE_FILE_H

#include <stddef.h>
#include <stdio.h>

#include "counterlight/status.h"

#define CLT_STAMP_MAX 64

/* The temporary name under which the new content of path is written: same folder, ending kept (writers choose their
 * format by it), unique to this process and call. temporary has room for CLT_PATH_MAX. */
clt_status clt_file_begin(const char *path, char *temporary, clt_error *error);
/* Syncs the temporary file, renames it over path and syncs the folder. On failure the temporary file is removed. */
clt_status clt_file_commit(const char *temporary, const char *path, clt_error *error);
/* Removes the temporary file after a failure. */
void clt_file_abandon(const char *temporary);
/* All three around one buffer. */
clt_status clt_file_write(const char *path, const void *bytes, size_t size, clt_error *error);
/* A text that is written bit by bit and becomes a file at its end. */
typedef struct clt_text {
  FILE *to; /* where it is written */
  char *bytes;
  size_t size;
  char path[CLT_PATH_MAX];
} clt_text;
clt_status clt_text_open(clt_text *text, const char *path, clt_error *error);
/* Replaces the file at the text's path where status is CLT_OK, else drops the text. Returns the first failure; called
 * once, also after an open that failed. */
clt_status clt_text_close(clt_text *text, clt_status status, clt_error *error);
/* Joins a folder and a relative name; an absolute name stays as it is. out has room for CLT_PATH_MAX. */
clt_status clt_file_join(const char *folder, const char *name, char *out, clt_error *error);
/* A regular file's time of change and size, "1764158400.123456789, 4711"; empty where it is none. stamp has room for
 * CLT_STAMP_MAX. */
void clt_file_stamp(const char *path, char *stamp);
/* The folder part of a path ("." where it has none). out has room for CLT_PATH_MAX. */
void clt_file_folder(const char *path, char *out);

#endif
