#include "daemon/renew.h"

#include <math.h>
#include <stdlib.h>
#include <time.h>

#include "base/clock.h"
#include "base/memory.h"
#include "base/order.h"

static const double DEVIATIONS = 6;
enum { SHOT_BLACK, SHOT_FLOOD, SHOT_CHECK, SHOT_COUNT = SHOT_CHECK + RENEW_CHECKS };

/* The mean of photographs of one drive. */
typedef struct shot {
  clt_image drive, seen, deviation;
} shot;

typedef struct renewer {
  clt_rig *rig;
  const daemon_model *model;
  const renew_options *options;
  clt_transport_info info;
  shot shots[SHOT_COUNT];
  clt_image glance, spread;
  double *predicted, *ratio, *kept; /* channels x cells: T 1, the factor of each row, workspace */
  clt_progress progress;
  int64_t started_ns;
} renewer;

static clt_status make_image(const renewer *self, clt_image *out, clt_error *error) {
  return clt_image_init(out, self->info.channels, self->info.height, self->info.width, error);
}

static clt_status prepare(renewer *self, clt_error *error) {
  size_t values = (size_t)self->info.channels * self->info.cols;
  clt_status status = make_image(self, &self->glance, error);
  status = status == CLT_OK ? make_image(self, &self->spread, error) : status;
  for (int i = 0; i < SHOT_COUNT; i++) {
    shot *at = &self->shots[i];
    status = status == CLT_OK ? make_image(self, &at->drive, error) : status;
    status = status == CLT_OK ? make_image(self, &at->seen, error) : status;
    status = status == CLT_OK ? make_image(self, &at->deviation, error) : status;
  }
  self->predicted = clt_alloc(3 * values, sizeof(double));
  if (status == CLT_OK && self->predicted == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory to look for what changed in %zu cells", self->info.cols);
  }
  self->ratio = self->predicted != NULL ? self->predicted + values : NULL;
  self->kept = self->predicted != NULL ? self->ratio + values : NULL;
  return status;
}

static void finish(renewer *self) {
  for (int i = 0; i < SHOT_COUNT; i++) {
    clt_image_finish(&self->shots[i].drive);
    clt_image_finish(&self->shots[i].seen);
    clt_image_finish(&self->shots[i].deviation);
  }
  clt_image_finish(&self->glance);
  clt_image_finish(&self->spread);
  free(self->predicted);
}

/* Nothing, everything, or half of the values by a generator of fixed seed (Numerical Recipes' constants). */
static void draw(renewer *self, int which) {
  clt_image *drive = &self->shots[which].drive;
  uint32_t state = (uint32_t)which;
  for (size_t i = 0; i < clt_image_size(drive); i++) {
    state = 1664525u * state + 1013904223u;
    drive->data[i] = which == SHOT_BLACK ? 0 : which == SHOT_FLOOD ? 1 : (float)(state >> 31);
  }
}

static bool report(renewer *self, int which) {
  static const char *const phases[] = {"black", "flood", "check"};
  self->progress.phase = phases[which < SHOT_CHECK ? which : SHOT_CHECK];
  self->progress.done++;
  self->progress.seconds = clt_clock_since(self->started_ns);
  self->progress.left =
      self->progress.seconds * (double)(self->progress.total - self->progress.done) / (double)self->progress.done;
  return self->options->progress(self->options->context, &self->progress);
}

/* The mean of the valid photographs of each value; its deviation is infinite where there was none. */
static void settle(shot *taken, const double *valid) {
  for (size_t i = 0; i < clt_image_size(&taken->seen); i++) {
    taken->seen.data[i] = valid[i] > 0 ? (float)(taken->seen.data[i] / valid[i]) : 0;
    taken->deviation.data[i] = valid[i] > 0 ? (float)(sqrt(taken->deviation.data[i]) / valid[i]) : INFINITY;
  }
}

static clt_status photograph(renewer *self, int which, int repeats, clt_error *error) {
  shot *taken = &self->shots[which];
  size_t values = clt_image_size(&taken->seen);
  double *valid = self->kept;
  draw(self, which);
  for (size_t i = 0; i < values; i++) {
    valid[i] = 0;
  }
  for (int n = 0; n < repeats; n++) {
    clt_status status = self->rig->operations->observe(self->rig, &taken->drive, &self->glance, &self->spread, error);
    if (status != CLT_OK) {
      return status;
    }
    for (size_t i = 0; i < values; i++) {
      if (isfinite(self->spread.data[i])) {
        taken->seen.data[i] += self->glance.data[i];
        taken->deviation.data[i] += self->spread.data[i] * self->spread.data[i];
        valid[i]++;
      }
    }
    if (!report(self, which)) {
      return clt_fail(error, CLT_CANCELLED, "looking for what changed was given up");
    }
  }
  settle(taken, valid);
  return CLT_OK;
}

static clt_status photograph_all(renewer *self, clt_error *error) {
  int repeats = self->options->repeats, checks = self->options->changed ? RENEW_CHECKS : 0;
  self->started_ns = clt_clock_ns();
  self->progress.total = 2 * repeats + checks;
  clt_status status = photograph(self, SHOT_BLACK, repeats, error);
  status = status == CLT_OK ? photograph(self, SHOT_FLOOD, repeats, error) : status;
  for (int i = 0; status == CLT_OK && i < checks; i++) {
    status = photograph(self, SHOT_CHECK + i, 1, error);
  }
  return status;
}

/* flood / T 1 of value i; *deviation is infinite where that says nothing. */
static double flood_ratio(const renewer *self, size_t i, bool lit, double *deviation) {
  const shot *black = &self->shots[SHOT_BLACK], *flood = &self->shots[SHOT_FLOOD];
  double of = self->predicted[i], a = black->deviation.data[i], b = flood->deviation.data[i];
  *deviation = lit && of > 0 ? sqrt(a * a + b * b) / of : INFINITY;
  return isfinite(*deviation) ? ((double)flood->seen.data[i] - black->seen.data[i]) / of : 1;
}

/* Every row's factor is the gain of its channel. */
static void find_gains(renewer *self) {
  size_t cells = self->info.cols;
  for (int c = 0; c < self->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(self->model->certificate, c);
    double *row_sums = self->predicted + (size_t)c * cells, deviation;
    size_t count = 0;
    clt_transport_row_sums(self->model->transport, c, row_sums);
    for (size_t i = 0; i < cells; i++) {
      double ratio = flood_ratio(self, (size_t)c * cells + i, lit[i], &deviation);
      if (isfinite(deviation)) {
        self->kept[count++] = ratio;
      }
    }
    clt_sort_doubles(self->kept, count);
    for (size_t i = 0; i < cells; i++) {
      self->ratio[(size_t)c * cells + i] = count > 0 ? self->kept[count / 2] : 1;
    }
  }
}

/* Rows that are no longer in step with their channel get factors of their own; how many. */
static size_t find_repainted(renewer *self) {
  size_t cells = self->info.cols, count = 0;
  for (size_t i = 0; i < (size_t)self->info.channels * cells; i++) {
    double deviation;
    bool lit = clt_certificate_lit(self->model->certificate, (int)(i / cells))[i % cells] != 0;
    double ratio = flood_ratio(self, i, lit, &deviation);
    if (isfinite(deviation) && fabs(ratio - self->ratio[i]) > DEVIATIONS * deviation) {
      self->ratio[i] = fmax(ratio, 0);
      count++;
    }
  }
  return count;
}

static void scale_channel(const renewer *self, clt_transport *made, int c) {
  size_t cells = self->info.cols;
  float *entries = clt_transport_entries(made, c), *black = clt_transport_black(made, c);
  float *flood = clt_transport_flood_values(made, c), *sigma = clt_transport_sigma_values(made, c);
  const shot *dark = &self->shots[SHOT_BLACK];
  for (size_t i = 0; i < cells; i++) {
    size_t at = (size_t)c * cells + i;
    float factor = (float)self->ratio[at];
    for (size_t j = 0; j < cells; j++) {
      entries[i * cells + j] *= factor;
    }
    black[i] = isfinite(dark->deviation.data[at]) ? dark->seen.data[at] : black[i];
    if (flood != NULL) {
      flood[i] *= factor;
    }
    if (sigma != NULL) {
      sigma[i] *= factor;
    }
  }
}

static clt_status scale(const renewer *self, clt_transport **out, clt_error *error) {
  clt_status status = clt_transport_convert(self->model->transport, "dense", out, error);
  for (int c = 0; status == CLT_OK && c < self->info.channels; c++) {
    scale_channel(self, *out, c);
  }
  if (status == CLT_OK) {
    clt_transport_provenance(*out)->acquired = time(NULL);
  }
  return status;
}

/* The photograph that fits worst. */
static clt_status judge(const renewer *self, const clt_transport *transport, clt_fit *worst, clt_error *error) {
  int last = self->options->changed ? SHOT_COUNT : SHOT_CHECK;
  *worst = (clt_fit){0};
  for (int i = SHOT_FLOOD; i < last; i++) {
    const shot *taken = &self->shots[i];
    clt_fit fit;
    clt_status status = clt_loop_check(transport, self->model->certificate, &taken->drive, &taken->seen,
                                       &taken->deviation, &fit, error);
    if (status != CLT_OK) {
      return status;
    }
    if (worst->limit == 0 || fit.off * worst->limit > worst->off * fit.limit) {
      *worst = fit;
    }
  }
  return CLT_OK;
}

/* Tries T with the factors in ratio. *out stays NULL where it does not fit and has to. */
static clt_status try_factors(const renewer *self, bool has_to_fit, clt_transport **out, renewal *found,
                              clt_error *error) {
  clt_transport *made = NULL;
  clt_status status = scale(self, &made, error);
  status = status == CLT_OK ? judge(self, made, &found->after, error) : status;
  if (status == CLT_OK && (found->after.fits || !has_to_fit)) {
    *out = made;
    return CLT_OK;
  }
  clt_transport_destroy(made);
  return status;
}

static clt_status explain(renewer *self, clt_transport **out, renewal *found, clt_error *error) {
  clt_status status = judge(self, self->model->transport, &found->before, error);
  found->after = found->before;
  found->outcome = RENEW_FITS;
  if (status != CLT_OK || (self->options->changed && found->before.fits)) {
    return status;
  }
  found->outcome = RENEW_MEASURE;
  if (self->info.cols > RENEW_CELLS_MOST) {
    return CLT_OK;
  }
  find_gains(self);
  found->outcome = RENEW_GAIN;
  status = try_factors(self, self->options->changed, out, found, error);
  if (status == CLT_OK && *out == NULL) {
    found->outcome = RENEW_REPAINT;
    found->rows = find_repainted(self);
    status = try_factors(self, true, out, found, error);
  }
  found->outcome = *out != NULL ? found->outcome : RENEW_MEASURE;
  return status;
}

clt_status renew_transport(clt_rig *rig, const daemon_model *model, const renew_options *options, clt_transport **out,
                           renewal *found, clt_error *error) {
  renewer self = {.rig = rig, .model = model, .options = options, .info = clt_transport_describe(model->transport)};
  *out = NULL;
  *found = (renewal){0};
  clt_status status = prepare(&self, error);
  status = status == CLT_OK ? photograph_all(&self, error) : status;
  found->patterns = (int)self.progress.done;
  status = status == CLT_OK ? explain(&self, out, found, error) : status;
  finish(&self);
  return status;
}
