/* A film that plays: decoded ahead in a thread of its own, handed out by presentation time. A decoder that is slower
 * than its film slows the film down; it never leaves the glass empty, for what was handed out last stays. */
#ifndef CLT_DAEMON_PLAYER_H
#define CLT_DAEMON_PLAYER_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "counterlight/status.h"
#include "image/film.h"

typedef struct player player;

/* Codes of a decoded frame, shared by the threads that work with them: nobody copies them. */
typedef struct player_codes {
  atomic_uint holders;
  uint8_t *data;
} player_codes;

/* One holder more; gives the codes back. Accepts NULL. */
player_codes *player_codes_hold(player_codes *codes);
/* One holder less; the last one frees them. Accepts NULL. */
void player_codes_drop(player_codes *codes);

typedef struct player_frame {
  player_codes *codes; /* held for the taker */
  clt_film_frame shape;
  int64_t due_ns; /* when it is to be on the glass; clt_clock_ns */
} player_frame;

/* Opens the film and starts to decode: the first frame is due at once. */
clt_status player_create(const char *path, const clt_film_options *options, player **out, clt_error *error);
void player_destroy(player *self); /* accepts NULL */
/* The next frame that is due by ahead_ns takes the place of *frame, whose codes are dropped; false where there is none
 * that was not handed out before. Of those that are due by until_ns only the latest: *skipped are passed over. */
bool player_take(player *self, int64_t ahead_ns, int64_t until_ns, player_frame *frame, int *skipped);
/* Seconds from now until the next decoded frame is due (0: it is; infinite: none is decoded). */
double player_due(player *self);
/* How many frames were decoded only after they were due, so that the film waited for them. */
uint64_t player_slipped(player *self);
/* Why the film stands still; false where it does not. */
bool player_failed(player *self, clt_error *error);

#endif
