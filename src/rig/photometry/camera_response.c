#include "rig/photometry/camera_response.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/order.h"
#include "rig/photometry/monotone.h"

/* What is left of proportionality, of full scale, below which the camera is called linear. */
#define LINEAR 0.002
/* Of the light, and of full scale: how exactly an equation is expected to hold. */
#define RELATIVE_ERROR 1e-3
#define FLOOR_ERROR 5e-6
#define SMOOTHING 1e2
/* Expected errors from which an equation counts less. */
#define OUTLYING 8.0
/* A group's share of pixels at either end of the scale from which its equation is left out. */
#define CLIPPED_SHARE 1e-3
#define SATURATED 0.97

enum {
  NODES = CLT_CURVE_SAMPLES,
  INNER = NODES - 1, /* H_0 = 0 */
  GROUPS = CLT_FIELD_GROUPS * CLT_FIELD_CHANNELS,
  REFINEMENTS = 8,
  RATE_PASSES = 4
};

/* Exposures over the shortest. Powers of two alone would leave H undetermined by a factor that is periodic in log2 H.
 */
static const double ladder[CLT_BRACKET_EXPOSURES] = {1, 2, 3, 5, 8, 13, 21, 32};
/* Those of the dark panel, which join what is darker than the dimmest field to the rest. */
static const double dark_ladder[CLT_BRACKET_EXPOSURES] = {1 / 32., 1 / 13., 1 / 5., 1 / 2., 1, 3, 8, 21};

/* One equation. */
typedef struct sight {
  double hats[NODES], mean, count, clipped, seconds;
} sight;

/* sights[(field * GROUPS + group) * CLT_BRACKET_EXPOSURES + exposure] */
typedef struct bracket {
  sight *sights;
  int fields, exposures, at; /* at: first sight of the frame that is looked at, per group CLT_BRACKET_EXPOSURES apart */
} bracket;

static void add_samples(void *context, const clt_field_bench *bench, const clt_frame *frame) {
  bracket *self = context;
  double full = (1 << frame->bits) - 1, range = full - bench->black_level;
  for (size_t p = 0; p < bench->pixels; p++) {
    for (int c = 0; c < frame->channels && bench->group[p] > 0; c++) {
      int group = (bench->group[p] - 1) * CLT_FIELD_CHANNELS + c;
      sight *to = &self->sights[self->at + group * CLT_BRACKET_EXPOSURES];
      uint16_t sample = frame->samples[p * (size_t)frame->channels + (size_t)c];
      double v = (sample - bench->black_level) / range;
      double at = fmin(fabs(v), 1) * (NODES - 1), sign = v < 0 ? -1 : 1;
      int j = at < NODES - 2 ? (int)at : NODES - 2;
      to->hats[j] += sign * (j + 1 - at);
      to->hats[j + 1] += sign * (at - j);
      to->mean += v;
      to->count += 1;
      to->clipped += sample == 0 || v >= SATURATED;
      to->seconds = frame->exposure_s;
    }
  }
}

static void finish_sights(bracket *self) {
  for (int n = 0; n < self->fields * GROUPS * CLT_BRACKET_EXPOSURES; n++) {
    sight *s = &self->sights[n];
    for (int j = 0; j < NODES && s->count > 0; j++) {
      s->hats[j] /= s->count;
    }
    s->mean /= fmax(s->count, 1);
    if (s->clipped > CLIPPED_SHARE * s->count) {
      s->count = 0; /* no equation */
    }
  }
}

static double light_of(const sight *s, const double *h) {
  double light = 0;
  for (int j = 0; j < NODES; j++) {
    light += s->hats[j] * h[j];
  }
  return light;
}

static double weight_of(double light) {
  double error = RELATIVE_ERROR * fabs(light) + FLOOR_ERROR;
  return 1 / (error * error);
}

/* Weights of a group's equations at a rate: by their expected errors, and less the further they are from it (Cauchy),
 * for a torn frame may be among those of one. Without a rate yet, by their own light. */
static void weigh(const sight *sights, int exposures, const double *h, double rate, double weight[]) {
  for (int k = 0; k < exposures; k++) {
    double light = light_of(&sights[k], h), expected = rate > 0 ? rate * sights[k].seconds : light;
    double w = weight_of(expected), off = light - expected;
    weight[k] = sights[k].count > 0 ? w / (1 + w * off * off / (OUTLYING * OUTLYING)) : 0;
  }
}

/* The rate of one group of one field under a response, and the weights of its equations; 0 where fewer than two are
 * left. */
static double rate_of(const sight *sights, int exposures, const double *h, double weight[]) {
  double rate = 0;
  int left = 0;
  for (int k = 0; k < exposures; k++) {
    left += sights[k].count > 0;
  }
  for (int pass = 0; pass < RATE_PASSES && left >= 2; pass++) {
    double above = 0, below = 0;
    weigh(sights, exposures, h, rate, weight);
    for (int k = 0; k < exposures && sights[k].count >= 0; k++) {
      above += weight[k] * sights[k].seconds * light_of(&sights[k], h);
      below += weight[k] * sights[k].seconds * sights[k].seconds;
    }
    rate = above / below;
  }
  return rate;
}

/* normal += sum w a a' - (sum w t a)(sum w t a)' / sum w t^2: one group with its rate eliminated. */
static void add_group(const sight *sights, int exposures, const double *h, double *normal) {
  double weight[CLT_BRACKET_EXPOSURES], rate = rate_of(sights, exposures, h, weight), below = 0, mixed[NODES] = {0};
  if (!(rate > 0)) {
    return;
  }
  for (int k = 0; k < exposures; k++) {
    const sight *s = &sights[k];
    double w = weight[k];
    below += w * s->seconds * s->seconds;
    for (int i = 0; i < NODES && w > 0; i++) {
      mixed[i] += w * s->seconds * s->hats[i];
      for (int j = 0; j < NODES && s->hats[i] != 0; j++) {
        normal[i * NODES + j] += w * s->hats[i] * s->hats[j];
      }
    }
  }
  for (int i = 0; i < NODES; i++) {
    for (int j = 0; j < NODES; j++) {
      normal[i * NODES + j] -= mixed[i] * mixed[j] / below;
    }
  }
}

/* Third differences, expected to be a tenth of an equation's error at full light: the curve of gamma 2.2 has 6e-5. */
static void add_smoothing(double *normal) {
  static const double difference[4] = {-1, 3, -3, 1};
  double weight = SMOOTHING * weight_of(1);
  for (int first = 0; first + 4 <= NODES; first++) {
    for (int i = 0; i < 4; i++) {
      for (int j = 0; j < 4; j++) {
        normal[(first + i) * NODES + first + j] += weight * difference[i] * difference[j];
      }
    }
  }
}

/* Mean hats of the brightest equation. */
static const double *brightest_hats(const bracket *self) {
  const sight *best = &self->sights[0];
  for (int n = 0; n < self->fields * GROUPS * CLT_BRACKET_EXPOSURES; n++) {
    const sight *s = &self->sights[n];
    best = s->count > 0 && (best->count <= 0 || s->mean > best->mean) ? s : best;
  }
  return best->hats;
}

/* One step: weights by the present h, then the nodes above 0 anew. Every equation holds for H = 0 too, and no sample
 * reaches H_64: the light of the brightest equation, a H = 1, fixes the scale, which gives H = N^-1 a, and H_64 = 1
 * comes last. */
static clt_status refine(const bracket *self, double *h, double *normal, clt_error *error) {
  double inner[INNER * INNER], right[INNER];
  memset(normal, 0, sizeof(double[NODES * NODES]));
  for (int g = 0; g < self->fields * GROUPS; g++) {
    add_group(self->sights + (ptrdiff_t)g * CLT_BRACKET_EXPOSURES, self->exposures, h, normal);
  }
  add_smoothing(normal);
  memcpy(right, brightest_hats(self) + 1, sizeof right);
  for (int i = 0; i < INNER; i++) {
    memcpy(&inner[i * INNER], &normal[(i + 1) * NODES + 1], sizeof(double[INNER]));
  }
  if (LAPACKE_dposv(LAPACK_ROW_MAJOR, 'U', INNER, 1, inner, INNER, right, 1) != 0 || !(right[INNER - 1] > 0)) {
    return clt_fail(error, CLT_FAILED,
                    "the bracketed fields do not determine the camera's response; show more of them");
  }
  for (int i = 0; i < INNER; i++) {
    h[i + 1] = right[i] / right[INNER - 1];
  }
  return CLT_OK;
}

/* Departures from e t: the largest, of full scale, without the hundredth of them that is larger still; and relative to
 * the light their deviation, by their median. */
static double departure(const bracket *self, const double *h, double *relative) {
  enum { MOST = CLT_BRACKET_FIELDS * GROUPS * CLT_BRACKET_EXPOSURES };
  double off[MOST], ratio[MOST], weight[CLT_BRACKET_EXPOSURES];
  int count = 0;
  for (int g = 0; g < self->fields * GROUPS; g++) {
    const sight *sights = self->sights + (ptrdiff_t)g * CLT_BRACKET_EXPOSURES;
    double rate = rate_of(sights, self->exposures, h, weight);
    for (int k = 0; k < self->exposures && rate > 0; k++) {
      if (sights[k].count > 0) {
        double light = rate * sights[k].seconds;
        off[count] = fabs(light_of(&sights[k], h) - light);
        ratio[count] = off[count] / (light + sqrt(FLOOR_ERROR));
        count++;
      }
    }
  }
  int kept = count - count / 100;
  clt_sort_doubles(off, (size_t)count);
  clt_sort_doubles(ratio, (size_t)count);
  *relative = count > 0 ? 1.4826 * ratio[count / 2] : 0;
  return kept > 0 ? off[kept - 1] : 0;
}

static void cover(const bracket *self, double covered[2]) {
  covered[0] = 1;
  covered[1] = 0;
  for (int n = 0; n < self->fields * GROUPS * CLT_BRACKET_EXPOSURES; n++) {
    if (self->sights[n].count > 0) {
      covered[0] = fmin(covered[0], self->sights[n].mean);
      covered[1] = fmax(covered[1], self->sights[n].mean);
    }
  }
}

static clt_status fit(const bracket *self, clt_camera_response *out, clt_error *error) {
  double h[NODES], flat[NODES], normal[NODES * NODES];
  clt_status status = CLT_OK;
  for (int j = 0; j < NODES; j++) {
    h[j] = (double)j / (NODES - 1);
    flat[j] = 1;
  }
  cover(self, out->covered);
  out->proportion = departure(self, h, &out->residual);
  if (out->covered[1] < 0.5 || out->covered[0] > 0.4 * out->covered[1]) {
    return clt_fail(error, CLT_FAILED,
                    "bracketing covers samples from %.2g to %.2g of full scale only; open the camera's aperture or "
                    "allow longer exposures",
                    out->covered[0], out->covered[1]);
  }
  if (out->proportion <= LINEAR) {
    out->curve = (clt_curve){.kind = CLT_CURVE_LINEAR};
    return CLT_OK;
  }
  for (int step = 0; step < REFINEMENTS && status == CLT_OK; step++) {
    status = refine(self, h, normal, error);
  }
  if (status == CLT_OK) {
    clt_monotone_fit(h, flat, NODES);
    departure(self, h, &out->residual);
    out->curve = (clt_curve){.kind = CLT_CURVE_TABLE};
    for (int j = 0; j < NODES; j++) {
      out->curve.table[j] = fmin(fmax(h[j], 0), 1);
    }
  }
  return status;
}

/* All exposures of one field; field 0 is the dark panel. */
static clt_status see_field(clt_field_bench *bench, bracket *self, int field, double shortest_s, int frames,
                            clt_error *error) {
  double level = (double)field / (self->fields - 1), code[CLT_FIELD_CHANNELS] = {level, level, level};
  int64_t ready_ns = 0;
  clt_field seen;
  clt_status status = clt_field_show(bench, code, &ready_ns, error);
  for (int k = 0; k < self->exposures && status == CLT_OK; k++) {
    self->at = field * GROUPS * CLT_BRACKET_EXPOSURES + k;
    double seconds = shortest_s * (field > 0 ? ladder : dark_ladder)[k];
    if (seconds < bench->shots->sensor.exposure_min_s) {
      continue;
    }
    status = clt_field_take(bench, ready_ns, seconds, frames, add_samples, self, &seen, error);
    if (status == CLT_OK && seen.saturated[0] > 0.99 && seen.saturated[bench->channels - 1] > 0.99) {
      break;
    }
  }
  return status;
}

clt_status clt_camera_response_measure(clt_field_bench *bench, double shortest_s, int frames, clt_camera_response *out,
                                       clt_error *error) {
  bracket self = {.fields = CLT_BRACKET_FIELDS, .exposures = CLT_BRACKET_EXPOSURES};
  self.sights = clt_alloc((size_t)CLT_BRACKET_FIELDS * GROUPS * CLT_BRACKET_EXPOSURES, sizeof *self.sights);
  if (self.sights == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for bracketing");
  }
  while (self.exposures > 1 && shortest_s * ladder[self.exposures - 1] > bench->shots->sensor.exposure_max_s) {
    self.exposures--;
  }
  *out = (clt_camera_response){0};
  clt_status status = CLT_OK;
  for (int field = 0; field < self.fields && status == CLT_OK; field++) {
    status = see_field(bench, &self, field, shortest_s, frames, error);
  }
  if (status == CLT_OK) {
    finish_sights(&self);
    status = fit(&self, out, error);
  }
  free(self.sights);
  return status;
}
