/* Content that moves: what the moving thread is given, and what it tells. */
#include <stdio.h>
#include <string.h>

#include "base/memory.h"
#include "daemon/control.h"
#include "image/film.h"

bool control_moves(const control *self) {
  return strcmp(self->found.content, self->config.content) == 0 && clt_film_moves(self->config.content);
}

static void describe(const control *self, moving_job *job) {
  const control_findings *found = &self->found;
  *job = (moving_job){.serial = found->content_serial,
                      .projector = found->devices.projector,
                      .panel = found->devices.panel,
                      .model = found->model,
                      .frames = {.live = self->config.live, .white = self->config.white, .reach = self->config.reach},
                      .picture_s = self->config.picture_s};
  if (control_moves(self)) {
    snprintf(job->path, sizeof job->path, "%s", self->config.content);
  }
}

static bool is_same(const moving_job *a, const moving_job *b) {
  const clt_frames_options *p = &a->frames, *q = &b->frames;
  return strcmp(a->path, b->path) == 0 &&
         (a->path[0] == '\0' ||
          (a->serial == b->serial && a->model == b->model && a->picture_s == b->picture_s &&
           a->projector.width == b->projector.width && a->projector.height == b->projector.height &&
           p->live.budget_ms == q->live.budget_ms && p->live.target_error == q->live.target_error &&
           p->reach == q->reach && p->white.kind == q->white.kind && p->white.value == q->white.value));
}

static void give(control *self, const moving_job *wanted) {
  moving_job *job = clt_alloc(1, sizeof *job);
  if (job != NULL) {
    *job = *wanted;
    job->model = model_hold(wanted->model);
    self->work.playing = *wanted;
    clt_mailbox_put(self->boxes->moving_jobs, job);
  }
}

void control_play(control *self) {
  moving_job wanted;
  describe(self, &wanted);
  if (self->found.open && !is_same(&wanted, &self->work.playing) && self->state != STATE_STOPPING) {
    give(self, &wanted);
  }
}

void control_stop_moving(control *self) {
  give(self, &(moving_job){.stop = true});
}

void control_on_moved(control *self, const moving_report *letter) {
  if (letter->serial == self->found.content_serial && control_moves(self)) {
    self->found.moved = *letter;
    server_notify_latest(self->service, "frames", control_moving_note(self));
  }
}
