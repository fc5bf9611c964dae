#include "daemon/measure.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/memory.h"
#include "daemon/geometry.h"
#include "daemon/refine.h"
#include "daemon/renew.h"
#include "daemon/resume.h"
#include "daemon/standin.h"

/* The least time between two progress letters, s. */
static const double progress_s = 0.05;

typedef struct measurer {
  const daemon_boxes *boxes;
  clt_station *station;     /* lent by main from calibration on */
  clt_projector *standin;   /* outlives the station's rig */
  clt_projector_info panel; /* that the rig was made for */
  clt_panel light;          /* of its codes, as the rig knows it */
  measure_job *waiting;     /* came while another was worked on */
  uint64_t number;          /* of the job in work */
  camera_frames closed;     /* by rigs that are closed */
  bool first;               /* no acquisition has begun yet */
  int64_t reported_ns;
} measurer;

static bool cancelled(measurer *self) {
  measure_job *newer = clt_mailbox_take(self->boxes->measure_jobs, 0);
  if (newer != NULL) {
    measure_job_free(self->waiting);
    self->waiting = newer;
  }
  return self->waiting != NULL;
}

static bool on_progress(void *context, const clt_progress *progress) {
  measurer *self = context;
  bool due = self->reported_ns == 0 || clt_clock_since(self->reported_ns) >= progress_s;
  measure_progress *letter = due ? clt_alloc(1, sizeof *letter) : NULL;
  if (letter != NULL) {
    *letter = (measure_progress){.number = self->number,
                                 .done = progress->done,
                                 .total = progress->total,
                                 .resumed = progress->resumed,
                                 .seconds = progress->seconds,
                                 .left = progress->left};
    snprintf(letter->phase, sizeof letter->phase, "%s", progress->phase);
    self->reported_ns = clt_clock_ns();
    daemon_report(self->boxes, self->boxes->progress, letter);
  }
  return !cancelled(self);
}

static camera_frames count_frames(const measurer *self) {
  camera_frames sum = self->closed;
  if (self->station != NULL && self->station->rig != NULL) {
    clt_rig_info info;
    self->station->rig->operations->describe(self->station->rig, &info);
    sum.used += info.frames;
    sum.repeated += info.repeated;
    sum.strange += info.strange;
    sum.torn += info.torn;
  }
  return sum;
}

static void close_camera(measurer *self) {
  self->closed = count_frames(self);
  if (self->station != NULL) {
    clt_station_close_camera(self->station);
  }
  if (self->standin != NULL) {
    self->standin->driver->close(self->standin);
  }
  self->standin = NULL;
}

static bool is_same_panel(const clt_projector_info *a, const clt_projector_info *b) {
  return a->width == b->width && a->height == b->height && a->channels == b->channels;
}

/* Camera and rig on main's station; what is open already stays, unless the projector came back with another panel. */
static clt_status open_camera(measurer *self, const measure_job *job, clt_error *error) {
  clt_station *station = self->station = job->station;
  if (station->rig != NULL && !is_same_panel(&self->panel, &job->projector)) {
    close_camera(self);
  }
  clt_status status = clt_station_open_camera(&job->config, station, error);
  if (status != CLT_OK || station->rig != NULL) {
    return status;
  }
  if (self->standin != NULL) {
    self->standin->driver->close(self->standin);
    self->standin = NULL;
  }
  self->panel = job->projector;
  self->light = clt_station_rig_config(&job->config, station).projector;
  status = standin_create(self->boxes, &self->panel, &self->standin, error);
  return status == CLT_OK ? clt_station_open_rig(&job->config, station, self->standin, error) : status;
}

static clt_status calibrate(measurer *self, const measure_job *job, measure_result *result) {
  clt_status status = open_camera(self, job, &result->error);
  if (status != CLT_OK) {
    return status;
  }
  const clt_station *station = self->station;
  snprintf(result->camera, sizeof result->camera, "%s", station->camera->driver->name);
  station->rig->operations->describe(station->rig, &result->rig);
  snprintf(result->response, sizeof result->response, "%s", result->rig.response);
  snprintf(result->source, sizeof result->source, "%s", result->rig.source);
  result->rig.response = result->response;
  result->rig.source = result->source;
  return CLT_OK;
}

static clt_status acquire(measurer *self, const measure_job *job, measure_result *result) {
  clt_acquire_options options = job->config.acquire;
  options.scheme = job->config.scheme[0] != '\0' ? job->config.scheme : NULL;
  options.reopens = true; /* as the state machine does, which says so meanwhile */
  char belongs[1024];
  resume_describe(job, self->station, belongs, sizeof belongs);
  options.journal = job->journal[0] != '\0' ? job->journal : NULL;
  options.journal_of = belongs;
  options.journal_age_s = RESUME_AGE_S;
  options.journal_dispensable = true;
  options.progress = on_progress;
  options.context = self;
  self->reported_ns = 0;
  clt_status status = clt_acquire(self->station->rig, &options, &result->transport, &result->error);
  resume_settle(job, status);
  return status;
}

static clt_status measure_all(measurer *self, const measure_job *job, measure_result *result) {
  clt_status status = acquire(self, job, result);
  result->renewed.outcome = RENEW_MEASURE;
  result->renewed.patterns += status == CLT_OK ? clt_transport_origin(result->transport)->patterns : 0;
  return status;
}

/* Black and flood are photographed so often where the configuration leaves it open. */
enum { RENEW_REPEATS = 4 };

static clt_status renew(measurer *self, const measure_job *job, measure_result *result) {
  int repeats = job->config.acquire.repeats;
  renew_options options = {.changed = job->kind != MEASURE_PHOTOMETRY,
                           .repeats = repeats > 0 ? repeats : RENEW_REPEATS,
                           .progress = on_progress,
                           .context = self};
  self->reported_ns = 0;
  clt_status status =
      renew_transport(self->station->rig, job->model, &options, &result->transport, &result->renewed, &result->error);
  return status == CLT_OK && result->renewed.outcome == RENEW_MEASURE ? measure_all(self, job, result) : status;
}

/* With the new map T may fit again; what else changed is looked for as for MEASURE_CHANGED. */
static clt_status renew_geometry(measurer *self, const measure_job *job, measure_result *result) {
  geometry_renewal found;
  const camera_frames before = count_frames(self);
  self->reported_ns = 0;
  clt_status status = geometry_renew(job, self->station, self->standin, on_progress, self, &found, &result->error);
  if (status == CLT_OK && job->model == NULL) {
    status = measure_all(self, job, result);
  } else if (status == CLT_OK && found.adopted) {
    status = renew(self, job, result);
  }
  self->closed = found.adopted ? before : self->closed; /* with the map came a new rig */
  result->renewed.geometry = found;
  return status;
}

double measure_error(const clt_image *seen, const clt_image *deviation, const clt_image *target, const clt_image *lit) {
  double difference = 0, wanted = 0;
  for (size_t i = 0; i < clt_image_size(target); i++) {
    if (lit->data[i] != 0 && isfinite(deviation->data[i])) {
      double off = (double)seen->data[i] - target->data[i];
      difference += off * off;
      wanted += (double)target->data[i] * target->data[i];
    }
  }
  return wanted > 0 ? sqrt(difference / wanted) : 0;
}

/* <seen - b0, T x> / ||T x||^2 over lit cells that were seen; 1 where nothing was predicted. */
static double find_brightness(const daemon_model *model, const clt_image *predicted, const clt_image *seen,
                              const clt_image *deviation) {
  size_t cells = (size_t)seen->height * seen->width;
  double together = 0, size = 0;
  for (size_t i = 0; i < clt_image_size(seen); i++) {
    int c = (int)(i / cells);
    double black = clt_transport_black(model->transport, c)[i % cells], light = predicted->data[i] - black;
    if (clt_certificate_lit(model->certificate, c)[i % cells] && isfinite(deviation->data[i])) {
      together += (seen->data[i] - black) * light;
      size += light * light;
    }
  }
  return size > 0 ? together / size : 1;
}

/* A picture in which no lit cell was seen tells nothing of T: it is verified without. */
static void check_fit(const measurer *self, const measure_job *job, const clt_image *deviation,
                      measure_result *result) {
  const daemon_model *model = job->model;
  clt_error problem = {0};
  clt_image shown = {0}, predicted = {0};
  if (model == NULL) {
    return;
  }
  result->checked = clt_panel_shown(&self->light, self->panel.bits, &job->picture.drive, &shown, &problem) == CLT_OK &&
                    clt_predict(model->transport, &shown, &predicted, &problem) == CLT_OK &&
                    clt_loop_check(model->transport, model->certificate, &shown, &result->observation, deviation,
                                   &result->fit, &problem) == CLT_OK;
  if (result->checked) {
    result->brightness = find_brightness(model, &predicted, &result->observation, deviation);
  } else {
    clt_log(CLT_LOG_INFO, "whether T still fits is not known: %s", problem.message);
  }
  clt_image_finish(&shown);
  clt_image_finish(&predicted);
}

static clt_status verify(measurer *self, const measure_job *job, measure_result *result) {
  const clt_image *drive = &job->picture.drive;
  clt_image deviation = {0};
  clt_rig *rig = self->station->rig;
  clt_status status =
      clt_image_init(&result->observation, drive->channels, drive->height, drive->width, &result->error);
  status = status == CLT_OK ? clt_image_init(&deviation, drive->channels, drive->height, drive->width, &result->error)
                            : status;
  status = status == CLT_OK ? rig->operations->observe(rig, drive, &result->observation, &deviation, &result->error)
                            : status;
  if (status == CLT_OK) {
    result->verified_error = measure_error(&result->observation, &deviation, &job->picture.target, &job->picture.lit);
    check_fit(self, job, &deviation, result);
  }
  clt_image_finish(&deviation);
  return status;
}

static bool observes(measure_kind kind) {
  return kind != MEASURE_NOTHING && kind != MEASURE_CALIBRATE && kind != MEASURE_STOP;
}

static bool may_go_on(void *context) {
  return !cancelled(context);
}

static clt_status refine(measurer *self, measure_job *job, measure_result *result) {
  const clt_image *drive = &job->picture.drive;
  clt_image deviation = {0};
  clt_error *error = &result->error;
  if (job->model == NULL) {
    return clt_fail(error, CLT_FAILED, "there is no transport to refine by");
  }
  clt_status status = clt_image_init(&result->observation, drive->channels, drive->height, drive->width, error);
  status = status == CLT_OK ? clt_image_init(&deviation, drive->channels, drive->height, drive->width, error) : status;
  status = status == CLT_OK ? refine_picture(self->station->rig, job->model, &job->picture, &result->observation,
                                             &deviation, may_go_on, self, &result->refined, error)
                            : status;
  if (status == CLT_OK) {
    result->verified_error = result->refined.after;
    result->drive = job->picture.drive;
    job->picture.drive = (clt_image){0};
  }
  clt_image_finish(&deviation);
  return status;
}

static clt_status work(measurer *self, measure_job *job, measure_result *result) {
  if (observes(job->kind) && (self->station == NULL || self->station->rig == NULL)) {
    return clt_fail(&result->error, CLT_GONE, "the rig is not open");
  }
  resume_begin(job, &self->first);
  switch (job->kind) {
  case MEASURE_CALIBRATE:
    return calibrate(self, job, result);
  case MEASURE_ACQUIRE:
    return acquire(self, job, result);
  case MEASURE_PHOTOMETRY:
  case MEASURE_CHANGED:
    return renew(self, job, result);
  case MEASURE_GEOMETRY:
    return renew_geometry(self, job, result);
  case MEASURE_VERIFY:
    return verify(self, job, result);
  case MEASURE_REFINE:
    return refine(self, job, result);
  default:
    return CLT_OK;
  }
}

/* A camera that is gone, or gives no frames, is closed: `calibrate` opens it again. */
static void give_up_camera(measurer *self, measure_result *result) {
  result->closed = result->error.status == CLT_GONE || result->error.status == CLT_TIMEOUT;
  if (result->closed) {
    close_camera(self);
  }
}

static void answer(measurer *self, measure_job *job) {
  measure_result *result = clt_alloc(1, sizeof *result);
  if (result == NULL) {
    clt_log(CLT_LOG_ERROR, "measuring: out of memory");
    return;
  }
  result->kind = job->kind;
  result->number = self->number = job->number;
  result->error.status = work(self, job, result);
  result->frames = count_frames(self);
  if (observes(job->kind)) {
    standin_release(self->boxes);
  }
  give_up_camera(self, result);
  daemon_report(self->boxes, self->boxes->measured, result);
}

void *measure_run(void *boxes) {
  measurer self = {.boxes = boxes, .first = true};
  bool stopping = false;
  while (!stopping) {
    measure_job *job = self.waiting != NULL ? self.waiting : clt_mailbox_take(self.boxes->measure_jobs, -1);
    self.waiting = NULL;
    stopping = job == NULL || job->kind == MEASURE_STOP;
    if (!stopping) {
      answer(&self, job);
    }
    measure_job_free(job);
  }
  close_camera(&self);
  return NULL;
}
