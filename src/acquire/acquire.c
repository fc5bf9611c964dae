#include "counterlight/acquire.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "acquire/choose.h"
#include "acquire/session.h"
#include "base/clock.h"
#include "base/memory.h"

#define THRESHOLD_DEFAULT 0.005
#define THRESHOLD_MAX 0.5
#define ERROR_DEFAULT 0.005
#define ERROR_MAX 0.5
enum { CHECKS_MAX = 64, WATCH_MAX = 1000000, WATCH_DEFAULT = 25 };
/* What the watch may keep where nobody asked for it, bytes. */
#define WATCH_KEEPS_MOST 0x1p28

static clt_status check_options(const clt_acquire_options *options, clt_acquire_options *checked, clt_error *error) {
  *checked = *options;
  if (!(options->threshold >= 0 && options->threshold <= THRESHOLD_MAX)) {
    return clt_fail(error, CLT_BAD_INPUT, "threshold is %g; legal is 0 to %g", options->threshold, THRESHOLD_MAX);
  }
  if (options->repeats < 0 || options->repeats > CLT_REPEATS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "repeats is %d; legal is 0 (the default) to %d", options->repeats,
                    CLT_REPEATS_MAX);
  }
  if (options->checks < 0 || options->checks > CHECKS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "checks is %d; legal is 0 to %d", options->checks, CHECKS_MAX);
  }
  if (!(options->error >= 0 && options->error <= ERROR_MAX) || !(options->seconds >= 0)) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "the wanted error is %g, the seconds allowed are %g; legal is 0 (the default) to %g, and 0 (no limit) "
        "or more",
        options->error, options->seconds, ERROR_MAX);
  }
  if (options->watch < -1 || options->watch > WATCH_MAX || !(options->watch_s >= 0) || !(options->patience_s >= 0)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "watch is %d, and %g s, patience %g s; legal is -1 (by itself), 0 (off) to %d, and 0 or more",
                    options->watch, options->watch_s, options->patience_s, WATCH_MAX);
  }
  checked->error = options->error > 0 ? options->error : ERROR_DEFAULT;
  checked->threshold = options->threshold > 0 ? options->threshold : THRESHOLD_DEFAULT;
  return CLT_OK;
}

static clt_status measure_black_and_flood(clt_session *session, clt_error *error) {
  clt_session_fill(session, 0);
  clt_status status = clt_session_average(session, "black", &session->black, &session->black_variance, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_session_fill(session, 1);
  status = clt_session_average(session, "flood", &session->flood, &session->flood_variance, error);
  size_t values = clt_image_size(&session->flood);
  for (size_t i = 0; status == CLT_OK && i < values; i++) {
    session->flood.data[i] -= session->black.data[i];
    session->flood_variance.data[i] += session->black_variance.data[i];
  }
  return status;
}

static clt_status write_black_and_flood(const clt_session *session, clt_transport *transport, clt_error *error) {
  clt_status status = clt_transport_keep_flood(transport, error);
  size_t bytes = session->cells * sizeof(float);
  for (int c = 0; status == CLT_OK && c < session->info.channels; c++) {
    memcpy(clt_transport_black(transport, c), session->black.data + (size_t)c * session->cells, bytes);
    memcpy(clt_transport_flood_values(transport, c), session->flood.data + (size_t)c * session->cells, bytes);
  }
  return status;
}

static void write_provenance(const clt_session *session, const clt_scheme *scheme, double error,
                             clt_transport *transport) {
  clt_rig_info now;
  session->rig->operations->describe(session->rig, &now);
  clt_provenance *origin = clt_transport_provenance(transport);
  *origin = (clt_provenance){.acquired = (int64_t)time(NULL),
                             .patterns = (int)(session->progress.done + session->watch.dropped),
                             .frames = (int)(now.frames - session->info.frames),
                             .seconds = clt_clock_since(session->started_ns),
                             .error = error};
  snprintf(origin->plan, sizeof origin->plan, "%s", session->plan);
  if (session->watch.unexplained > 0) {
    const size_t used = strlen(origin->plan);
    snprintf(origin->plan + used, sizeof origin->plan - used,
             "; %ld patterns did not add up: check the camera's response", session->watch.unexplained);
  }
  if (session->progress.resumed > 0) {
    const size_t used = strlen(origin->plan);
    snprintf(origin->plan + used, sizeof origin->plan - used, "; %ld patterns from before an interruption",
             session->progress.resumed);
  }
  snprintf(origin->scheme, sizeof origin->scheme, "%s", scheme->name);
  snprintf(origin->source, sizeof origin->source, "%s", now.source != NULL ? now.source : "");
  snprintf(origin->response, sizeof origin->response, "%s", now.response != NULL ? now.response : "");
}

/* One pass, which the watch may break off. */
static clt_status measure_once(clt_session *session, const clt_scheme *scheme, clt_transport **out, clt_error *error) {
  clt_transport *transport = NULL;
  clt_status status = clt_session_take_landmark(session, error);
  const bool resumes = session->journal.inherited;
  if (status == CLT_OK) {
    status = measure_black_and_flood(session, error);
  }
  if (status == CLT_OK && resumes) {
    status = clt_session_confirm(session, error);
  }
  if (status == CLT_OK) {
    clt_session_watch(session);
    status = scheme->measure(session, &transport, error);
  }
  if (status == CLT_OK) {
    status = clt_session_look(session, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  session->watch.ready = false;
  *out = transport;
  return CLT_OK;
}

/* Passes until the watch is content; all but the first take from the journal what was good. */
static clt_status measure(clt_session *session, const clt_scheme *scheme, clt_transport **out, clt_error *error) {
  clt_session_mark_start(session);
  for (;;) {
    bool again = false;
    clt_status status = measure_once(session, scheme, out, error);
    if (status == CLT_OK) {
      return status;
    }
    clt_status back = clt_session_begin_again(session, &again, error);
    if (back != CLT_OK || !again) {
      return back != CLT_OK ? back : status;
    }
  }
}

/* What would have to be kept to measure only what was disturbed again: two values a cell and channel and pattern. */
static bool is_worth_keeping(const clt_session *session, const clt_scheme *scheme) {
  double patterns = 2.0 * session->options.repeats + (double)scheme->patterns(session);
  double bytes = 2.0 * sizeof(float) * (double)session->cells * session->info.channels * patterns;
  return session->options.watch >= 0 || bytes <= WATCH_KEEPS_MOST;
}

static clt_status acquire(clt_session *session, const clt_scheme *scheme, clt_transport **out, clt_error *error) {
  const clt_acquire_options *options = &session->options;
  session->progress.total =
      session->progress.done + 2L * options->repeats + scheme->patterns(session) + options->checks;
  clt_transport *transport = NULL;
  double relative = -1;
  clt_status status = measure(session, scheme, &transport, error);
  if (status == CLT_OK) {
    status = write_black_and_flood(session, transport, error);
  }
  if (status == CLT_OK) {
    session->progress.total = session->progress.done + options->checks;
    status = clt_session_check(session, transport, &relative, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  write_provenance(session, scheme, relative, transport);
  *out = transport;
  return CLT_OK;
}

clt_status clt_acquire(clt_rig *rig, const clt_acquire_options *options, clt_transport **out, clt_error *error) {
  clt_acquire_options checked;
  clt_status status = check_options(options, &checked, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_session session;
  const clt_scheme *scheme = NULL;
  status = clt_session_init(&session, rig, &checked, error);
  if (status == CLT_OK) {
    status = clt_choose_scheme(&session, &scheme, error);
  }
  if (status == CLT_OK) {
    session.options.repeats = checked.repeats > 0 ? checked.repeats : scheme->repeats(session.cells);
    bool kept = is_worth_keeping(&session, scheme);
    session.options.watch = checked.watch < 0 ? WATCH_DEFAULT : checked.watch;
    status = clt_session_begin_watch(&session, kept, error);
  }
  if (status == CLT_OK) {
    status = acquire(&session, scheme, out, error);
  }
  clt_session_finish(&session);
  return status;
}
