/* When turns of the main loop begin, and which refresh each of them is for. Arithmetic only; times are clt_clock_ns. */
#ifndef CLT_DAEMON_PACE_H
#define CLT_DAEMON_PACE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct pace {
  int64_t begun_ns;   /* this turn */
  int64_t planned_ns; /* when it should have */
  int64_t at_ns;      /* the refresh that it is for */
} pace;

/* A turn begins: that for the refresh nearest to now, or, where something has ended the wait before it, again for the
 * one before. */
void pace_begin(pace *self, int64_t now_ns, double refresh_s);
/* Seconds until the next one is to begin. Turns are planned a refresh apart, whenever each really begins: what waits
 * take too long would add up. Where the projector has waited for its refresh, it is the one that keeps the time: the
 * next turn begins at once, though half a refresh after this one at least. Waiting here as well would begin late ever
 * after what began late once, and miss a refresh in the end. */
double pace_left(pace *self, int64_t now_ns, double refresh_s, bool waited);

#endif
