/* When a picture appears: the refreshes of a screen, reckoned from what its buffer swaps tell. Arithmetic only; times
 * are nanoseconds of CLOCK_MONOTONIC. A time that is given is never before the refresh that really shows the picture,
 * as far as the lag holds. */
#ifndef CLT_DEVICE_PROJECTOR_PACING_H
#define CLT_DEVICE_PROJECTOR_PACING_H

#include <stdbool.h>
#include <stdint.h>

typedef struct clt_pacing {
  double nominal_ns, period_ns; /* of a refresh: as the mode says, as measured */
  bool throttled;               /* swaps wait for the screen; otherwise the clock makes the refreshes */
  int lag;                      /* the picture is up at the lag-th refresh after its swap returned, or before */
  double phase_ns;              /* start of a refresh */
  int64_t seen_ns;              /* the last swap that waited for a refresh */
  double first_ns;              /* the refreshes since first_ns give the period */
  int64_t refreshes;
  int64_t number;   /* of the last refresh, where the display counts them */
  int64_t shown_ns; /* of the picture before */
} clt_pacing;

/* Begins at now_ns, nothing known but the nominal rate. */
void clt_pacing_start(clt_pacing *pacing, double refresh_hz, bool throttled, int lag, int64_t now_ns);
/* A swap with nothing left to draw began and returned at these times: when the refresh that first shows its picture
 * starts, not before that of the picture before. */
int64_t clt_pacing_swapped(clt_pacing *pacing, int64_t began_ns, int64_t returned_ns);
/* The same where the display itself says when the refresh started, and its number. */
int64_t clt_pacing_stamped(clt_pacing *pacing, int64_t started_ns, int64_t number);
/* Until when the caller has to wait so as not to run ahead of the screen; in the past where the swap has waited. */
int64_t clt_pacing_release(const clt_pacing *pacing);

/* Whether swaps wait for a screen: count > 0 times from return to return, of which the middle one decides. Sorts them.
 */
bool clt_pacing_waits(double *between_ns, int count, double refresh_hz);

#endif
