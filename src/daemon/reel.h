/* Moving pictures on their way from the moving thread to the glass, in the order in which they are due. A film is
 * computed ahead of its time, so that a picture that takes long costs no refresh; what a device delivers goes up at
 * once. */
#ifndef CLT_DAEMON_REEL_H
#define CLT_DAEMON_REEL_H

#include "counterlight/device.h"
#include "daemon/player.h"

/* Pictures that wait at most. */
enum { REEL_AHEAD = 3 };

typedef struct reel reel;

typedef struct reel_picture {
  uint64_t serial; /* of its content */
  int64_t due_ns;  /* when it is to be on the glass, clt_clock_ns; 0: at once */
  bool beside;     /* others are computed while this one is shown */
  clt_live_picture picture;
  player_codes *content; /* held */
  float *fields;         /* gain, then offset */
  size_t fields_room;    /* bytes */
} reel_picture;

typedef struct reel_counts {
  uint64_t shown, late,
      skipped; /* taken for the glass; of these, more than a refresh after they were due; passed over */
} reel_counts;

clt_status reel_create(reel **out, clt_error *error);
void reel_destroy(reel *self); /* accepts NULL */

/* A picture with room for so many bytes of fields: one that was shown before, or a new one; NULL where memory is short.
 * The caller's until it is put. */
reel_picture *reel_blank(reel *self, size_t bytes);
void reel_picture_free(reel_picture *picture); /* accepts NULL */
/* Seconds until there is room for one more (0: there is). A picture that nobody took, though it has been due for a
 * refresh, makes room. */
double reel_wait(reel *self, double refresh_s);
/* Takes the picture over; it is due no sooner than the one put before. Of a full reel the oldest goes. */
void reel_put(reel *self, reel_picture *picture);
/* Drops what waits: it is of other content. */
void reel_clear(reel *self);

/* The picture for the refresh at at_ns takes the place of *shown (NULL: none), which goes back to the reel; false where
 * *shown stays. A picture goes up at the refresh that is nearest to when it is due, half a refresh early at most; it is
 * passed over only where the one after it is due already. So a film as fast as the refresh loses no frame by turns that
 * begin a little early or late. */
bool reel_take(reel *self, int64_t at_ns, double refresh_s, reel_picture **shown);
/* Since the last call. Repetitions of a picture, with the same content, count as one. */
reel_counts reel_count(reel *self);

#endif
