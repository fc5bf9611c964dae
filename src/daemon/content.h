/* The content: the picture that is to appear; of a film, its first frame. */
#ifndef CLT_DAEMON_CONTENT_H
#define CLT_DAEMON_CONTENT_H

#include "daemon/store.h"

typedef struct content {
  clt_image picture; /* linear, as decoded; empty: not needed yet (content_decode) */
  uint64_t identity; /* of the samples; never 0 */
  char name[CLT_PATH_MAX];
  store_source from;
  store_record record; /* as stored */
} content;

/* At the start: the picture that `show` brought last, while the configuration still names the same content as then,
 * else the configured one. CLT_BAD_INPUT where neither is a picture. A file of which the stored drive is, by its name,
 * time and size, is not decoded before it is needed: that drive is up sooner. */
clt_status content_open(const store *state, const char *configured, content *out, clt_error *error);
/* Decodes the picture where that was put off. */
clt_status content_decode(content *shown, clt_error *error);
/* Takes an opened regular file of at most 256 MiB (PNG, JPEG, EXR or npy, told by its first bytes), decodes it and
 * keeps a copy in the state directory. On failure nothing changes. The descriptor stays the caller's. */
clt_status content_take(const store *state, const char *configured, int descriptor, const char *name, content *shown,
                        clt_error *error);
/* Goes back to the configured picture. On failure nothing changes. */
clt_status content_reset(const store *state, const char *configured, content *shown, clt_error *error);
/* Keeps the drive for the next start. */
clt_status content_keep_drive(const store *state, content *shown, const clt_image *drive, clt_error *error);
void content_finish(content *shown);

#endif
