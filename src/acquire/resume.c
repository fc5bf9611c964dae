/* Going on with what was observed before an interruption: only where the room, the lamp and the camera are as they
 * were.
 */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "acquire/session.h"
#include "base/clock.h"
#include "base/log.h"

/* Above this many standard deviations a difference is not noise. */
#define DEVIATIONS 6.0
/* The random picture that no check shows, and photographs of black that are averaged: its error is in every pattern. */
enum { LANDMARK = INT_MAX, BLACKS = 4 };

clt_status clt_session_take_landmark(clt_session *session, clt_error *error) {
  if (session->landmark.data == NULL) {
    return CLT_OK;
  }
  clt_session_draw(session, LANDMARK);
  clt_status status = clt_session_take(session, "landmark", error);
  const size_t bytes = clt_image_size(&session->seen) * sizeof *session->seen.data;
  if (status == CLT_OK) {
    memcpy(session->landmark.data, session->seen.data, bytes);
    memcpy(session->landmark_deviation.data, session->deviation.data, bytes);
  }
  return status;
}

/* Whether white is as it was; a lamp that drifted is taken out only where looks do so for what follows. */
static clt_status confirm_white(clt_session *session, double *lamp, clt_change *change, clt_error *error) {
  clt_image expected = {0};
  clt_session_fill(session, 1);
  clt_status status = clt_session_take_anew(session, "confirming", error);
  if (status == CLT_OK) {
    status = clt_image_init(&expected, session->flood.channels, session->flood.height, session->flood.width, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  for (size_t k = 0; k < clt_image_size(&expected); k++) {
    expected.data[k] = session->flood.data[k] + session->black.data[k];
  }
  *change = session->watch.every > 0 ? clt_watch_compare_lamp(&expected, &session->flood_variance, &session->black,
                                                              &session->seen, &session->deviation, CLT_STEADY, lamp)
                                     : clt_watch_compare(&expected, &session->flood_variance, &session->seen,
                                                         &session->deviation, CLT_STEADY);
  clt_image_finish(&expected);
  return CLT_OK;
}

static clt_status confirm_black(clt_session *session, clt_change *change, clt_error *error) {
  clt_image sum = {0};
  clt_session_fill(session, 0);
  clt_status status = clt_image_init(&sum, session->black.channels, session->black.height, session->black.width, error);
  for (int n = 0; status == CLT_OK && n < BLACKS; n++) {
    status = clt_session_take_anew(session, "confirming", error);
    for (size_t k = 0; status == CLT_OK && k < clt_image_size(&sum); k++) {
      sum.data[k] += session->seen.data[k] / BLACKS;
      session->deviation.data[k] /= sqrtf(BLACKS);
    }
  }
  if (status == CLT_OK) {
    *change = clt_watch_compare(&session->black, &session->black_variance, &sum, &session->deviation, CLT_STEADY);
  }
  clt_image_finish(&sum);
  return status;
}

/* A picture whose neighbours differ is another where pixels see other cells: with d the difference of both photographs,
 * ||d||^2 less what their noise adds, against (STEADY ||light||)^2. *apart: the relative difference; 0: none. */
static clt_status confirm_landmark(clt_session *session, const double *lamp, double *apart, clt_error *error) {
  clt_session_draw(session, LANDMARK);
  clt_status status = clt_session_take_anew(session, "confirming", error);
  double wrong = 0, spread = 0, light = 0;
  for (size_t k = 0; status == CLT_OK && k < clt_image_size(&session->seen); k++) {
    const double gain = lamp[k / session->cells], dark = (double)session->black.data[k];
    const double before = gain * ((double)session->landmark.data[k] - dark), own = (double)session->deviation.data[k];
    const double earlier = gain * (double)session->landmark_deviation.data[k], noise = own * own + earlier * earlier;
    if (isfinite(noise)) {
      const double difference = (double)session->seen.data[k] - dark - before;
      wrong += difference * difference - noise;
      spread += 2 * noise * noise;
      light += before * before;
    }
  }
  const bool same = wrong <= CLT_STEADY * CLT_STEADY * light + DEVIATIONS * sqrt(spread);
  *apart = same ? 0 : sqrt(wrong / fmax(light, 1e-30));
  return status;
}

/* *why: what is not as it was; empty where all is. */
static clt_status compare(clt_session *session, char *why, size_t size, clt_error *error) {
  clt_change change = {0};
  char what[160];
  double lamp[CLT_CHANNELS_MAX], apart = 0;
  for (int c = 0; c < CLT_CHANNELS_MAX; c++) {
    lamp[c] = 1;
  }
  why[0] = '\0';
  clt_status status = confirm_white(session, lamp, &change, error);
  const char *of = "under white";
  if (status == CLT_OK && !(change.share > 0)) {
    status = confirm_black(session, &change, error);
    of = "in the dark";
  }
  if (status == CLT_OK && change.share > 0) {
    clt_change_format(&change, what, sizeof what);
    snprintf(why, size, "%s %s", of, what);
    return status;
  }
  status = status == CLT_OK ? confirm_landmark(session, lamp, &apart, error) : status;
  if (status == CLT_OK && apart > 0) {
    snprintf(why, size, "a random picture differs by %.2g %%: camera, projector or room were moved", 100 * apart);
  }
  return status;
}

/* Fails, so that the session begins again with nothing. */
static clt_status drop(clt_session *session, const char *why, clt_error *error) {
  clt_watch *watch = &session->watch;
  clt_log(CLT_LOG_NOTICE, "the acquisition begins anew, what was measured before it was interrupted does not count: %s",
          why);
  watch->good = watch->start;
  watch->good_done = watch->start_done;
  watch->again = true;
  return clt_fail(error, CLT_FAILED, "what was measured earlier does not count: %s", why);
}

clt_status clt_session_confirm(clt_session *session, clt_error *error) {
  const int64_t started_ns = clt_clock_ns();
  char why[256];
  if (!session->journal.inherited) {
    return drop(session, "it ended before black and white were known", error);
  }
  for (;;) {
    clt_status status = compare(session, why, sizeof why, error);
    if (status != CLT_OK || why[0] == '\0') {
      return status;
    }
    if (clt_clock_since(started_ns) >= session->watch.patience_s) {
      return drop(session, why, error);
    }
  }
}
