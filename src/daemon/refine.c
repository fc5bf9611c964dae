#include "daemon/refine.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "daemon/measure.h"

/* A step counts where the error falls by this share at least; so many in a row that do not end it. */
static const double WORTH = 0.01;
enum { IDLE_STEPS_MOST = 3 };

typedef struct refiner {
  clt_rig *rig;
  const daemon_model *model;
  daemon_picture *picture;         /* its drive: the best so far */
  clt_image *seen, *deviation;     /* of the best */
  clt_image trial, glance, spread; /* the next drive and its photograph */
  double *wanted, *light, *drive;  /* values each; wanted is the allocation of all three */
  double gain;                     /* 0: half of the limit */
} refiner;

static void swap(clt_image *a, clt_image *b) {
  clt_image kept = *a;
  *a = *b;
  *b = kept;
}

static clt_status make_like(const clt_image *like, clt_image *out, clt_error *error) {
  return clt_image_init(out, like->channels, like->height, like->width, error);
}

static clt_status prepare(refiner *self, clt_error *error) {
  const clt_image *drive = &self->picture->drive;
  size_t values = clt_image_size(drive), cells = (size_t)drive->height * drive->width;
  clt_transport_info info = clt_transport_describe(self->model->transport);
  if (info.width != drive->width || info.height != drive->height || info.channels != drive->channels) {
    return clt_fail(error, CLT_BAD_INPUT, "the picture is not on the grid of the transport in use");
  }
  clt_status status = make_like(drive, &self->trial, error);
  status = status == CLT_OK ? make_like(drive, &self->glance, error) : status;
  status = status == CLT_OK ? make_like(drive, &self->spread, error) : status;
  self->wanted = clt_alloc(3 * values, sizeof(double));
  if (status == CLT_OK && self->wanted == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory to refine a picture of %zu values", values);
  }
  if (status != CLT_OK) {
    return status;
  }
  self->light = self->wanted + values;
  self->drive = self->light + values;
  for (size_t i = 0; i < values; i++) {
    int c = (int)(i / cells);
    self->wanted[i] =
        (double)self->picture->target.data[i] - (double)clt_transport_black(self->model->transport, c)[i % cells];
  }
  return CLT_OK;
}

static void finish(refiner *self) {
  clt_image_finish(&self->trial);
  clt_image_finish(&self->glance);
  clt_image_finish(&self->spread);
  free(self->wanted);
}

/* The trial: one step from the best drive by its photograph. */
static clt_status take_step(refiner *self, clt_error *error) {
  const clt_image *best = &self->picture->drive;
  size_t values = clt_image_size(best), cells = (size_t)best->height * best->width;
  clt_loop *loop = NULL;
  clt_loop_options options = {.gain = self->gain};
  clt_status status = clt_loop_create(self->model->transport, self->model->certificate, &options, &loop, error);
  if (status != CLT_OK) {
    return status;
  }
  self->gain = clt_loop_describe(loop).gain;
  for (size_t i = 0; i < values; i++) {
    int c = (int)(i / cells);
    double black = clt_transport_black(self->model->transport, c)[i % cells];
    self->drive[i] = best->data[i];
    self->light[i] = isfinite(self->deviation->data[i]) ? self->seen->data[i] - black : (double)NAN;
  }
  status = clt_loop_step(loop, self->wanted, self->light, self->drive, error);
  for (size_t i = 0; i < values; i++) {
    self->trial.data[i] = (float)self->drive[i];
  }
  clt_loop_destroy(loop);
  return status;
}

/* The deviations of the best photograph, relative to the target as its error is. */
static double noise_of(const refiner *self) {
  const daemon_picture *picture = self->picture;
  double noise = 0, wanted = 0;
  for (size_t i = 0; i < clt_image_size(&picture->target); i++) {
    double spread = self->deviation->data[i], target = picture->target.data[i];
    bool counts = picture->lit.data[i] != 0 && isfinite(spread);
    noise += counts ? spread * spread : 0;
    wanted += counts ? target * target : 0;
  }
  return wanted > 0 ? sqrt(noise / wanted) : 0;
}

/* Photographs the trial and keeps it where it is better; else the next step is half as long. */
static clt_status try_drive(refiner *self, refinement *out, int *idle, clt_error *error) {
  clt_status status = self->rig->operations->observe(self->rig, &self->trial, &self->glance, &self->spread, error);
  if (status != CLT_OK) {
    return status;
  }
  double found = measure_error(&self->glance, &self->spread, &self->picture->target, &self->picture->lit);
  out->photographs++;
  *idle = found < (1 - WORTH) * out->after ? 0 : *idle + 1;
  if (found < out->after) {
    out->after = found;
    swap(&self->picture->drive, &self->trial);
    swap(self->seen, &self->glance);
    swap(self->deviation, &self->spread);
  } else {
    self->gain /= 2;
  }
  return CLT_OK;
}

static clt_status run(refiner *self, bool (*go_on)(void *context), void *context, refinement *out, clt_error *error) {
  daemon_picture *picture = self->picture;
  clt_status status = self->rig->operations->observe(self->rig, &picture->drive, self->seen, self->deviation, error);
  out->photographs = 1;
  if (status == CLT_OK) {
    out->before = out->after = measure_error(self->seen, self->deviation, &picture->target, &picture->lit);
    out->noise = noise_of(self);
  }
  int idle = 0;
  while (status == CLT_OK && out->after > out->noise && idle < IDLE_STEPS_MOST &&
         out->photographs < REFINE_STEPS_MOST) {
    status = go_on(context) ? take_step(self, error) : clt_fail(error, CLT_CANCELLED, "refining was given up");
    status = status == CLT_OK ? try_drive(self, out, &idle, error) : status;
  }
  return status;
}

clt_status refine_picture(clt_rig *rig, const daemon_model *model, daemon_picture *picture, clt_image *seen,
                          clt_image *deviation, bool (*go_on)(void *context), void *context, refinement *out,
                          clt_error *error) {
  refiner self = {.rig = rig, .model = model, .picture = picture, .seen = seen, .deviation = deviation};
  *out = (refinement){0};
  clt_status status = prepare(&self, error);
  status = status == CLT_OK ? run(&self, go_on, context, out, error) : status;
  finish(&self);
  return status;
}
