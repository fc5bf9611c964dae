#include "acquire/session.h"

#include <math.h>

#include "base/clock.h"

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
  return status == CLT_OK ? clt_journal_open(&session->journal, options->journal, info, error) : status;
}

void clt_session_finish(clt_session *session) {
  clt_journal_close(&session->journal);
  clt_image_finish(&session->drive);
  clt_image_finish(&session->seen);
  clt_image_finish(&session->deviation);
  clt_image_finish(&session->black);
  clt_image_finish(&session->black_variance);
  clt_image_finish(&session->flood);
  clt_image_finish(&session->flood_variance);
}

void clt_session_fill(clt_session *session, float value) {
  size_t values = clt_image_size(&session->drive);
  for (size_t i = 0; i < values; i++) {
    session->drive.data[i] = value;
  }
}

/* From the journal, or from the rig and into the journal. */
static clt_status observe(clt_session *session, clt_error *error) {
  clt_image *drive = &session->drive, *seen = &session->seen, *deviation = &session->deviation;
  bool found = false;
  clt_status status = clt_journal_replay(&session->journal, drive, seen, deviation, &found, error);
  if (status != CLT_OK || found) {
    session->progress.resumed += found;
    return status;
  }
  status = session->rig->operations->observe(session->rig, drive, seen, deviation, error);
  return status == CLT_OK ? clt_journal_add(&session->journal, drive, seen, deviation, error) : status;
}

clt_status clt_session_observe(clt_session *session, const char *phase, clt_error *error) {
  clt_progress *progress = &session->progress;
  clt_status status = observe(session, error);
  if (status != CLT_OK) {
    return clt_fail_within(error, "acquiring (%s, pattern %ld): ", phase, progress->done + 1);
  }
  progress->phase = phase;
  progress->done++;
  progress->total = progress->done > progress->total ? progress->done : progress->total;
  progress->seconds = clt_clock_since(session->started_ns);
  progress->left = progress->seconds / (double)progress->done * (double)(progress->total - progress->done);
  if (session->options.progress != NULL && !session->options.progress(session->options.context, progress)) {
    return clt_fail(error, CLT_CANCELLED, "the acquisition was cancelled after %ld patterns", progress->done);
  }
  return CLT_OK;
}

clt_status clt_session_average(clt_session *session, const char *phase, clt_image *mean, clt_image *variance,
                               clt_error *error) {
  size_t values = clt_image_size(mean);
  /* While averaging, mean holds the sums and variance the number of valid observations. The deviations of the repeats
   * are alike, so that the last one stands for all. */
  for (size_t i = 0; i < values; i++) {
    mean->data[i] = 0;
    variance->data[i] = 0;
  }
  for (int k = 0; k < session->options.repeats; k++) {
    clt_status status = clt_session_observe(session, phase, error);
    if (status != CLT_OK) {
      return status;
    }
    for (size_t i = 0; i < values; i++) {
      if (isfinite(session->deviation.data[i])) {
        mean->data[i] += session->seen.data[i];
        variance->data[i] += 1;
      }
    }
  }
  for (size_t i = 0; i < values; i++) {
    float count = variance->data[i], deviation = session->deviation.data[i];
    mean->data[i] = count > 0 ? mean->data[i] / count : session->seen.data[i];
    variance->data[i] = count > 0 ? deviation * deviation / count : INFINITY;
  }
  return CLT_OK;
}

bool clt_session_may_go_on(const clt_session *session) {
  const clt_progress *progress = &session->progress;
  const double allowed = session->options.seconds, each = progress->seconds / (double)progress->done;
  return !(allowed > 0) || progress->seconds + (1 + session->options.checks) * each <= allowed;
}
