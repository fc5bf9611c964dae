#include "acquire/session.h"

#include <math.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"

/* Between two tries at a device that fails. */
#define PAUSE_FIRST_S 0.01
#define PAUSE_LAST_S 1.0
/* Part of its light by which a single cell, whose edges may shake, may be above white, and the share of cells that may
 * go wrong as defective pixels do. */
#define STEADY_CELL 0.1
#define DOUBTFUL_SHARE 0.01

clt_status clt_session_init(clt_session *session, clt_rig *rig, const clt_acquire_options *options, clt_error *error) {
  *session = (clt_session){.rig = rig, .options = *options, .started_ns = clt_clock_ns()};
  clt_rig_info *info = &session->info;
  rig->operations->describe(rig, info);
  session->cells = (size_t)info->width * (size_t)info->height;
  clt_image *const images[] = {&session->drive,          &session->seen,  &session->deviation,     &session->black,
                               &session->black_variance, &session->flood, &session->flood_variance};
  clt_status status = CLT_OK;
  for (size_t i = 0; status == CLT_OK && i < sizeof images / sizeof images[0]; i++) {
    status = clt_image_init(images[i], info->channels, info->height, info->width, error);
  }
  status = status == CLT_OK ? clt_journal_open(&session->journal, options, info, error) : status;
  clt_image *const landmark[] = {&session->landmark, &session->landmark_deviation};
  for (int i = 0; session->journal.file >= 0 && status == CLT_OK && i < 2; i++) {
    status = clt_image_init(landmark[i], info->channels, info->height, info->width, error);
  }
  return status;
}

clt_status clt_session_begin_watch(clt_session *session, bool kept, clt_error *error) {
  clt_status status = clt_watch_init(&session->watch, &session->options, &session->info, error);
  return status == CLT_OK && kept && session->options.journal == NULL && session->watch.every > 0
             ? clt_journal_open_unnamed(&session->journal, error)
             : status;
}

void clt_session_finish(clt_session *session) {
  clt_journal_close(&session->journal);
  clt_watch_finish(&session->watch);
  clt_image_finish(&session->drive);
  clt_image_finish(&session->seen);
  clt_image_finish(&session->deviation);
  clt_image_finish(&session->black);
  clt_image_finish(&session->black_variance);
  clt_image_finish(&session->landmark);
  clt_image_finish(&session->landmark_deviation);
  clt_image_finish(&session->flood);
  clt_image_finish(&session->flood_variance);
}

void clt_session_fill(clt_session *session, float value) {
  size_t values = clt_image_size(&session->drive);
  for (size_t i = 0; i < values; i++) {
    session->drive.data[i] = value;
  }
}

static clt_status report(clt_session *session, const char *phase, clt_error *error) {
  clt_progress *progress = &session->progress;
  progress->phase = phase;
  progress->seconds = clt_clock_since(session->started_ns);
  if (session->options.progress != NULL && !session->options.progress(session->options.context, progress)) {
    return clt_fail(error, CLT_CANCELLED, "the acquisition was cancelled after %ld patterns", progress->done);
  }
  return CLT_OK;
}

static long count_doubted(const clt_session *session) {
  clt_rig_info now;
  session->rig->operations->describe(session->rig, &now);
  return now.doubted;
}

/* *moving: where it fails, it does so by what is seen, not by a device. */
static clt_status observe_possible(clt_session *session, bool *moving, clt_error *error) {
  const clt_watch *watch = &session->watch;
  const long doubted = count_doubted(session);
  clt_status status =
      session->rig->operations->observe(session->rig, &session->drive, &session->seen, &session->deviation, error);
  *moving = status == CLT_OK || (status == CLT_TIMEOUT && count_doubted(session) > doubted);
  if (status != CLT_OK || !watch->ready) {
    return status;
  }
  double share =
      clt_watch_impossible(&watch->expected, &watch->variance, &session->seen, &session->deviation, STEADY_CELL);
  return share <= DOUBTFUL_SHARE
             ? CLT_OK
             : clt_fail(error, CLT_TIMEOUT,
                        "%.2g %% of the cells are brighter than under the white picture, or saturated: another light "
                        "is on, or the frames are not of their picture",
                        100 * share);
}

/* Whether trying again may help, and is not the caller's. */
static bool is_worth_waiting(const clt_session *session, clt_status status, bool moving) {
  const clt_acquire_options *options = &session->options;
  const bool lasts = options->reopens ? !moving : status == CLT_GONE && options->recorded;
  return session->watch.every > 0 && (status == CLT_TIMEOUT || status == CLT_GONE) && !lasts;
}

/* By the rig, however often it takes: a device that does not answer, or is gone, may come back, and who walks by is
 * gone soon. */
static clt_status observe_patiently(clt_session *session, clt_error *error) {
  clt_watch *watch = &session->watch;
  const int64_t started_ns = clt_clock_ns();
  double pause_s = PAUSE_FIRST_S;
  for (int tries = 1;; tries++) {
    bool moving = false;
    clt_status status = observe_possible(session, &moving, error);
    if (!is_worth_waiting(session, status, moving)) {
      return status;
    }
    watch->troubled = true;
    if (clt_clock_since(started_ns) >= watch->patience_s) {
      return clt_fail_within(error, "tried %d times in %.3g s: ", tries, clt_clock_since(started_ns));
    }
    status = report(session, "waiting", error);
    if (status != CLT_OK) {
      return status;
    }
    nanosleep(&(struct timespec){.tv_sec = (time_t)pause_s, .tv_nsec = (long)(1e9 * fmod(pause_s, 1))}, NULL);
    pause_s = fmin(2 * pause_s, PAUSE_LAST_S);
  }
}

/* From the journal, or from the rig and into the journal. */
static clt_status observe(clt_session *session, clt_error *error) {
  clt_image *drive = &session->drive, *seen = &session->seen, *deviation = &session->deviation;
  bool found = false;
  const bool inherited = session->journal.inherited;
  clt_status status = clt_journal_replay(&session->journal, drive, seen, deviation, &found, error);
  if (status != CLT_OK || found) {
    session->progress.resumed += found && inherited;
    return status;
  }
  status = observe_patiently(session, error);
  return status == CLT_OK ? clt_journal_add(&session->journal, drive, seen, deviation, error) : status;
}

/* Exposures that contradict each other may have seen something move: a look is due. */
static void note_doubt(clt_session *session) {
  clt_watch *watch = &session->watch;
  clt_rig_info now;
  session->rig->operations->describe(session->rig, &now);
  watch->since = now.doubted > watch->doubted ? watch->every : watch->since;
  watch->doubted = now.doubted;
  watch->now_s = now.seconds;
}

/* Of a pattern that this session showed. */
static double mean_seconds(const clt_progress *progress) {
  return progress->seconds / fmax((double)(progress->done - progress->resumed), 1);
}

/* Counts an observation that was made with this status. */
static clt_status count(clt_session *session, clt_status status, const char *phase, clt_error *error) {
  clt_progress *progress = &session->progress;
  if (status == CLT_CANCELLED) {
    return status;
  }
  if (status != CLT_OK) {
    return clt_fail_within(error, "acquiring (%s, pattern %ld): ", phase, progress->done + 1);
  }
  note_doubt(session);
  progress->done++;
  progress->total = progress->done > progress->total ? progress->done : progress->total;
  progress->seconds = clt_clock_since(session->started_ns);
  progress->left = mean_seconds(progress) * (double)(progress->total - progress->done);
  return report(session, phase, error);
}

clt_status clt_session_take(clt_session *session, const char *phase, clt_error *error) {
  return count(session, observe(session, error), phase, error);
}

clt_status clt_session_take_anew(clt_session *session, const char *phase, clt_error *error) {
  return count(session, observe_patiently(session, error), phase, error);
}

/* Summed patterns are checked by sums as well. */
static clt_status observe_pattern(clt_session *session, bool summed, const char *phase, clt_error *error) {
  clt_watch *watch = &session->watch;
  clt_status status = clt_session_look_before(session, summed, error);
  watch->since++;
  status = status == CLT_OK ? clt_session_take(session, phase, error) : status;
  if (status == CLT_OK && watch->every > 0) {
    clt_watch_correct(watch, &session->black, &session->seen, &session->deviation);
  }
  if (status == CLT_OK && watch->ready && summed) {
    const double weight = session->weight != 0 ? session->weight : clt_group_fit(&watch->group, &session->drive);
    clt_group_add(&watch->group, weight, &session->drive, &session->seen, &session->deviation, &session->black);
  }
  return status;
}

clt_status clt_session_observe(clt_session *session, const char *phase, clt_error *error) {
  return observe_pattern(session, true, phase, error);
}

clt_status clt_session_test(clt_session *session, const char *phase, clt_error *error) {
  return observe_pattern(session, false, phase, error);
}

/* Sums and numbers of the valid observations. */
static clt_status sum_repeats(clt_session *session, const char *phase, clt_image *sum, clt_image *count,
                              clt_error *error) {
  size_t values = clt_image_size(sum);
  memset(sum->data, 0, values * sizeof *sum->data);
  memset(count->data, 0, values * sizeof *count->data);
  for (int k = 0; k < session->options.repeats; k++) {
    clt_status status = clt_session_observe(session, phase, error);
    if (status == CLT_OK && session->watch.every > 0) {
      status = clt_session_compare_repeat(session, k, error);
    }
    if (status != CLT_OK) {
      return status;
    }
    for (size_t i = 0; i < values; i++) {
      if (isfinite(session->deviation.data[i])) {
        sum->data[i] += session->seen.data[i];
        count->data[i] += 1;
      }
    }
  }
  return CLT_OK;
}

clt_status clt_session_average(clt_session *session, const char *phase, clt_image *mean, clt_image *variance,
                               clt_error *error) {
  clt_session_mark_good(session);
  /* Until all are there, mean holds the sums and variance the numbers. The deviations of the repeats are alike, so that
   * the last one stands for all. */
  clt_status status = sum_repeats(session, phase, mean, variance, error);
  size_t values = clt_image_size(mean);
  for (size_t i = 0; status == CLT_OK && i < values; i++) {
    float count = variance->data[i], deviation = session->deviation.data[i];
    mean->data[i] = count > 0 ? mean->data[i] / count : session->seen.data[i];
    variance->data[i] = count > 0 ? deviation * deviation / count : INFINITY;
  }
  session->watch.disturbed_ns = status == CLT_OK ? 0 : session->watch.disturbed_ns;
  return status;
}

bool clt_session_may_go_on(const clt_session *session) {
  const clt_progress *progress = &session->progress;
  const double allowed = session->options.seconds, each = mean_seconds(progress);
  return !(allowed > 0) || progress->seconds + (1 + session->options.checks) * each <= allowed;
}
