#include "device/projector/pacing.h"

#include <math.h>

#include "base/order.h"

/* A swap that took this part of a refresh has waited for one: its return tells the phase. */
static const double waited_part = 0.05;
/* Returns come late, seldom early: the phase follows the early ones at once and the late ones slowly. */
static const double early_gain = 0.5, late_gain = 0.02;
/* A return this close before a refresh may already be that of the refresh: the phase is not known better. */
static const double guard_part = 0.2;
/* The period is renewed over so many refreshes, and stays within this of the nominal one: modes are named by whole
 * hertz, 23.976 as 23. */
enum { PERIOD_REFRESHES = 120 };
static const double period_slack = 0.05;
/* A phase older than this is not trusted. */
static const double stale_ns = 2e9;

void clt_pacing_start(clt_pacing *pacing, double refresh_hz, bool throttled, int lag, int64_t now_ns) {
  *pacing = (clt_pacing){.nominal_ns = 1e9 / refresh_hz,
                         .period_ns = 1e9 / refresh_hz,
                         .throttled = throttled,
                         .lag = throttled ? lag : 0,
                         .phase_ns = (double)now_ns,
                         .seen_ns = throttled ? INT64_MIN / 2 : now_ns,
                         .first_ns = NAN};
}

/* One more refresh at at_ns, count refreshes after the one before; renews the period once enough have passed. */
static void measure_period(clt_pacing *pacing, double at_ns, int64_t count) {
  if (!(pacing->first_ns <= at_ns)) {
    pacing->first_ns = at_ns;
    pacing->refreshes = 0;
    return;
  }
  pacing->refreshes += count;
  if (pacing->refreshes < PERIOD_REFRESHES) {
    return;
  }
  double period = (at_ns - pacing->first_ns) / (double)pacing->refreshes;
  if (fabs(period / pacing->nominal_ns - 1) <= period_slack) {
    pacing->period_ns = period;
  }
  pacing->first_ns = at_ns;
  pacing->refreshes = 0;
}

static void follow(clt_pacing *pacing, int64_t returned_ns) {
  if ((double)(returned_ns - pacing->seen_ns) > stale_ns) {
    pacing->phase_ns = (double)returned_ns;
    pacing->first_ns = NAN;
  }
  double count = round(((double)returned_ns - pacing->phase_ns) / pacing->period_ns);
  double expected = pacing->phase_ns + count * pacing->period_ns;
  double late = (double)returned_ns - expected;
  pacing->phase_ns = expected + (late < 0 ? early_gain : late_gain) * late;
  measure_period(pacing, pacing->phase_ns, (int64_t)count);
  pacing->seen_ns = returned_ns;
}

/* The first refresh after a time, on the grid of the phase. */
static double refresh_after(const clt_pacing *pacing, double time_ns) {
  double number = floor((time_ns - pacing->phase_ns) / pacing->period_ns) + 1;
  return pacing->phase_ns + number * pacing->period_ns;
}

/* Two pictures never share a refresh. Where a swap that has waited says an earlier one than that, the picture before
 * was up sooner than it was said to be. */
static double throttled_refresh(const clt_pacing *pacing, double returned_ns, bool waited) {
  double period = pacing->period_ns, shown = (double)pacing->shown_ns;
  if (returned_ns - (double)pacing->seen_ns > stale_ns) {
    return fmax(returned_ns + pacing->lag * period, shown + period);
  }
  double next = refresh_after(pacing, returned_ns + guard_part * period) + (pacing->lag - 1) * period;
  return fmax(next, waited ? shown : refresh_after(pacing, shown + (1 - guard_part) * period));
}

int64_t clt_pacing_swapped(clt_pacing *pacing, int64_t began_ns, int64_t returned_ns) {
  double shown;
  if (pacing->throttled) {
    bool waited = (double)(returned_ns - began_ns) >= waited_part * pacing->period_ns;
    if (waited) {
      follow(pacing, returned_ns);
    }
    shown = throttled_refresh(pacing, (double)returned_ns, waited);
  } else {
    double soonest = (double)pacing->shown_ns + (1 - guard_part) * pacing->period_ns;
    shown = refresh_after(pacing, fmax((double)returned_ns, soonest));
  }
  pacing->shown_ns = (int64_t)ceil(shown);
  return pacing->shown_ns;
}

int64_t clt_pacing_stamped(clt_pacing *pacing, int64_t started_ns, int64_t number) {
  measure_period(pacing, (double)started_ns, number - pacing->number);
  pacing->number = number;
  pacing->shown_ns = started_ns;
  return started_ns;
}

int64_t clt_pacing_release(const clt_pacing *pacing) {
  return pacing->shown_ns - (int64_t)((double)pacing->lag * pacing->period_ns);
}

bool clt_pacing_waits(double *between_ns, int count, double refresh_hz) {
  const double least = 0.6;
  clt_sort_doubles(between_ns, (size_t)count);
  return between_ns[count / 2] >= least * 1e9 / refresh_hz;
}
