#include "rig/photometry/projector.h"

#include <math.h>
#include <string.h>

#include "rig/photometry/monotone.h"

enum { EXPOSURES = 3, BETWEEN_REFERENCES = 8, REFERENCES_MAX = 64, CHANNELS = CLT_PANEL_CHANNELS };
/* Three base exposures of one refresh of 60 Hz are 50 ms: whole periods of 100 and 120 Hz. */
static const double factors[EXPOSURES] = {1, 3, 12};
/* A longer exposure is tried where the light would stay below this share of full scale, and kept where no more than
 * this share of pixels is near it. */
#define ROOM 0.5
#define SATURATED_SHARE 1e-3

static const double white[CHANNELS] = {1, 1, 1}, dark[CHANNELS] = {0, 0, 0};

typedef struct reference {
  double at_s, rate[CHANNELS];
} reference;

typedef struct ramps {
  clt_field_bench *bench;
  double base_s;
  int levels, frames, exposures;
  double dark[EXPOSURES][CHANNELS]; /* rates of the dark panel */
  reference references[REFERENCES_MAX];
  int reference_count;
  double code[CLT_RAMP_LEVELS_MOST];
  double at_s[CHANNELS][CLT_RAMP_LEVELS_MOST];
  double rate[CHANNELS][CLT_RAMP_LEVELS_MOST][CHANNELS]; /* [driven][level][seen], dark taken off */
} ramps;

static bool is_saturated(const ramps *self, const clt_field *field) {
  for (int c = 0; c < self->bench->channels; c++) {
    if (field->saturated[c] > SATURATED_SHARE) {
      return true;
    }
  }
  return false;
}

/* The dark panel at each exposure that it leaves unsaturated. */
static clt_status see_dark(ramps *self, clt_error *error) {
  int64_t ready_ns = 0;
  clt_status status = clt_field_show(self->bench, dark, &ready_ns, error);
  for (int k = 0; k < EXPOSURES && status == CLT_OK; k++) {
    clt_field field;
    double seconds = factors[k] * self->base_s;
    if (seconds > self->bench->shots->sensor.exposure_max_s) {
      break;
    }
    status = clt_field_take(self->bench, ready_ns, seconds, 2 * self->frames, NULL, NULL, &field, error);
    if (status == CLT_OK && is_saturated(self, &field)) {
      break;
    }
    for (int c = 0; c < self->bench->channels && status == CLT_OK; c++) {
      self->dark[k][c] = field.light[c] / field.seconds;
    }
    self->exposures = k + 1;
  }
  if (status == CLT_OK && self->exposures == 0) {
    return clt_fail(error, CLT_FAILED,
                    "the dark panel saturates the camera at %.4g ms; make the room darker or close "
                    "the aperture",
                    self->base_s * 1e3);
  }
  return status;
}

static clt_status see_reference(ramps *self, clt_error *error) {
  clt_field field;
  clt_status status = clt_field_see(self->bench, white, self->base_s, self->frames, &field, error);
  if (status == CLT_OK && self->reference_count < REFERENCES_MAX) {
    reference *made = &self->references[self->reference_count++];
    made->at_s = field.at_s;
    for (int c = 0; c < self->bench->channels; c++) {
      made->rate[c] = field.light[c] / field.seconds - self->dark[0][c];
    }
  }
  return status;
}

/* Brightness of the reference at a time over that of the first, in a channel. */
static double gain_at(const ramps *self, int c, double at_s) {
  int k = 1;
  while (k < self->reference_count - 1 && self->references[k].at_s < at_s) {
    k++;
  }
  const reference *a = &self->references[k - 1], *b = &self->references[k];
  double share = fmin(fmax((at_s - a->at_s) / (b->at_s - a->at_s), 0), 1);
  return (a->rate[c] + share * (b->rate[c] - a->rate[c])) / self->references[0].rate[c];
}

/* One level of one channel: the longest exposure that has room for it, judged by the level below. */
static clt_status see_level(ramps *self, int driven, int level, clt_error *error) {
  double code[CHANNELS] = {0, 0, 0};
  code[driven] = self->code[level];
  int64_t ready_ns = 0;
  clt_field field;
  double below = level > 0 ? self->rate[driven][level - 1][driven] : 0;
  int k = self->exposures - 1;
  while (k > 0 && (below + self->dark[k][driven]) * factors[k] * self->base_s > ROOM) {
    k--;
  }
  clt_status status = clt_field_show(self->bench, code, &ready_ns, error);
  for (bool seen = false; status == CLT_OK && !seen; k--) {
    status = clt_field_take(self->bench, ready_ns, factors[k] * self->base_s, self->frames, NULL, NULL, &field, error);
    seen = status == CLT_OK && (k == 0 || !is_saturated(self, &field));
    for (int c = 0; c < self->bench->channels && seen; c++) {
      self->rate[driven][level][c] = field.light[c] / field.seconds - self->dark[k][c];
    }
  }
  self->at_s[driven][level] = field.at_s;
  return status;
}

static clt_status see_ramps(ramps *self, clt_error *error) {
  clt_status status = see_dark(self, error);
  status = status == CLT_OK ? see_reference(self, error) : status;
  for (int driven = 0; driven < self->bench->channels && status == CLT_OK; driven++) {
    for (int level = 1; level < self->levels && status == CLT_OK; level++) {
      status = see_level(self, driven, level, error);
      if (status == CLT_OK && (level % BETWEEN_REFERENCES == 0 || level == self->levels - 1)) {
        status = see_reference(self, error);
      }
    }
  }
  for (int driven = 0; driven < self->bench->channels && status == CLT_OK; driven++) {
    for (int level = 1; level < self->levels; level++) {
      for (int c = 0; c < self->bench->channels; c++) {
        self->rate[driven][level][c] /= gain_at(self, c, self->at_s[driven][level]);
      }
    }
  }
  return status;
}

/* The measured levels as a curve from (0, 0) to (1, 1). */
static clt_status fit_curve(ramps *self, int channel, clt_projector_photometry *out, clt_error *error) {
  double light[CLT_RAMP_LEVELS_MOST] = {0}, weight[CLT_RAMP_LEVELS_MOST] = {0};
  int last = self->levels - 1;
  double full = self->rate[channel][last][channel];
  if (!(full > 0)) {
    return clt_fail(error, CLT_FAILED,
                    "the panel's channel %d gives no light to the camera's; look at its cable and "
                    "its colour settings",
                    channel);
  }
  for (int level = 0; level <= last; level++) {
    light[level] = self->rate[channel][level][channel] / full;
    weight[level] = 1;
    double fall = level > 0 ? light[level - 1] - light[level] : 0;
    out->largest_fall = fmax(out->largest_fall, fall);
  }
  clt_monotone_fit(light, weight, self->levels);
  for (int level = 0; level <= last; level++) {
    light[level] = fmin(fmax(light[level], 0), 1);
  }
  light[0] = 0;
  light[last] = 1;
  return clt_curve_from_points(self->code, light, self->levels, &out->panel.response[channel], error);
}

static clt_status find_crosstalk(ramps *self, clt_projector_photometry *out, clt_error *error) {
  double light[CHANNELS * CHANNELS];
  for (int c = 0; c < self->bench->channels; c++) {
    double sum = 0;
    for (int k = 0; k < self->bench->channels; k++) {
      light[CHANNELS * c + k] = fmax(self->rate[k][self->levels - 1][c], 0);
      sum += light[CHANNELS * c + k];
    }
    double beyond = self->references[0].rate[c] / sum - 1;
    out->additivity = fabs(beyond) > fabs(out->additivity) ? beyond : out->additivity;
  }
  return self->bench->channels == CHANNELS ? clt_panel_set_crosstalk(&out->panel, light, error) : CLT_OK;
}

/* What the references say of the lamp, and the dark panel against the white one. */
static void judge(const ramps *self, clt_projector_photometry *out) {
  double least = 1, most = 1;
  for (int n = 0; n < self->reference_count; n++) {
    double gain = self->references[n].rate[0] / self->references[0].rate[0];
    least = fmin(least, gain);
    most = fmax(most, gain);
  }
  out->drift = most / least - 1;
  out->seconds = self->references[self->reference_count - 1].at_s - self->references[0].at_s;
  for (int c = 0; c < self->bench->channels; c++) {
    double black = self->dark[self->exposures - 1][c];
    out->black[c] = black / (self->references[0].rate[c] + black);
  }
}

clt_status clt_projector_measure(clt_field_bench *bench, double base_s, int levels, int frames,
                                 clt_projector_photometry *out, clt_error *error) {
  ramps self = {.bench = bench, .base_s = base_s, .levels = levels, .frames = frames};
  double steps = (1 << bench->shots->panel.bits) - 1;
  *out = (clt_projector_photometry){0};
  if (levels < CLT_RAMP_LEVELS_LEAST || levels > CLT_RAMP_LEVELS_MOST || levels > steps + 1) {
    return clt_fail(error, CLT_BAD_INPUT, "ramps of %d levels; legal are %d to %d, and no more than the panel has",
                    levels, CLT_RAMP_LEVELS_LEAST, CLT_RAMP_LEVELS_MOST);
  }
  for (int level = 0; level < levels; level++) {
    self.code[level] = rint(steps * level / (levels - 1)) / steps;
  }
  clt_status status = see_ramps(&self, error);
  for (int c = 0; c < bench->channels && status == CLT_OK; c++) {
    status = fit_curve(&self, c, out, error);
  }
  if (status == CLT_OK) {
    status = find_crosstalk(&self, out, error);
  }
  if (status == CLT_OK) {
    judge(&self, out);
  }
  return status;
}

int clt_projector_fields(int channels, int levels) {
  return EXPOSURES + 1 + channels * (levels - 1 + (levels - 1) / BETWEEN_REFERENCES);
}
