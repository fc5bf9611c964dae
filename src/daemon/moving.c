#include "daemon/moving.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/memory.h"
#include "daemon/player.h"

enum { COLOURS = 3, UNCOMPENSATED_CELLS = 1 };

static const double report_s = 0.25, usual_refresh_s = 1.0 / 60;
/* Repetitions of a picture that stands still, after which it is as good as it gets. */
enum { REPEATS_MOST = 60 };
/* So many frames in a row without a step, from the first on, are worth a warning. */
enum { DIRECT_MOST = 30 };

typedef struct mover {
  const daemon_boxes *boxes;
  moving_job *job;    /* in work; NULL: none */
  player *playing;    /* NULL: nothing moves */
  clt_frames *frames; /* NULL: shown uncompensated */
  player_frame frame; /* the latest */
  bool any, settled;  /* there is one; and nothing is left to improve */
  int repeats;
  uint32_t seed;
  int64_t computed_ns, reported_ns; /* 0: not yet */
  moving_report found, reported;
} mover;

static double refresh_s(const mover *self) {
  return self->job->projector.refresh_s > 0 ? self->job->projector.refresh_s : usual_refresh_s;
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

static void report(mover *self) {
  double passed = clt_clock_since(self->reported_ns);
  moving_report *letter = passed >= report_s ? clt_alloc(1, sizeof *letter) : NULL;
  if (letter == NULL) {
    return;
  }
  self->found.slipped = player_slipped(self->playing);
  follow_film(self);
  self->found.fps = (double)(self->found.frames - self->reported.frames) / passed;
  self->reported = self->found;
  self->reported_ns = clt_clock_ns();
  *letter = self->found;
  daemon_report(self->boxes, self->boxes->moved, letter);
}

/* A new job keeps the film running where only the rest of it is new. */
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
  }
  self->playing = goes_on ? NULL : self->playing;
  stop_playing(self);
  *self = (mover){.boxes = self->boxes,
                  .job = job,
                  .playing = kept,
                  .frame = self->frame,
                  .any = goes_on && self->any,
                  .seed = self->seed,
                  .reported_ns = clt_clock_ns()};
  self->found.serial = job->serial;
  snprintf(self->found.why, sizeof self->found.why, "%s", goes_on ? before.why : "");
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

static bool reserve(output_moving *letter, size_t bytes) {
  if (letter->fields_room < bytes) {
    free(letter->fields);
    letter->fields = clt_alloc(bytes, 1);
    letter->fields_room = letter->fields != NULL ? bytes : 0;
  }
  return letter->fields != NULL;
}

/* A letter with room for the frame's fields: one that came back, or a new one. */
static output_moving *new_letter(const mover *self, size_t cells) {
  output_moving *letter = clt_mailbox_take(self->boxes->spares, 0);
  letter = letter != NULL ? letter : clt_alloc(1, sizeof *letter);
  if (letter == NULL || !reserve(letter, 2 * COLOURS * cells * sizeof(float))) {
    output_moving_free(letter);
    return NULL;
  }
  return letter;
}

static void fill_letter(mover *self, output_moving *letter, int grid_width, int grid_height) {
  size_t cells = (size_t)grid_width * (size_t)grid_height;
  const clt_film_frame *shape = &self->frame.shape;
  letter->content = player_codes_hold(self->frame.codes);
  letter->serial = self->job->serial;
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
static clt_status compute(mover *self, output_moving *letter, size_t cells, double seconds, clt_error *error) {
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

/* What the frame took, and whether it came so late that an older one was shown in its place for over a refresh. */
static void count(mover *self, int64_t start_ns, bool fresh, int skipped) {
  moving_report *found = &self->found;
  int64_t now_ns = clt_clock_ns();
  double late_s = 1e-9 * (double)(now_ns - self->frame.due_ns);
  found->frames += fresh;
  found->skipped += (uint64_t)skipped;
  found->late += fresh && late_s > refresh_s(self);
  found->direct += fresh && found->last.direct;
  if (fresh && found->last.direct && found->direct == DIRECT_MOST && found->frames == DIRECT_MOST) {
    clt_log(CLT_LOG_WARNING,
            "budget_ms = %g leaves no time to solve with this transport: frames follow their direct "
            "light only; raise it, or measure fewer cells",
            self->job->frames.live.budget_ms);
  }
  found->ms = 1e-6 * (double)(now_ns - start_ns);
  found->slow += fresh && found->ms > 1e3 * refresh_s(self);
  found->compensated = self->frames != NULL;
}

static void show_frame(mover *self, bool fresh, int skipped) {
  clt_transport_info grid = {.width = UNCOMPENSATED_CELLS, .height = UNCOMPENSATED_CELLS, .cols = 1};
  clt_error error = {0};
  int64_t start_ns = clt_clock_ns();
  double seconds = self->computed_ns != 0 ? clt_clock_since(self->computed_ns) : refresh_s(self);
  if (self->frames != NULL) {
    grid = clt_transport_describe(self->job->model->transport);
  }
  output_moving *letter = new_letter(self, grid.cols);
  clt_status status = letter != NULL ? compute(self, letter, grid.cols, seconds, &error)
                                     : clt_fail(&error, CLT_FAILED, "out of memory");
  self->computed_ns = start_ns;
  self->repeats = fresh ? 0 : self->repeats + 1;
  self->settled = status != CLT_OK || self->found.last.settled || self->repeats >= REPEATS_MOST;
  if (status != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "a frame is left out: %s", error.message);
    output_moving_free(letter);
    return;
  }
  fill_letter(self, letter, grid.width, grid.height);
  clt_mailbox_put(self->boxes->moving, letter);
  count(self, start_ns, fresh, skipped);
}

/* The next frame is begun so early that it is ready when it is due. A picture that stands still is computed again, once
 * a refresh, until nothing is left to improve. */
static void play(mover *self) {
  int skipped = 0;
  int64_t lead_ns = llround(1e6 * self->job->frames.live.budget_ms);
  bool fresh = player_take(self->playing, clt_clock_ns() + lead_ns, &self->frame, &skipped);
  self->any = self->any || fresh;
  if (fresh || (self->any && !self->settled)) {
    show_frame(self, fresh, skipped);
  }
  report(self);
}

/* Until there is something to do; < 0: for ever. */
static double pause_s(mover *self) {
  if (self->playing == NULL) {
    return -1;
  }
  double next_s = player_due(self->playing) - 1e-3 * self->job->frames.live.budget_ms;
  double longest_s = self->any && !self->settled ? refresh_s(self) - clt_clock_since(self->computed_ns) : report_s;
  double wait_s = isfinite(next_s) && next_s < longest_s ? next_s : self->any ? longest_s : 0.5 * refresh_s(self);
  return wait_s > 0 ? wait_s : 0;
}

void *moving_run(void *boxes) {
  mover self = {.boxes = boxes};
  bool stopping = false;
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
