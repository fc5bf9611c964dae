/* The least offset and the largest scale, in one pass over the cells (docs/solving.md, Moving pictures).
 *
 * With p = T^-1 (white picture), w = T^-1 white and b = T^-1 b0, the target white s (picture + c) takes the drive
 *   x = s (p + c w) - b                     (w > 0: a room lit evenly takes light everywhere)
 * so 0 <= x <= 1 holds with
 *   c = max over cells of (b / s - p) / w, at least 0,       s = min over cells of (1 + b) / (p + c w), at most 1.
 * p follows the picture by one damped step of the report's iteration (eq. 43) a frame and channel:
 *   p += omega F^-1 (white picture - T p),  omega = 1 - m^2,  m = rho / (1 + rho). */
#include "solve/mapping.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "solve/method.h"

/* Nearer than this to where they belong, scale and offset stay. */
static const double NEAR = 1e-4;
/* Time after a cut for which they follow faster, and how much, s. */
static const double CUT_S = 0.25, CUT_FASTER = 8;

struct clt_mapping {
  const clt_transport *transport;
  const clt_certificate *certificate;
  clt_transport_info info;
  double white[CLT_CHANNELS_MAX];
  double smooth_s, fast_s;   /* fast_s: left of the time after a cut */
  double *p, *w, *b;         /* channels * cells each */
  double *way, *lift, *room; /* as many: omega / F, 1 / w (w > 0) and 1 / (1 + b), each 0 at dark cells */
  double *product;           /* cells */
  double offset_of[CLT_CHANNELS_MAX], scale_of[CLT_CHANNELS_MAX]; /* that a channel needs */
  double moved_of[CLT_CHANNELS_MAX]; /* the largest change of its p in its last step, of drive */
  int turn;                          /* the channel whose p is next */
  double scale, offset;
};

static clt_status solve_unbounded(clt_mapping *self, const double *wanted, double *x, clt_error *error) {
  static const double PRECISE = 1e-6;
  double worst = 0;
  for (int c = 0; c < self->info.channels; c++) {
    worst = fmax(worst, clt_certificate_channel(self->certificate, c)->reciprocity);
  }
  clt_solve_options options = {.method = clt_method_linear(worst)->name, .tolerance = PRECISE};
  clt_solve_result result;
  return clt_solve(self->transport, self->certificate, wanted, &options, x, &result, error);
}

/* What a frame would divide by. */
static void find_factors(clt_mapping *self) {
  size_t cells = self->info.cols;
  for (int c = 0; c < self->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(self->certificate, c);
    const double *f = clt_certificate_first_bounce(self->certificate, c);
    double rho = clt_certificate_channel(self->certificate, c)->radius_high, m = rho / (1 + rho);
    for (size_t i = 0, at = (size_t)c * cells; i < cells; i++, at++) {
      self->way[at] = lit[i] ? (1 - m * m) / f[i] : 0;
      self->lift[at] = lit[i] && self->w[at] > 0 ? 1 / self->w[at] : 0;
      self->room[at] = lit[i] && self->b[at] > -1 ? 1 / (1 + self->b[at]) : 0;
    }
  }
}

static clt_status prepare(clt_mapping *self, clt_error *error) {
  size_t cells = self->info.cols, values = (size_t)self->info.channels * cells;
  double *wanted = clt_alloc(values, sizeof *wanted);
  if (wanted == NULL) {
    return clt_fail(error, CLT_FAILED, "a target mapping: out of memory");
  }
  for (size_t i = 0; i < values; i++) {
    wanted[i] = self->white[i / cells];
  }
  clt_status status = solve_unbounded(self, wanted, self->w, error);
  for (size_t i = 0; i < values; i++) {
    wanted[i] = clt_transport_black(self->transport, (int)(i / cells))[i % cells];
  }
  status = status == CLT_OK ? solve_unbounded(self, wanted, self->b, error) : status;
  free(wanted);
  if (status == CLT_OK) {
    find_factors(self);
  }
  return status;
}

static clt_status allocate(clt_mapping *self, clt_error *error) {
  size_t cells = self->info.cols, values = (size_t)self->info.channels * cells;
  self->p = clt_alloc(6 * values + cells, sizeof *self->p);
  self->w = self->p + values;
  self->b = self->w + values;
  self->way = self->b + values;
  self->lift = self->way + values;
  self->room = self->lift + values;
  self->product = self->room + values;
  return self->p != NULL ? prepare(self, error) : clt_fail(error, CLT_FAILED, "a target mapping: out of memory");
}

clt_status clt_mapping_create(const clt_transport *transport, const clt_certificate *certificate, const double *white,
                              double smooth_s, clt_mapping **out, clt_error *error) {
  clt_mapping *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "a target mapping: out of memory");
  }
  *self = (clt_mapping){.transport = transport,
                        .certificate = certificate,
                        .info = clt_transport_describe(transport),
                        .smooth_s = smooth_s,
                        .fast_s = CUT_S,
                        .scale = 1};
  for (int c = 0; c < self->info.channels; c++) {
    self->white[c] = white[c];
    self->scale_of[c] = self->moved_of[c] = 1;
  }
  clt_status status = allocate(self, error);
  if (status != CLT_OK) {
    clt_mapping_destroy(self);
    return status;
  }
  *out = self;
  return CLT_OK;
}

void clt_mapping_destroy(clt_mapping *self) {
  if (self != NULL) {
    free(self->p);
    free(self);
  }
}

/* One damped step of a channel's p. */
static void step(clt_mapping *self, int c, const float *picture) {
  const size_t cells = self->info.cols, at = (size_t)c * cells;
  const double *way = self->way + at, *product = self->product, white = self->white[c];
  double *p = self->p + at, moved = 0;
  picture += at;
  clt_transport_apply(self->transport, c, p, self->product);
  for (size_t i = 0; i < cells; i++) {
    const double change = way[i] * (white * (double)picture[i] - product[i]), far = fabs(change);
    p[i] += change;
    moved = far > moved ? far : moved;
  }
  self->moved_of[c] = moved;
}

/* The offset that a channel needs, and with one for all, or greys would be tinted, the scale. */
static void need(clt_mapping *self, int c) {
  const size_t cells = self->info.cols, at = (size_t)c * cells;
  const double *p = self->p + at, *w = self->w + at, *b = self->b + at, *lift = self->lift + at;
  const double *room = self->room + at, larger = 1 / self->scale;
  double offset = 0, most = 1;
  for (size_t i = 0; i < cells; i++) {
    const double own = (larger * b[i] - p[i]) * lift[i];
    offset = own > offset ? own : offset;
  }
  self->offset_of[c] = offset;
  for (int k = 0; k < self->info.channels; k++) {
    offset = fmax(offset, self->offset_of[k]);
  }
  for (size_t i = 0; i < cells; i++) {
    const double full = (p[i] + offset * w[i]) * room[i];
    most = full > most ? full : most;
  }
  self->scale_of[c] = 1 / most;
}

static bool approach(double *value, double wanted, double part) {
  double way = wanted - *value;
  *value += fabs(way) > NEAR ? part * way : 0;
  return fabs(way) > NEAR;
}

bool clt_mapping_follow(clt_mapping *self, const float *picture, double seconds, bool cut) {
  double scale = 1, offset = 0, moved = 0;
  self->fast_s = cut ? CUT_S : self->fast_s - seconds;
  step(self, self->turn, picture);
  need(self, self->turn);
  self->turn = (self->turn + 1) % self->info.channels;
  for (int c = 0; c < self->info.channels; c++) {
    scale = fmin(scale, self->scale_of[c]);
    offset = fmax(offset, self->offset_of[c]);
    moved = fmax(moved, self->moved_of[c]);
  }
  double part = 1 - exp(-seconds * (self->fast_s > 0 ? CUT_FASTER : 1) / self->smooth_s);
  bool scales = approach(&self->scale, scale, part), shifts = approach(&self->offset, offset, part);
  return scales || shifts || moved > NEAR;
}

double clt_mapping_scale(const clt_mapping *self) {
  return self->scale;
}

/* Of the target white (scale picture + offset). */
double clt_mapping_offset(const clt_mapping *self) {
  return self->scale * self->offset;
}
