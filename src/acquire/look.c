/* Looks: whether the room is as it was, and was while each pattern was photographed. */
#include <math.h>
#include <string.h>

#include "acquire/session.h"
#include "base/clock.h"

/* The black picture is mostly the room's own light, which flickers. */
#define STEADY_BLACK 0.3
/* Disturbances after which it is no use to begin again. */
enum { PASSES_MAX = 100 };
/* Patterns of one sum: one that is disturbed changes it by so much less. */
enum { GROUP_MOST = 25 };

void clt_session_mark_start(clt_session *session) {
  clt_watch *watch = &session->watch;
  watch->start = watch->good = clt_journal_here(&session->journal);
  watch->start_done = watch->good_done = session->progress.done;
}

void clt_session_mark_good(clt_session *session) {
  clt_watch *watch = &session->watch;
  watch->good = clt_journal_here(&session->journal);
  watch->good_done = session->progress.done;
  watch->since = 0;
  watch->good_s = watch->now_s;
  watch->troubled = false;
}

void clt_session_watch(clt_session *session) {
  clt_watch *watch = &session->watch;
  if (watch->every == 0) {
    return;
  }
  size_t values = clt_image_size(&session->flood);
  for (size_t i = 0; i < values; i++) {
    watch->expected.data[i] = session->flood.data[i] + session->black.data[i];
    watch->variance.data[i] = session->flood_variance.data[i];
  }
  watch->ready = true;
  clt_group_clear(&watch->group);
  clt_session_mark_good(session);
}

clt_status clt_session_begin_again(clt_session *session, bool *again, clt_error *error) {
  clt_watch *watch = &session->watch;
  *again = watch->again;
  if (!watch->again) {
    return CLT_OK;
  }
  watch->dropped += session->progress.done - watch->good_done;
  watch->unexplained = 0;
  session->progress.done = watch->start_done;
  if (session->progress.resumed > watch->good_done) {
    session->progress.resumed = watch->good_done;
  }
  watch->again = watch->ready = false;
  clt_watch_forget_lamp(watch);
  return session->journal.file >= 0 ? clt_journal_go_back(&session->journal, watch->start, watch->good, error) : CLT_OK;
}

/* Whether the patterns since the last good look may be measured once more. Where nothing was kept, all others would
 * have to be as well. */
static bool may_repeat(clt_session *session) {
  const bool may = session->journal.file >= 0 && session->watch.passes < PASSES_MAX;
  session->watch.passes += may;
  return may;
}

/* What to do where they may not. */
static const char *advise(const clt_session *session) {
  return session->journal.file >= 0 ? "keep people and lights out, check the devices, and measure again"
                                    : "measure again with a journal (--resume FILE), so that only these patterns are "
                                      "repeated; for all of them there is no room";
}

static clt_status fail_changed(const clt_session *session, const clt_change *change, int looks, clt_error *error) {
  const clt_watch *watch = &session->watch;
  char what[160];
  clt_change_format(change, what, sizeof what);
  return clt_fail(error, CLT_FAILED,
                  "the room changed while it was measured: %s since pattern %ld, in each of %d looks during %.3g s; "
                  "keep people and lights out of it, let the lamp warm up, and measure again",
                  what, watch->good_done, looks, watch->patience_s);
}

/* Shows another drive than the pattern that waits. */
static clt_status take_instead(clt_session *session, clt_image *drive, const char *phase, clt_error *error) {
  const clt_image waiting = session->drive;
  session->drive = *drive;
  clt_status status = clt_session_take(session, phase, error);
  session->drive = waiting;
  return status;
}

/* Looks until white is what it was. */
static clt_status look_until_same(clt_session *session, int *looks, clt_error *error) {
  clt_watch *watch = &session->watch;
  const int64_t started_ns = clt_clock_ns();
  for (*looks = 1;; ++*looks) {
    double lamp[CLT_CHANNELS_MAX];
    clt_status status = take_instead(session, &watch->white, "look", error);
    if (status != CLT_OK) {
      return status;
    }
    clt_change change = clt_watch_compare_lamp(&watch->expected, &watch->variance, &session->black, &session->seen,
                                               &session->deviation, CLT_STEADY, lamp);
    if (!(change.share > 0)) {
      memcpy(watch->lamp, lamp, (size_t)session->info.channels * sizeof *lamp);
      return CLT_OK;
    }
    if (clt_clock_since(started_ns) >= watch->patience_s) {
      return fail_changed(session, &change, *looks, error);
    }
  }
}

static clt_status look_at_white(clt_session *session, clt_error *error) {
  clt_watch *watch = &session->watch;
  int looks = 0;
  clt_status status = look_until_same(session, &looks, error);
  if (status != CLT_OK) {
    return status;
  }
  if (looks > 1 || watch->troubled) {
    watch->again = may_repeat(session);
    return clt_fail(error, CLT_FAILED,
                    "the room or the devices were disturbed after pattern %ld (measured again %d times): %s",
                    watch->good_done, watch->passes, advise(session));
  }
  clt_group_clear(&watch->group);
  clt_session_mark_good(session);
  return CLT_OK;
}

/* Waits until white is as it was, to measure the group again. */
static clt_status refuse_group(clt_session *session, const clt_change *change, clt_error *error) {
  clt_watch *watch = &session->watch;
  char what[160];
  int looks = 0;
  clt_change_format(change, what, sizeof what);
  const clt_group refused = watch->group;
  watch->group = watch->earlier;
  watch->earlier = refused;
  clt_status status = look_until_same(session, &looks, error);
  if (status != CLT_OK) {
    return status;
  }
  watch->again = may_repeat(session);
  return clt_fail(error, CLT_FAILED,
                  "%ld patterns after number %ld do not add up to what they show together: %s; somebody passed, or "
                  "frames are not of their pictures (measured again %d times): %s",
                  refused.count, watch->good_done, what, watch->passes, advise(session));
}

/* Whether two groups of the same patterns gave the same light. */
static bool shows_same(clt_session *session, const clt_group *earlier, const clt_group *group) {
  for (size_t i = 0; i < clt_image_size(&session->deviation); i++) {
    session->deviation.data[i] = sqrtf(group->variance.data[i]);
  }
  return clt_group_alike(earlier, group) &&
         !(clt_watch_compare(&earlier->light, &earlier->variance, &group->light, &session->deviation, CLT_STEADY)
               .share > 0);
}

/* Patterns that do not add up, and did not the last time with the same light, were not disturbed. Then black was, and
 * all begins again with it; or if that was done before, the camera's values are not in proportion to light. */
static clt_status judge_group(clt_session *session, const clt_change *change, clt_error *error) {
  clt_watch *watch = &session->watch;
  clt_group *group = &watch->group;
  const bool replaying = clt_journal_is_replaying(&session->journal);
  const bool same = !replaying && shows_same(session, &watch->earlier, group);
  if (replaying ? !clt_journal_next_is(&session->journal, &group->drive) : !(same && watch->renewed)) {
    watch->renewed = watch->renewed || same;
    watch->good = same ? watch->start : watch->good;
    watch->good_done = same ? watch->start_done : watch->good_done;
    return refuse_group(session, change, error);
  }
  watch->unexplained += group->count;
  clt_status status = take_instead(session, &group->drive, "sum", error); /* tells whoever replays it */
  return status == CLT_OK && !replaying ? look_at_white(session, error) : status;
}

/* Shows what the patterns of the group lit together. */
static clt_status look_at_sum(clt_session *session, clt_error *error) {
  clt_group *group = &session->watch.group;
  double lamp[CLT_CHANNELS_MAX];
  clt_status status = take_instead(session, &group->drive, "sum", error);
  if (status != CLT_OK) {
    return status;
  }
  clt_group_expect(group, &session->black, &session->black_variance, session->info.rounding);
  clt_change change = clt_watch_compare_lamp(&group->light, &group->variance, &session->black, &session->seen,
                                             &session->deviation, CLT_STEADY, lamp);
  status = change.share > 0 ? judge_group(session, &change, error) : CLT_OK;
  if (status == CLT_OK) {
    clt_group_clear(group);
  }
  return status;
}

clt_status clt_session_look(clt_session *session, clt_error *error) {
  const clt_watch *watch = &session->watch;
  if (!watch->ready || watch->since == 0) {
    return CLT_OK;
  }
  clt_status status = watch->group.count > 0 ? look_at_sum(session, error) : CLT_OK;
  return status == CLT_OK && watch->since > 0 ? look_at_white(session, error) : status;
}

/* By patterns, by time, after a doubt. */
static bool look_is_due(const clt_watch *watch) {
  return watch->since >= watch->every || (watch->every_s > 0 && watch->now_s - watch->good_s >= watch->every_s);
}

/* Whether the next pattern may be added to those that are checked together. */
static bool group_takes(const clt_session *session) {
  const clt_group *group = &session->watch.group;
  if (group->count == 0) {
    return true;
  }
  if (session->weight != 0) {
    return !clt_group_is_drive(group);
  }
  return group->count < GROUP_MOST && clt_group_fit(group, &session->drive) != 0 &&
         !clt_group_is_full(group, &session->black_variance);
}

/* While the journal is replayed: what was looked at then; one without sums is taken as it is. */
static clt_status look_as_before(clt_session *session, bool summed, clt_error *error) {
  const clt_journal *journal = &session->journal;
  clt_watch *watch = &session->watch;
  clt_status status = CLT_OK;
  if (watch->group.count > 0 && clt_journal_next_is(journal, &watch->group.drive)) {
    status = look_at_sum(session, error);
  }
  if (status == CLT_OK && clt_journal_next_is(journal, &watch->white)) {
    status = look_at_white(session, error);
  }
  if (status == CLT_OK && summed && clt_journal_is_replaying(journal) && !group_takes(session)) {
    clt_group_clear(&watch->group);
  }
  return status;
}

clt_status clt_session_look_before(clt_session *session, bool summed, clt_error *error) {
  clt_watch *watch = &session->watch;
  clt_status status = CLT_OK;
  if (watch->ready && session->journal.inherited && !clt_journal_is_replaying(&session->journal)) {
    watch->since = watch->every; /* how bright the lamp is now */
  }
  if (!watch->ready || watch->since == 0) {
    return CLT_OK;
  }
  if (clt_journal_is_replaying(&session->journal)) {
    status = look_as_before(session, summed, error);
  }
  if (status != CLT_OK || clt_journal_is_replaying(&session->journal)) {
    return status;
  }
  if (watch->since > 0 && look_is_due(watch) && clt_group_is_drive(&watch->group)) {
    status = clt_session_look(session, error);
  }
  return status == CLT_OK && summed && !group_takes(session) ? look_at_sum(session, error) : status;
}

clt_status clt_session_compare_repeat(clt_session *session, int k, clt_error *error) {
  clt_watch *watch = &session->watch;
  const double tolerance = session->drive.data[0] > 0 ? CLT_STEADY : STEADY_BLACK;
  size_t values = clt_image_size(&session->seen);
  for (size_t i = 0; k == 0 && i < values; i++) {
    watch->expected.data[i] = session->seen.data[i];
    watch->variance.data[i] = session->deviation.data[i] * session->deviation.data[i];
  }
  clt_change change =
      clt_watch_compare(&watch->expected, &watch->variance, &session->seen, &session->deviation, tolerance);
  if (!(change.share > 0)) {
    return CLT_OK;
  }
  watch->disturbed_ns = watch->disturbed_ns > 0 ? watch->disturbed_ns : clt_clock_ns();
  watch->again = clt_clock_since(watch->disturbed_ns) < watch->patience_s;
  return fail_changed(session, &change, k, error);
}
