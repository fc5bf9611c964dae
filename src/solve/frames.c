#include "counterlight/frames.h"

#include <math.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"
#include "image/cell_means.h"
#include "solve/live.h"
#include "solve/mapping.h"

enum { COLOURS = 3 };

static const float GAIN_MOST = 4;
static const double SMOOTH_S = 0.5;
/* A cut changes the picture by more than this part of its light. */
static const double CUT = 0.3;

struct clt_frames {
  const clt_transport *transport;
  const clt_certificate *certificate;
  clt_transport_info info;
  clt_live *live;
  clt_mapping *mapping; /* NULL: scale 1, offset 0 */
  double white[CLT_CHANNELS_MAX];
  size_t values;           /* channels * cells */
  float *direct;           /* 1 / F, 0 at dark cells */
  float *means;            /* of the content: three colours, where the transport has one channel */
  float *picture, *before; /* the channels of this frame and of the one before */
  float *target, *drive;
  float *then_target, *then_drive; /* of the last frame that was solved for */
  const float *shown;              /* the drive of the last frame: one of the two */
};

static clt_status find_white(clt_frames *self, const clt_white *white, clt_error *error) {
  if (white->kind == CLT_WHITE_VALUE && !(white->value > 0 && isfinite(white->value))) {
    return clt_fail(error, CLT_BAD_INPUT, "white is %g; it must be a radiance above 0", white->value);
  }
  for (int c = 0; c < self->info.channels; c++) {
    self->white[c] =
        white->kind == CLT_WHITE_VALUE ? white->value : clt_certificate_channel(self->certificate, c)->white;
  }
  return CLT_OK;
}

static void find_direct(clt_frames *self) {
  size_t cells = self->info.cols;
  for (int c = 0; c < self->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(self->certificate, c);
    const double *f = clt_certificate_first_bounce(self->certificate, c);
    for (size_t i = 0; i < cells; i++) {
      self->direct[(size_t)c * cells + i] = lit[i] ? (float)(1 / f[i]) : 0;
    }
  }
}

static clt_status prepare(clt_frames *self, const clt_frames_options *options, clt_error *error) {
  size_t cells = self->info.cols, values = (size_t)self->info.channels * cells;
  float *work = clt_alloc_large(COLOURS * cells + 7 * values, sizeof *work);
  if (work == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for moving pictures of %zu cells", cells);
  }
  self->values = values;
  self->means = work;
  self->direct = work + COLOURS * cells;
  self->picture = self->direct + values;
  self->before = self->picture + values;
  self->target = self->before + values;
  self->drive = self->target + values;
  self->then_target = self->drive + values;
  self->then_drive = self->then_target + values;
  self->shown = self->drive;
  find_direct(self);
  clt_status status = find_white(self, &options->white, error);
  if (status == CLT_OK) {
    status = clt_live_create(self->transport, self->certificate, &options->live, &self->live, error);
  }
  if (status == CLT_OK && (options->reach || options->white.kind == CLT_WHITE_FEASIBLE)) {
    double smooth_s = options->smooth_s > 0 ? options->smooth_s : SMOOTH_S;
    status = clt_mapping_create(self->live->transport, self->certificate, self->white, smooth_s, &self->mapping, error);
  }
  return status;
}

clt_status clt_frames_create(const clt_transport *transport, const clt_certificate *certificate,
                             const clt_frames_options *options, clt_frames **out, clt_error *error) {
  clt_frames *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "moving pictures: out of memory");
  }
  *self = (clt_frames){.transport = transport, .certificate = certificate, .info = clt_transport_describe(transport)};
  clt_status status = self->info.channels == 1 || self->info.channels == COLOURS
                          ? prepare(self, options, error)
                          : clt_fail(error, CLT_BAD_INPUT, "moving pictures need 1 or 3 channels, the transport has %d",
                                     self->info.channels);
  if (status != CLT_OK) {
    clt_frames_destroy(self);
    return status;
  }
  *out = self;
  return CLT_OK;
}

void clt_frames_destroy(clt_frames *self) {
  if (self != NULL) {
    clt_live_destroy(self->live);
    clt_mapping_destroy(self->mapping);
    free(self->means);
    free(self);
  }
}

/* The picture's channels; a transport of one takes the luminance (Rec. 709). The one before is kept. */
static clt_status take_picture(clt_frames *self, const uint8_t *content, int width, int height, clt_error *error) {
  const size_t cells = self->info.cols;
  const bool colours = self->info.channels == COLOURS;
  const float *red = self->means, *green = red + cells, *blue = green + cells;
  float *picture = self->before;
  clt_status status = clt_cell_means(content, width, height, self->info.width, self->info.height,
                                     colours ? picture : self->means, error);
  if (status != CLT_OK) {
    return status;
  }
  self->before = self->picture;
  self->picture = picture;
  for (size_t i = 0; !colours && i < cells; i++) {
    picture[i] = 0.2126F * red[i] + 0.7152F * green[i] + 0.0722F * blue[i];
  }
  return CLT_OK;
}

/* This pass and those below are done sooner than a thread comes that others keep from its processor. */
static bool is_cut(const clt_frames *self) {
  const float *picture = self->picture, *before = self->before;
  double change = 0, light = 0;
#pragma omp simd reduction(+ : change, light)
  for (size_t i = 0; i < self->values; i++) {
    const double now = (double)picture[i], then = (double)before[i];
    change += fabs(now - then);
    light += now > then ? now : then;
  }
  return change > CUT * light;
}

/* target = white (scale picture + offset). False while scale and offset are on their way. */
static bool map(clt_frames *self, double seconds, clt_frames_result *result) {
  const size_t cells = self->info.cols;
  bool moves = false;
  result->cut = is_cut(self);
  result->scale = 1;
  if (self->mapping != NULL) {
    moves = clt_mapping_follow(self->mapping, self->picture, seconds, result->cut);
    result->scale = clt_mapping_scale(self->mapping);
    result->offset = clt_mapping_offset(self->mapping);
  }
  for (int c = 0; c < self->info.channels; c++) {
    const float factor = (float)(self->white[c] * result->scale), more = (float)(self->white[c] * result->offset);
    const float *picture = self->picture + (size_t)c * cells;
    float *target = self->target + (size_t)c * cells;
#pragma omp simd
    for (size_t i = 0; i < cells; i++) {
      target[i] = factor * picture[i] + more;
    }
  }
  return !moves;
}

/* Without a step the solver gives the drive of an older frame. From nothing this is the uncompensated picture. */
static void follow_directly(clt_frames *self) {
  const float *target = self->target, *then_target = self->then_target, *then_drive = self->then_drive;
  float *drive = self->drive;
#pragma omp simd
  for (size_t i = 0; i < self->values; i++) {
    float x = then_drive[i] + (target[i] - then_target[i]) * self->direct[i];
    x = x > 0 ? x : 0;
    drive[i] = x < 1 ? x : 1;
  }
}

static void swap(float **a, float **b) {
  float *other = *a;
  *a = *b;
  *b = other;
}

/* The drive of this frame: solved for, or as near as no time allows. */
static clt_status solve(clt_frames *self, clt_frames_result *result, clt_error *error) {
  clt_status status = clt_live_solve(self->live, self->target, self->drive, &result->live, error);
  if (status != CLT_OK) {
    return status;
  }
  result->direct = !result->live.converged && result->live.steps == 0;
  if (result->direct) {
    follow_directly(self);
    self->shown = self->drive;
  } else {
    swap(&self->target, &self->then_target);
    swap(&self->drive, &self->then_drive);
    self->shown = self->then_drive;
  }
  return CLT_OK;
}

static void fill_fields(const clt_frames *self, double scale, float *gain, float *offset) {
  const size_t cells = self->info.cols;
  for (int k = 0; k < COLOURS; k++) {
    const int c = k < self->info.channels ? k : 0;
    const float factor = (float)(scale * self->white[c]);
    const size_t from = (size_t)c * cells, to = (size_t)k * cells;
    const float *direct = self->direct + from, *picture = self->picture + from, *drive = self->shown + from;
#pragma omp simd
    for (size_t i = 0; i < cells; i++) {
      const float whole = factor * direct[i], own = whole < GAIN_MOST ? whole : GAIN_MOST;
      gain[to + i] = own;
      offset[to + i] = direct[i] > 0 ? drive[i] - own * picture[i] : 0;
    }
  }
}

/* Milliseconds since *start_ns, which becomes now. */
static double lap(int64_t *start_ns) {
  int64_t now_ns = clt_clock_ns();
  double ms = 1e-6 * (double)(now_ns - *start_ns);
  *start_ns = now_ns;
  return ms;
}

clt_status clt_frames_next(clt_frames *self, const uint8_t *content, int width, int height, double seconds, float *gain,
                           float *offset, clt_frames_result *result, clt_error *error) {
  int64_t start_ns = clt_clock_ns();
  *result = (clt_frames_result){0};
  clt_status status = take_picture(self, content, width, height, error);
  if (status != CLT_OK) {
    return status;
  }
  result->ms[CLT_FRAMES_MEAN] = lap(&start_ns);
  bool still = map(self, seconds, result);
  result->ms[CLT_FRAMES_MAP] = lap(&start_ns);
  status = solve(self, result, error);
  result->ms[CLT_FRAMES_SOLVE] = lap(&start_ns);
  if (status == CLT_OK) {
    fill_fields(self, result->scale, gain, offset);
    result->settled = still && result->live.converged;
  }
  result->ms[CLT_FRAMES_FIELDS] = lap(&start_ns);
  return status;
}

const float *clt_frames_drive(const clt_frames *self) {
  return self->shown;
}

void clt_frames_set_budget(clt_frames *self, double budget_ms) {
  clt_live_set_budget(self->live, budget_ms);
}
