/* What the machine's actions do. */
#include <stdlib.h>

#include "base/log.h"
#include "base/memory.h"
#include "daemon/control.h"
#include "daemon/geometry.h"

/* Longest time from the wish to stop to the end, s; a solve that cannot be interrupted is left behind then. */
static const double grace_s = 1.0;

/* The output does not turn while it obeys. */
static void order(control *self, output_order_kind kind) {
  output_order *letter = clt_alloc(1, sizeof *letter);
  if (letter != NULL) {
    letter->kind = kind;
    letter->station = self->config.station;
    notify_patience(&self->notify, true);
    geometry_choose(self->config.state, &letter->station);
    clt_mailbox_put(self->boxes->orders, letter);
  }
}

static void open_devices(control *self) {
  order(self, OUTPUT_OPEN);
}

/* A picture for the content as it is, unless there is one already; without a projector its size is not known. */
static void prepare(control *self) {
  bool up = self->found.picture.drive.data != NULL && self->found.picture_content == self->found.content_serial;
  if (!up && self->found.open) {
    control_want(self, SOLVER_PREPARE);
  }
}

static void begin(control *self) {
  prepare(self);
  control_measure(self, MEASURE_CALIBRATE);
}

static void load(control *self) {
  if (self->wishes.acquire) {
    control_event(self, EVENT_UNKNOWN);
  } else {
    control_want(self, SOLVER_LOAD);
  }
}

/* Less than the whole transport is measured only where there is one of this rig to begin with. */
static measure_kind scope(const control *self) {
  measure_kind wanted = self->wishes.scope;
  bool less = wanted == MEASURE_PHOTOMETRY || wanted == MEASURE_CHANGED;
  return wanted == MEASURE_GEOMETRY || (less && control_has_model(self)) ? wanted : MEASURE_ACQUIRE;
}

static void acquire(control *self) {
  self->wishes.acquire = true;
  self->wishes.owed = false;
  self->found.progress = (measure_progress){0};
  control_measure(self, scope(self));
}

static void adopt(control *self) {
  control_want(self, SOLVER_ADOPT);
}

static void cancel(control *self) {
  if (self->work.measuring) {
    control_measure(self, MEASURE_NOTHING);
  }
}

static void solve(control *self) {
  if (self->state == STATE_SOLVING) {
    cancel(self); /* a verification of the picture that is about to go */
  }
  if (self->found.open) {
    control_want(self, SOLVER_SOLVE);
  }
}

static void show(control *self) {
  output_drive *letter = clt_alloc(1, sizeof *letter);
  clt_error error = {0};
  if (letter == NULL || daemon_image_copy(&self->found.picture.drive, &letter->drive, &error) != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "the last picture stays up: out of memory");
    free(letter);
    return;
  }
  letter->panel = self->found.devices.panel;
  letter->serial = self->found.picture_content;
  clt_mailbox_put(self->boxes->drives, letter);
}

static void verify(control *self) {
  if (self->found.picture.compensated) {
    control_measure(self, MEASURE_VERIFY);
  } else {
    control_event(self, EVENT_VERIFIED);
  }
}

static void freeze(control *self) {
  cancel(self);
  sd_event_source_set_enabled(self->retry, SD_EVENT_OFF);
}

/* A picture for the content is put up meanwhile, and a stored transport serves without a camera too. */
static void back_off(control *self) {
  double wait_s = machine_back_off(self->attempt, self->config.retry_least_s, self->config.retry_most_s);
  cancel(self);
  prepare(self);
  if (self->found.open && self->found.model == NULL && self->config.reuse) {
    control_want(self, SOLVER_LOAD);
  }
  control_arm(self->retry, wait_s);
  clt_log(CLT_LOG_WARNING, "holding the last picture; next try in %g s", wait_s);
  self->attempt++;
}

static void stop(control *self) {
  notify_stopping();
  freeze(self);
  control_arm(self->grace, grace_s);
  control_measure(self, MEASURE_STOP);
  control_stop_moving(self);
  solver_job *job = clt_alloc(1, sizeof *job);
  if (job != NULL) {
    job->kind = SOLVER_STOP;
    clt_mailbox_put(self->boxes->solver_jobs, job);
    control_hasten(self);
  }
  order(self, OUTPUT_STOP);
}

static void nothing(control *self) {
  (void)self;
}

void control_act(control *self, machine_action action) {
  static void (*const acts[ACTION_COUNT])(control *) = {
      [ACTION_UNDEFINED] = nothing, [ACTION_IGNORE] = nothing,    [ACTION_REFUSE] = nothing,
      [ACTION_OPEN] = open_devices, [ACTION_BEGIN] = begin,       [ACTION_PREPARE] = prepare,
      [ACTION_LOAD] = load,         [ACTION_ACQUIRE] = acquire,   [ACTION_ADOPT] = adopt,
      [ACTION_SOLVE] = solve,       [ACTION_SHOW] = show,         [ACTION_VERIFY] = verify,
      [ACTION_NOTE] = nothing,      [ACTION_BACK_OFF] = back_off, [ACTION_FREEZE] = freeze,
      [ACTION_STOP] = stop,
  };
  acts[action](self);
}
