#include "daemon/solver.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/memory.h"
#include "base/places.h"
#include "daemon/rank.h"
#include "daemon/resume.h"
#include "tradeoff/json.h"

/* That a measurement of what accuracy costs may take, roughly. */
static const double COST_SECONDS = 1;

clt_status solver_init(const daemon_boxes *boxes, const store *state, const char *configured, solver *out,
                       clt_error *error) {
  *out = (solver){.boxes = boxes, .state = state};
  return content_open(state, configured, &out->shown, error);
}

void solver_finish(solver *self) {
  content_finish(&self->shown);
  model_drop(self->model);
  *self = (solver){0};
}

static void state_facts(const daemon_model *model, transport_facts *facts) {
  facts->present = model != NULL;
  if (model != NULL) {
    facts->info = clt_transport_describe(model->transport);
    facts->origin = *clt_transport_origin(model->transport);
  }
}

/* The content at another size. */
static clt_status fit(solver *self, int width, int height, int channels, clt_image *out, clt_error *error) {
  clt_image resized = {0};
  clt_status status = content_decode(&self->shown, error);
  status = status == CLT_OK ? clt_image_resize(&self->shown.picture, height, width, &resized, error) : status;
  status = status == CLT_OK ? clt_image_convert(&resized, channels, out, error) : status;
  clt_image_finish(&resized);
  return status;
}

/* x = picture, within what a projector can show. */
static clt_status leave_uncompensated(solver *self, const solver_job *job, daemon_picture *out, clt_error *error) {
  clt_status status = fit(self, job->width, job->height, job->channels, &out->drive, error);
  for (size_t i = 0; status == CLT_OK && i < clt_image_size(&out->drive); i++) {
    float light = out->drive.data[i];
    out->drive.data[i] = light < 0 ? 0 : light > 1 ? 1 : light;
  }
  return status;
}

/* The drive of the last run where it is for this content and fits the panel. */
static bool recall_drive(const solver *self, const solver_job *job, clt_image *drive) {
  if (self->shown.record.drive_of != self->shown.identity || !store_load_drive(self->state, drive)) {
    return false;
  }
  bool fits = job->width % drive->width == 0 && job->height % drive->height == 0 &&
              (drive->channels == job->channels || drive->channels == 1);
  if (!fits) {
    clt_image_finish(drive);
  }
  return fits;
}

static clt_status prepare(solver *self, solver_job *job, solver_result *result) {
  result->picture.recalled = recall_drive(self, job, &result->picture.drive);
  return result->picture.recalled ? CLT_OK : leave_uncompensated(self, job, &result->picture, &result->error);
}

/* The cells that take part, as a picture of ones and zeros. */
static clt_status mark_lit(const clt_certificate *certificate, const clt_image *like, clt_image *out,
                           clt_error *error) {
  clt_status status = clt_image_init(out, like->channels, like->height, like->width, error);
  size_t cells = (size_t)like->height * like->width;
  for (int c = 0; status == CLT_OK && c < like->channels; c++) {
    const unsigned char *lit = clt_certificate_lit(certificate, c);
    for (size_t i = 0; i < cells; i++) {
      out->data[c * cells + i] = lit[i] != 0 ? 1 : 0;
    }
  }
  return status;
}

static clt_status compensate(solver *self, const solver_job *job, const daemon_model *model, daemon_picture *out,
                             clt_error *error) {
  const clt_transport *transport = model->transport;
  const clt_certificate *certificate = model->certificate;
  clt_transport_info info = clt_transport_describe(transport);
  clt_image picture = {0};
  clt_solve_options options = {.method = job->method, .tolerance = job->tolerance, .deadline_s = job->deadline_s};
  clt_status status = fit(self, info.width, info.height, info.channels, &picture, error);
  status = status == CLT_OK ? clt_compensate(transport, certificate, &picture, &job->white, &options, false,
                                             &out->drive, &out->compensation, error)
                            : status;
  status = status == CLT_OK ? clt_target(transport, certificate, &picture, &job->white, &out->target, out->white, error)
                            : status;
  status = status == CLT_OK ? mark_lit(certificate, &out->drive, &out->lit, error) : status;
  out->compensated = status == CLT_OK;
  clt_image_finish(&picture);
  return status;
}

/* What cannot be stored is said, and does no harm before the next start. */
static void keep_drive(solver *self, const clt_image *drive) {
  clt_error error = {0};
  if (self->state->writable && content_keep_drive(self->state, &self->shown, drive, &error) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "the drive is not stored: %s", error.message);
  }
}

static clt_status solve(solver *self, solver_job *job, solver_result *result) {
  if (self->model == NULL) {
    return leave_uncompensated(self, job, &result->picture, &result->error);
  }
  clt_status status = compensate(self, job, self->model, &result->picture, &result->error);
  if (status == CLT_OK) {
    keep_drive(self, &result->picture.drive);
  }
  return status;
}

static void use_model(solver *self, daemon_model *model) {
  model_drop(self->model);
  self->model = model;
}

/* The transport in hand where it still fits the rig, else a stored one. */
static clt_status load(solver *self, solver_job *job, solver_result *result) {
  char why[CLT_MESSAGE_MAX];
  if (self->model != NULL &&
      !store_is_foreign(self->model->transport, job->width, job->height, job->channels, job->source, why, sizeof why)) {
    return CLT_OK;
  }
  use_model(self, NULL);
  clt_transport *stored = store_load_transport(self->state, job->width, job->height, job->channels, job->source);
  daemon_model *model = NULL;
  if (stored == NULL) {
    return CLT_OK;
  }
  clt_status status = model_create(stored, job->moves, &model, &result->error);
  if (status != CLT_OK) {
    clt_transport_destroy(stored);
    return status;
  }
  use_model(self, model);
  return CLT_OK;
}

/* The new transport takes the old one's place, in memory and on disk, only after it has served once. */
static clt_status adopt_measured(solver *self, solver_job *job, solver_result *result) {
  daemon_model *model = NULL;
  clt_error problem = {0};
  clt_status status = model_create(job->transport, job->moves, &model, &result->error);
  if (status != CLT_OK) {
    return status;
  }
  job->transport = NULL;
  status = compensate(self, job, model, &result->picture, &result->error);
  if (status != CLT_OK) {
    model_drop(model);
    return status;
  }
  use_model(self, model);
  if (store_save_transport(self->state, model->transport, &problem) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "the new transport is in use and will not survive a restart: %s", problem.message);
  }
  keep_drive(self, &result->picture.drive);
  return CLT_OK;
}

/* One that cannot serve would not by being taken from the journal either. */
static clt_status adopt(solver *self, solver_job *job, solver_result *result) {
  char journal[CLT_PATH_MAX];
  clt_status status = adopt_measured(self, job, result);
  store_journal_path(self->state->folder, journal);
  resume_drop(journal);
  return status;
}

static clt_status take_content(solver *self, solver_job *job, solver_result *result) {
  clt_status status = job->descriptor >= 0 ? content_take(self->state, job->configured, job->descriptor, job->name,
                                                          &self->shown, &result->error)
                                           : content_reset(self->state, job->configured, &self->shown, &result->error);
  snprintf(result->content, sizeof result->content, "%s", self->shown.name);
  return status;
}

/* Radiance as a picture: what white means becomes 1. */
static clt_status write_radiance(const solver *self, const clt_image *radiance, const double *white, const char *name,
                                 clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_image scaled = {0};
  clt_status status = store_path(self->state, name, path, error);
  status = status == CLT_OK ? daemon_image_copy(radiance, &scaled, error) : status;
  size_t cells = (size_t)scaled.height * scaled.width;
  for (size_t i = 0; i < clt_image_size(&scaled); i++) {
    scaled.data[i] = (float)(scaled.data[i] / (white[i / cells] > 0 ? white[i / cells] : 1));
  }
  status = status == CLT_OK ? clt_image_write(path, NULL, &scaled, error) : status;
  clt_image_finish(&scaled);
  return status;
}

static clt_status snapshot(solver *self, solver_job *job, solver_result *result) {
  char folder[CLT_PATH_MAX], path[CLT_PATH_MAX];
  clt_error *error = &result->error;
  const daemon_picture *picture = &job->picture;
  clt_status status = store_path(self->state, "snapshot", folder, error);
  status = status == CLT_OK ? clt_place_make_folder(folder, 0750, error) : status;
  status = status == CLT_OK ? store_path(self->state, "snapshot/drive.png", path, error) : status;
  status = status == CLT_OK ? clt_panel_write(path, &job->panel, &picture->drive, error) : status;
  if (status == CLT_OK && picture->target.data != NULL) {
    status = write_radiance(self, &picture->target, picture->white, "snapshot/target.png", error);
  }
  if (status == CLT_OK && job->observation.data != NULL) {
    status = write_radiance(self, &job->observation, picture->white, "snapshot/observation.png", error);
  }
  return status;
}

/* False, which ends the measurement, where control says that other work waits. */
static bool is_unhurried(void *context, const char *what, int done, int steps) {
  (void)what, (void)done, (void)steps;
  const solver *self = context;
  void *haste = clt_mailbox_take(self->boxes->haste, 0);
  free(haste);
  return haste == NULL;
}

static clt_status measure_cost(solver *self, solver_job *job, solver_result *result) {
  clt_error *error = &result->error;
  if (self->model == NULL) {
    return clt_fail(error, CLT_FAILED, "there is no transport to measure with");
  }
  clt_transport_info info = clt_transport_describe(self->model->transport);
  clt_tradeoff_options options = {
      .white = job->white, .seconds = COST_SECONDS, .brief = true, .progress = is_unhurried, .context = self};
  clt_image picture = {0};
  clt_tradeoff found = {0};
  clt_status status = fit(self, info.width, info.height, info.channels, &picture, error);
  status = status == CLT_OK ? clt_tradeoff_measure(self->model->transport, self->model->certificate, &picture, &options,
                                                   &found, error)
                            : status;
  result->tradeoff = status == CLT_OK ? clt_tradeoff_json(&found) : NULL;
  clt_tradeoff_finish(&found);
  clt_image_finish(&picture);
  return status;
}

static clt_status work(solver *self, solver_job *job, solver_result *result) {
  static clt_status (*const works[SOLVER_STOP])(solver *, solver_job *, solver_result *) = {
      [SOLVER_CONTENT] = take_content, [SOLVER_PREPARE] = prepare, [SOLVER_LOAD] = load,
      [SOLVER_ADOPT] = adopt,          [SOLVER_SOLVE] = solve,     [SOLVER_SNAPSHOT] = snapshot,
      [SOLVER_COST] = measure_cost,
  };
  return works[job->kind](self, job, result);
}

/* What has no time leaves a film's frames the processor on which they are computed; a transport, for which they wait,
 * does not. */
static void make_room(const solver_job *job, rank_work *threads, rank_place *place) {
  const bool awaited = job->kind == SOLVER_LOAD || job->kind == SOLVER_ADOPT;
  const bool beside = job->moves && !awaited;
  rank_keep(place, beside ? RANK_ASIDE : RANK_ALL);
  rank_begin(threads, beside ? 1 : 0, INFINITY);
}

static void answer(solver *self, solver_job *job) {
  solver_result *result = clt_alloc(1, sizeof *result);
  if (result == NULL) {
    clt_log(CLT_LOG_ERROR, "solving: out of memory");
    return;
  }
  result->kind = job->kind;
  result->number = job->number;
  result->error.status = work(self, job, result);
  state_facts(self->model, &result->facts);
  result->model = model_hold(self->model);
  daemon_report(self->boxes, self->boxes->solved, result);
}

void *solver_run(void *data) {
  solver *self = data;
  rank_work threads = rank_open();
  rank_place place = rank_stand();
  bool stopping = false;
  rank_behind(3 * RANK_AHEAD);
  rank_take_turns(RANK_LONG);
  while (!stopping) {
    solver_job *job = clt_mailbox_take(self->boxes->solver_jobs, -1);
    stopping = job == NULL || job->kind == SOLVER_STOP;
    if (!stopping) {
      make_room(job, &threads, &place);
      answer(self, job);
    }
    solver_job_free(job);
  }
  return NULL;
}
