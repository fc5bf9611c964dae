#include "daemon/moving.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/memory.h"
#include "daemon/input.h"
#include "daemon/rank.h"

enum { COLOURS = 3, UNCOMPENSATED_CELLS = 1 };

static const double report_s = 0.25, usual_refresh_s = 1.0 / 60;
/* Where no frame is decoded, the player is looked at again after this part of a refresh. */
static const double look_part = 0.25;
/* Repetitions of a picture that stands still, after which it is as good as it gets. */
enum { REPEATS_MOST = 60 };
/* So many frames in a row without a step, from the first on, are worth a warning. */
enum { DIRECT_MOST = 30 };

typedef struct mover {
  const daemon_boxes *boxes;
  rank_work work;     /* to compute a frame */
  bool behind;        /* this thread goes behind that of the glass, which cannot be undone */
  moving_job *job;    /* in work; NULL: none */
  player *playing;    /* NULL: nothing moves */
  clt_frames *frames; /* NULL: shown uncompensated */
  player_frame frame; /* the latest */
  bool any, settled;  /* there is one; and nothing is left to improve */
  int repeats;
  uint64_t computed; /* frames, repetitions not among them */
  uint32_t seed;
  int64_t computed_ns, reported_ns; /* 0: not yet */
  int64_t told_ns;                  /* the film's time that scale and offset have followed to; 0: none */
  moving_report found, reported;
} mover;

static double refresh_s(const mover *self) {
  return self->job->projector.refresh_s > 0 ? self->job->projector.refresh_s : usual_refresh_s;
}

/* A device delivers what is shown, by no clock of ours. */
static bool is_live(const mover *self) {
  return self->frame.shape.seconds == 0;
}

static void stop_playing(mover *self) {
  player_destroy(self->playing);
  clt_frames_destroy(self->frames);
  moving_job_free(self->job);
  self->playing = NULL;
  self->frames = NULL;
  self->job = NULL;
}

/* Says once that the film stands still, and that it goes on. */
static void follow_film(mover *self) {
  clt_error problem = {0};
  bool stands = player_failed(self->playing, &problem), stood = self->found.why[0] != '\0';
  if (stands && !stood) {
    clt_log(CLT_LOG_ERROR, "what moves stands still: %s", problem.message);
  } else if (stood && !stands) {
    clt_log(CLT_LOG_NOTICE, "what moves goes on");
  }
  snprintf(self->found.why, sizeof self->found.why, "%s", stands ? problem.message : "");
}

/* What became of frames on their way to the glass. */
static void add_shown(mover *self) {
  const reel_counts counts = reel_count(self->boxes->reel);
  self->found.frames += counts.shown;
  self->found.late += counts.late;
  self->found.skipped += counts.skipped;
}

static void report(mover *self) {
  double passed = clt_clock_since(self->reported_ns);
  moving_report *letter = passed >= report_s ? clt_alloc(1, sizeof *letter) : NULL;
  if (letter == NULL) {
    return;
  }
  add_shown(self);
  self->found.slipped = player_slipped(self->playing);
  follow_film(self);
  self->found.fps = (double)(self->found.frames - self->reported.frames) / passed;
  self->reported = self->found;
  self->reported_ns = clt_clock_ns();
  *letter = self->found;
  daemon_report(self->boxes, self->boxes->moved, letter);
}

/* What a device delivers is urgent, and what is computed ahead is not. */
static void take_rank(mover *self) {
  if (!self->behind && self->job->path[0] != '\0' && !input_is(self->job->path)) {
    rank_behind(RANK_AHEAD);
    self->behind = true;
  }
}

/* A new job keeps the film running where only the rest of it is new: what was computed ahead is shown meanwhile. */
static void take_job(mover *self, moving_job *job) {
  clt_error error = {0};
  bool goes_on = self->playing != NULL && strcmp(self->job->path, job->path) == 0 &&
                 self->job->projector.width == job->projector.width &&
                 self->job->projector.height == job->projector.height;
  player *kept = goes_on ? self->playing : NULL;
  const moving_report before = self->found;
  if (!goes_on) {
    player_codes_drop(self->frame.codes);
    self->frame = (player_frame){0};
    reel_clear(self->boxes->reel);
  }
  add_shown(self);
  self->playing = goes_on ? NULL : self->playing;
  stop_playing(self);
  *self = (mover){.boxes = self->boxes,
                  .work = self->work,
                  .behind = self->behind,
                  .job = job,
                  .playing = kept,
                  .frame = self->frame,
                  .any = goes_on && self->any,
                  .seed = self->seed,
                  .reported_ns = clt_clock_ns()};
  self->found.serial = job->serial;
  snprintf(self->found.why, sizeof self->found.why, "%s", goes_on ? before.why : "");
  take_rank(self);
  clt_film_options options = {job->projector.width, job->projector.height, job->picture_s};
  clt_status status = CLT_OK;
  if (job->path[0] != '\0' && kept == NULL) {
    status = player_create(job->path, &options, &self->playing, &error);
  }
  if (status == CLT_OK && self->playing != NULL && job->model != NULL) {
    const daemon_model *model = job->model;
    status = clt_frames_create(model->moving != NULL ? model->moving : model->transport, model->certificate,
                               &job->frames, &self->frames, &error);
  }
  if (status != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "what moves is not shown, the picture stays: %s", error.message);
    stop_playing(self);
  }
}

/* A frame of a film goes up when it is due; what a device delivers, and a better picture of the same frame, at once. */
static void fill_picture(mover *self, reel_picture *letter, bool fresh, int grid_width, int grid_height) {
  size_t cells = (size_t)grid_width * (size_t)grid_height;
  const clt_film_frame *shape = &self->frame.shape;
  letter->content = player_codes_hold(self->frame.codes);
  letter->serial = self->job->serial;
  letter->due_ns = fresh && !is_live(self) ? self->frame.due_ns : 0;
  letter->beside = self->frames != NULL && !is_live(self);
  letter->picture = (clt_live_picture){.width = shape->width,
                                       .height = shape->height,
                                       .content = letter->content->data,
                                       .grid_width = grid_width,
                                       .grid_height = grid_height,
                                       .gain = letter->fields,
                                       .offset = letter->fields + COLOURS * cells,
                                       .panel = self->job->panel,
                                       .seed = self->seed++};
}

/* Gain 1 and offset 0, or what the frame needs. */
static clt_status compute(mover *self, reel_picture *letter, size_t cells, double seconds, clt_error *error) {
  float *gain = letter->fields, *offset = letter->fields + COLOURS * cells;
  if (self->frames != NULL) {
    const clt_film_frame *shape = &self->frame.shape;
    return clt_frames_next(self->frames, self->frame.codes->data, shape->width, shape->height, seconds, gain, offset,
                           &self->found.last, error);
  }
  for (size_t i = 0; i < COLOURS * cells; i++) {
    gain[i] = 1;
    offset[i] = 0;
  }
  self->found.last.settled = true;
  return CLT_OK;
}

/* What the frame took. Whether one of a film is late is found when it goes up; what a device delivers is late where it
 * is ready more than a refresh after it came. */
static void count(mover *self, int64_t start_ns, bool fresh, int skipped) {
  moving_report *found = &self->found;
  int64_t now_ns = clt_clock_ns();
  self->computed += fresh;
  found->skipped += (uint64_t)skipped;
  found->late += fresh && is_live(self) && 1e-9 * (double)(now_ns - self->frame.due_ns) > refresh_s(self);
  found->direct += fresh && found->last.direct;
  if (fresh && found->last.direct && found->direct == DIRECT_MOST && self->computed == DIRECT_MOST) {
    clt_log(CLT_LOG_WARNING,
            "budget_ms = %g leaves no time to solve with this transport: frames follow their direct "
            "light only; raise it, or measure fewer cells",
            self->job->frames.live.budget_ms);
  }
  found->ms = 1e-6 * (double)(now_ns - start_ns);
  found->slow += fresh && found->ms > 1e3 * refresh_s(self);
  found->compensated = self->frames != NULL;
}

/* Seconds of the film since the frame before. Time runs ahead with what is computed ahead, never back. */
static double pass_time(mover *self, bool fresh) {
  const int64_t before_ns = self->told_ns, now_ns = clt_clock_ns();
  const int64_t shown_ns = fresh && !is_live(self) ? self->frame.due_ns : now_ns;
  self->told_ns = shown_ns > before_ns ? shown_ns : before_ns;
  return before_ns != 0 ? 1e-9 * (double)(self->told_ns - before_ns) : refresh_s(self);
}

static void show_frame(mover *self, bool fresh, int skipped) {
  clt_transport_info grid = {.width = UNCOMPENSATED_CELLS, .height = UNCOMPENSATED_CELLS, .cols = 1};
  clt_error error = {0};
  int64_t start_ns = clt_clock_ns();
  double seconds = pass_time(self, fresh);
  if (self->frames != NULL) {
    grid = clt_transport_describe(self->job->model->transport);
  }
  reel_picture *letter = reel_blank(self->boxes->reel, 2 * COLOURS * grid.cols * sizeof(float));
  rank_begin(&self->work, is_live(self) ? 0 : 1, self->frame.shape.seconds);
  clt_status status = letter != NULL ? compute(self, letter, grid.cols, seconds, &error)
                                     : clt_fail(&error, CLT_FAILED, "out of memory");
  rank_end(&self->work);
  self->computed_ns = start_ns;
  self->repeats = fresh ? 0 : self->repeats + 1;
  self->settled = status != CLT_OK || self->found.last.settled || self->repeats >= REPEATS_MOST;
  if (status != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "a frame is left out: %s", error.message);
    reel_picture_free(letter);
    return;
  }
  fill_picture(self, letter, fresh, grid.width, grid.height);
  reel_put(self->boxes->reel, letter);
  count(self, start_ns, fresh, skipped);
}

/* Seconds before it is due at which a frame is begun: its budget, and as much as may lie ready. */
static double lead_s(const mover *self) {
  return 1e-3 * self->job->frames.live.budget_ms + REEL_AHEAD * refresh_s(self);
}

/* Seconds until the picture is to be computed again, which happens once a refresh while it stands still on the glass,
 * until nothing is left to improve; infinite: not at all. */
static double repeat_s(const mover *self) {
  if (!self->any || self->settled) {
    return INFINITY;
  }
  const double due_s = 1e-9 * (double)(self->frame.due_ns - clt_clock_ns());
  return fmax(due_s, refresh_s(self) - clt_clock_since(self->computed_ns));
}

/* Frames are passed over that would be ready, as the last one was, only when the one behind them is due. */
static void play(mover *self) {
  const int64_t now_ns = clt_clock_ns();
  const double usual_s = fmin(1e-3 * self->found.ms, refresh_s(self));
  int skipped = 0;
  bool fresh = reel_wait(self->boxes->reel, refresh_s(self)) <= 0 &&
               player_take(self->playing, now_ns + llround(1e9 * lead_s(self)), now_ns + llround(1e9 * usual_s),
                           &self->frame, &skipped);
  self->any = self->any || fresh;
  if (fresh || repeat_s(self) <= 0) {
    show_frame(self, fresh, skipped);
  }
  report(self);
}

/* Until there is something to do; < 0: for ever. */
static double pause_s(mover *self) {
  if (self->playing == NULL) {
    return -1;
  }
  const double due_s = player_due(self->playing);
  const double next_s = isfinite(due_s) ? fmax(due_s - lead_s(self), reel_wait(self->boxes->reel, refresh_s(self)))
                                        : look_part * refresh_s(self);
  return fmax(0, fmin(fmin(next_s, repeat_s(self)), report_s));
}

void *moving_run(void *boxes) {
  mover self = {.boxes = boxes, .work = rank_open()};
  bool stopping = false;
  rank_take_turns(RANK_REFRESH);
  while (!stopping) {
    moving_job *job = clt_mailbox_take(self.boxes->moving_jobs, pause_s(&self));
    if (job != NULL && !job->stop) {
      take_job(&self, job);
    } else if (job != NULL) {
      stopping = true;
      moving_job_free(job);
    }
    if (!stopping && self.playing != NULL) {
      play(&self);
    }
  }
  stop_playing(&self);
  player_codes_drop(self.frame.codes);
  return NULL;
}
