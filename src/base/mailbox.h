/* A latest-value mailbox between two threads: a newer letter replaces one that was not fetched yet. */
#ifndef CLT_BASE_MAILBOX_H
#define CLT_BASE_MAILBOX_H

#include "counterlight/status.h"

typedef struct clt_mailbox clt_mailbox;

/* drop frees a letter that is replaced or left over; it may be NULL for letters that need none. */
clt_status clt_mailbox_create(void (*drop)(void *letter), clt_mailbox **out, clt_error *error);
void clt_mailbox_destroy(clt_mailbox *mailbox); /* drops what is inside; accepts NULL */
/* Puts a letter in (not NULL), which the mailbox owns from now on. Never blocks for long. */
void clt_mailbox_put(clt_mailbox *mailbox, void *letter);
/* Takes the letter out, waiting up to timeout_s (0: not at all, < 0: for ever) for one; NULL where none came or the
 * mailbox was closed. The caller owns it. */
void *clt_mailbox_take(clt_mailbox *mailbox, double timeout_s);
/* From now on take returns at once; for stopping a thread. */
void clt_mailbox_close(clt_mailbox *mailbox);

#endif
