/* The watch over an acquisition: the white picture, seen again and again, tells whether the room is still the same, and
 * sums of patterns tell whether it was while each of them was photographed. */
#ifndef CLT_ACQUIRE_WATCH_H
#define CLT_ACQUIRE_WATCH_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "acquire/group.h"
#include "counterlight/acquire.h"
#include "counterlight/image.h"

/* Part of its light by which a tile may differ: lamps and mains are not steadier than that. */
#define CLT_STEADY 0.01

/* What is different between two observations of one picture; share 0: nothing. */
typedef struct clt_change {
  double share;   /* of the picture's tiles */
  int x, y;       /* middle of the tile that changed most, cells */
  double percent; /* by which that tile is brighter (or darker, below 0) */
} clt_change;

/* Compares sums over tiles, at most 16 x 16, 8 x 8 and so on down to the whole: a tile has changed where its difference
 * is above its noise and above `tolerance` of its light. The finest in which some have tells. Values with an infinite
 * variance in either are left out. */
clt_change clt_watch_compare(const clt_image *expected, const clt_image *variance, const clt_image *seen,
                             const clt_image *deviation, double tolerance);

/* Values of an observation that no drive in 0..1 can give, as a share: brighter than white by more than noise and
 * `tolerance`, or without a value, as saturated ones are, where white has one. */
double clt_watch_impossible(const clt_image *white, const clt_image *variance, const clt_image *seen,
                            const clt_image *deviation, double tolerance);

typedef struct clt_watch {
  int every;      /* patterns between two looks; 0: none */
  double every_s; /* of the devices' time between two looks; 0: it does not count */
  double patience_s;
  double now_s, good_s;          /* the devices' time of the last pattern and of the last good look */
  long doubted;                  /* clt_rig_info.doubted at the last pattern */
  clt_image white;               /* the drive of a look */
  double lamp[CLT_CHANNELS_MAX]; /* light of the last good look over what was expected, black aside */
  bool ready;                    /* what is expected is known */
  int since;                     /* patterns since the last good look */
  clt_image expected, variance;  /* white, black included */
  clt_group group, earlier;      /* patterns since the last sum; those that did not add up the last time */
  off_t start, good;             /* places in the journal: of the first pattern, and after the last good look */
  long start_done, good_done;    /* patterns counted there */
  bool again;                    /* what was observed since is not to be trusted: begin again from the journal */
  bool troubled;        /* an observation since the last good look had to be tried again: its neighbours are in doubt */
  int passes;           /* begun again so far */
  int64_t disturbed_ns; /* since when black or white would not stay the same; 0: they do */
  long dropped;         /* patterns that were observed again */
  bool renewed;         /* black and flood, because patterns that gave the same light twice do not add up */
  long unexplained;     /* patterns that still do not */
} clt_watch;

/* Without a look every so many patterns nothing is allocated. */
clt_status clt_watch_init(clt_watch *watch, const clt_acquire_options *options, const clt_rig_info *info,
                          clt_error *error);
void clt_watch_finish(clt_watch *watch);

/* As clt_watch_compare, after the lamp is taken out: in each channel one factor, which may be 0.9..1.1: the median over
 * tiles of (seen - black) / (expected - black), by how exactly each is known. lamp: channels values, initialised here.
 */
clt_change clt_watch_compare_lamp(const clt_image *expected, const clt_image *variance, const clt_image *black,
                                  const clt_image *seen, const clt_image *deviation, double tolerance, double *lamp);
/* Divides the light of an observation, black aside, and its deviation by the lamp's factor. */
void clt_watch_correct(const clt_watch *watch, const clt_image *black, clt_image *seen, clt_image *deviation);
/* The lamp is as it was with black and flood. */
void clt_watch_forget_lamp(clt_watch *watch);

/* "cells around (12, 8) are 38 % darker (25 % of the picture differ)"; size >= 120. */
void clt_change_format(const clt_change *change, char *text, size_t size);

#endif
