/* Work given to the other threads, and its answers. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/memory.h"
#include "daemon/control.h"
#include "daemon/geometry.h"
#include "daemon/store.h"

bool control_has_model(const control *self) {
  const control_findings *found = &self->found;
  if (found->model == NULL) {
    return false;
  }
  clt_transport_info info = clt_transport_describe(found->model->transport);
  return info.width == found->width && info.height == found->height && info.channels == found->channels &&
         info.rows == info.cols;
}

void control_measure(control *self, measure_kind kind) {
  measure_job *job = clt_alloc(1, sizeof *job);
  clt_error error = {0};
  if (job == NULL) {
    clt_log(CLT_LOG_ERROR, "a measurement cannot be started: out of memory");
    return;
  }
  job->kind = kind;
  job->number = ++self->work.number;
  job->config = self->config.station;
  job->station = self->found.devices.station;
  job->projector = self->found.devices.projector;
  bool pictured = kind == MEASURE_VERIFY || kind == MEASURE_REFINE;
  if (pictured && daemon_picture_copy(&self->found.picture, &job->picture, &error) != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "the picture cannot be verified: %s", error.message);
    job->kind = MEASURE_NOTHING;
  }
  bool renewed = kind == MEASURE_PHOTOMETRY || kind == MEASURE_CHANGED || kind == MEASURE_GEOMETRY;
  job->model = pictured || (renewed && control_has_model(self)) ? model_hold(self->found.model) : NULL;
  geometry_file(self->config.state, job->calibration);
  store_journal_path(self->config.state, job->journal);
  snprintf(job->settings, sizeof job->settings, "%s", self->config.path);
  job->anew = self->wishes.anew;
  self->work.measure_number = job->number;
  self->work.measuring = true;
  clt_mailbox_put(self->boxes->measure_jobs, job);
}

static void fill_solve(const control *self, solver_job *job) {
  const daemon_config *config = &self->config;
  bool calibrated = self->found.calibrated;
  const clt_projector_info *panel = &self->found.devices.projector;
  job->width = calibrated ? self->found.width : panel->width;
  job->height = calibrated ? self->found.height : panel->height;
  job->channels = calibrated ? self->found.channels : panel->channels;
  snprintf(job->source, sizeof job->source, "%s", self->found.source);
  snprintf(job->method, sizeof job->method, "%s", config->method);
  job->tolerance = config->solve.tolerance;
  job->deadline_s = config->solve.deadline_s;
  job->white = config->white;
  job->moves = control_moves(self);
}

static void fill_content(control *self, solver_job *job) {
  control_wishes *wishes = &self->wishes;
  job->descriptor = wishes->content_descriptor;
  wishes->content_descriptor = -1;
  snprintf(job->name, sizeof job->name, "%s", wishes->content_name);
  snprintf(job->configured, sizeof job->configured, "%s", self->config.content);
  self->work.content_ticket = wishes->content_ticket;
}

static clt_status fill_snapshot(control *self, solver_job *job, clt_error *error) {
  self->work.snapshot_ticket = self->wishes.snapshot_ticket;
  job->panel = self->found.devices.panel;
  clt_status status = daemon_picture_copy(&self->found.picture, &job->picture, error);
  return status == CLT_OK ? daemon_image_copy(&self->found.observation, &job->observation, error) : status;
}

static clt_status fill(control *self, solver_job *job, clt_error *error) {
  switch (job->kind) {
  case SOLVER_CONTENT:
    fill_content(self, job);
    return CLT_OK;
  case SOLVER_SNAPSHOT:
    return fill_snapshot(self, job, error);
  case SOLVER_LOAD:
    fill_solve(self, job);
    self->work.rigless = !self->found.calibrated;
    if (self->work.rigless) {
      job->width = job->height = job->channels = 0;
    }
    return CLT_OK;
  case SOLVER_ADOPT:
    job->transport = self->wishes.transport;
    self->wishes.transport = NULL;
    fill_solve(self, job);
    return CLT_OK;
  default:
    fill_solve(self, job);
    return CLT_OK;
  }
}

/* Gives the solver the first of what is wanted, where it has nothing to do. */
static void pump(control *self) {
  if (self->work.solving || self->wishes.solver == 0 || self->state == STATE_STOPPING) {
    return;
  }
  solver_job *job = clt_alloc(1, sizeof *job);
  clt_error error = {0};
  if (job == NULL) {
    return;
  }
  while ((self->wishes.solver >> job->kind & 1u) == 0) {
    job->kind++;
  }
  self->wishes.solver &= ~(1u << job->kind);
  job->descriptor = -1;
  job->number = ++self->work.number;
  if (fill(self, job, &error) != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "the picture cannot be worked on: %s", error.message);
    server_complete(self->service, WAITS_FOR_SNAPSHOT, self->work.snapshot_ticket, NULL, &error);
    solver_job_free(job);
    return;
  }
  self->work.solving = true;
  self->work.solver_kind = job->kind;
  free(clt_mailbox_take(self->boxes->haste, 0)); /* left from the job before */
  clt_mailbox_put(self->boxes->solver_jobs, job);
}

void control_hasten(control *self) {
  solver_haste *letter = clt_alloc(1, sizeof *letter);
  if (letter != NULL) {
    letter->number = self->work.number;
    clt_mailbox_put(self->boxes->haste, letter);
  }
}

bool control_measures_cost(const control *self) {
  bool runs = self->work.solving && self->work.solver_kind == SOLVER_COST;
  return runs || (self->wishes.solver >> SOLVER_COST & 1u) != 0;
}

void control_want(control *self, solver_kind kind) {
  self->wishes.solver |= 1u << kind;
  if (self->work.solving && self->work.solver_kind == SOLVER_COST && kind != SOLVER_COST) {
    control_hasten(self);
  }
  pump(self);
}

void control_on_opened(control *self, output_opened *letter) {
  notify_patience(&self->notify, self->state == STATE_STOPPING);
  if (letter->error.status == CLT_OK) {
    self->found.devices = *letter;
    self->found.open = true;
    control_play(self);
    control_event(self, EVENT_OPENED);
    return;
  }
  bool lost = letter->error.status == CLT_GONE && self->found.open;
  self->found.open = self->found.calibrated = false;
  control_blame(self, &letter->error);
  control_event(self, lost ? EVENT_LOST : EVENT_FAILED);
}

static void take_rig(control *self, const measure_result *letter) {
  control_findings *found = &self->found;
  memcpy(found->camera, letter->camera, sizeof found->camera);
  found->width = letter->rig.width;
  found->height = letter->rig.height;
  found->channels = letter->rig.channels;
  memcpy(found->response, letter->response, sizeof found->response);
  memcpy(found->source, letter->source, sizeof found->source);
  found->calibrated = true;
}

static void take_transport(control *self, measure_result *letter) {
  clt_transport_destroy(self->wishes.transport);
  self->wishes.transport = letter->transport;
  letter->transport = NULL;
  control_event(self, self->wishes.transport != NULL ? EVENT_ACQUIRED : EVENT_LOADED);
}

static void take_measured(control *self, measure_result *letter) {
  switch (letter->kind) {
  case MEASURE_CALIBRATE:
    take_rig(self, letter);
    control_event(self, EVENT_CALIBRATED);
    break;
  case MEASURE_PHOTOMETRY:
  case MEASURE_CHANGED:
  case MEASURE_GEOMETRY:
    control_on_renewal(self, letter);
    take_transport(self, letter);
    break;
  case MEASURE_ACQUIRE:
    take_transport(self, letter);
    break;
  case MEASURE_VERIFY:
    control_on_verification(self, letter);
    break;
  case MEASURE_REFINE:
    control_on_refinement(self, letter);
    break;
  default:
    break;
  }
}

/* Frames that were refused did no harm; many of them say that a cable or a driver is bad. */
static void take_camera_frames(control *self, const camera_frames *now) {
  camera_frames before = self->found.camera_frames;
  long repeated = now->repeated - before.repeated, strange = now->strange - before.strange,
       torn = now->torn - before.torn;
  self->found.camera_frames = *now;
  if (repeated + strange + torn > 0) {
    clt_log(CLT_LOG_NOTICE,
            "beside %ld frames of the camera others were refused: %ld repeated the one before, %ld were of another "
            "picture, %ld contradicted the others",
            now->used - before.used, repeated, strange, torn);
  }
}

void control_on_measured(control *self, measure_result *letter) {
  take_camera_frames(self, &letter->frames);
  if (letter->number != self->work.measure_number) {
    return;
  }
  self->work.measuring = false;
  if (letter->error.status == CLT_OK) {
    take_measured(self, letter);
  } else if (letter->error.status != CLT_CANCELLED) {
    if (letter->closed) {
      self->found.camera[0] = '\0';
    }
    control_blame(self, &letter->error);
    control_event(self, EVENT_FAILED);
  }
}

/* The picture that was computed becomes the one that ACTION_SHOW puts up. */
static void take_picture(control *self, solver_result *letter) {
  daemon_picture_finish(&self->found.picture);
  self->found.picture = letter->picture;
  letter->picture = (daemon_picture){0};
  self->found.picture_content = self->found.content_serial;
  self->found.verified_error = -1;
  self->found.refined = (refinement){0};
  self->found.trend = (trend){0};
  self->found.drifts = false;
  json_decref(self->found.tradeoff);
  self->found.tradeoff = NULL;
}

static void take_content(control *self, const solver_result *letter) {
  json_t *result = NULL;
  if (letter->error.status == CLT_OK) {
    snprintf(self->found.content, sizeof self->found.content, "%s", letter->content);
    self->found.content_serial++;
    control_event(self, EVENT_PICTURE);
    result = json_pack("{s:s, s:s}", "content", letter->content, "state", machine_state_name(self->state));
  } else {
    clt_log(CLT_LOG_WARNING, "the picture stays: %s", letter->error.message);
  }
  server_complete(self->service, WAITS_FOR_CONTENT, self->work.content_ticket, result, &letter->error);
  json_decref(result);
}

static void take_solved(control *self, solver_result *letter) {
  if (letter->error.status != CLT_OK) {
    control_blame(self, &letter->error);
    control_event(self, EVENT_UNSOLVED);
    return;
  }
  self->wishes.acquire = self->wishes.acquire && letter->kind != SOLVER_ADOPT;
  take_picture(self, letter);
  control_event(self, EVENT_SOLVED);
  if (self->wishes.owed) {
    control_event(self, EVENT_OWED);
  }
  if (self->found.picture.compensated) {
    control_want(self, SOLVER_COST);
  }
}

static void take_loaded(control *self, const solver_result *letter) {
  if (letter->error.status != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "the stored transport cannot be used: %s", letter->error.message);
  }
  if (!self->work.rigless) {
    control_event(self, letter->facts.present ? EVENT_LOADED : EVENT_UNKNOWN);
  } else if (letter->facts.present) {
    control_want(self, SOLVER_SOLVE); /* to be shown until the rig says whether it fits */
  }
}

static void take_prepared(control *self, solver_result *letter) {
  if (letter->error.status != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "the uncompensated picture cannot be shown: %s", letter->error.message);
    return;
  }
  take_picture(self, letter);
  control_act(self, ACTION_SHOW);
}

static void take_snapshot(control *self, const solver_result *letter) {
  json_t *result = NULL;
  if (letter->error.status == CLT_OK) {
    result = control_snapshot_note(self);
  }
  server_complete(self->service, WAITS_FOR_SNAPSHOT, self->work.snapshot_ticket, result, &letter->error);
  json_decref(result);
}

/* Given up for other work, it is owed still. */
static void take_cost(control *self, solver_result *letter) {
  if (letter->error.status == CLT_CANCELLED) {
    self->wishes.solver |= 1u << SOLVER_COST;
    return;
  }
  if (letter->error.status != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "what accuracy costs is not known: %s", letter->error.message);
  }
  json_decref(self->found.tradeoff);
  self->found.tradeoff = letter->tradeoff;
  letter->tradeoff = NULL;
  server_complete(self->service, WAITS_FOR_TRADEOFF, 0, self->found.tradeoff, &letter->error);
}

void control_on_solved(control *self, solver_result *letter) {
  self->work.solving = false;
  self->found.transport = letter->facts;
  model_drop(self->found.model);
  self->found.model = model_hold(letter->model);
  switch (letter->kind) {
  case SOLVER_CONTENT:
    take_content(self, letter);
    break;
  case SOLVER_PREPARE:
    take_prepared(self, letter);
    break;
  case SOLVER_LOAD:
    take_loaded(self, letter);
    break;
  case SOLVER_ADOPT:
  case SOLVER_SOLVE:
    take_solved(self, letter);
    break;
  case SOLVER_SNAPSHOT:
    take_snapshot(self, letter);
    break;
  case SOLVER_COST:
    take_cost(self, letter);
    break;
  default:
    break;
  }
  control_play(self);
  pump(self);
}

void control_finish_jobs(control *self) {
  clt_transport_destroy(self->wishes.transport);
  if (self->wishes.content_descriptor >= 0) {
    close(self->wishes.content_descriptor);
  }
  daemon_picture_finish(&self->found.picture);
  clt_image_finish(&self->found.observation);
  json_decref(self->found.tradeoff);
  model_drop(self->found.model);
}
