#include "rig/timing/flashes.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"
#include "base/random.h"

enum { FLASHES_MAX = 512, FRAMES_PER_FLASH = 8, FRAMES_MAX = FLASHES_MAX * FRAMES_PER_FLASH, STEPS = 32 };
/* Departure, of the step from dark to bright, from which a frame fits no delay. */
#define WRONG 0.2
#define LEAST_STEP 0.02
/* Two delays fit equally well where their squares differ by less than so many variances of a frame's noise. */
#define EQUALLY_WELL 4.0
/* Share of a frame's time to which a change is timed, or is left out; changes that are needed for a histogram. */
#define TIMED_TO 0.25
enum { ENOUGH_CHANGES = 8 };
/* A change is looked for so many frames to either side. */
#define REACH_FRAMES 1.5

typedef struct sighting {
  double start_s, length_s, light;
} sighting;

typedef struct recording {
  int flashes, frames;
  double shown_s[FLASHES_MAX];
  double level[FLASHES_MAX];
  double delay_s[FLASHES_MAX]; /* of each flash's change */
  bool timed[FLASHES_MAX];
  sighting frame[FRAMES_MAX];
  double first_s;      /* frames from then on see the first flash, whatever the delay */
  double dark, bright; /* light of a frame that saw only one level */
} recording;

static double mean_light(const clt_shots *shots, const clt_frame *frame) {
  double sum = 0, full = (1 << frame->bits) - 1 - shots->sensor.black_level;
  size_t samples = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
  for (size_t k = 0; k < samples; k++) {
    sum += frame->samples[k];
  }
  return (sum / (double)samples - shots->sensor.black_level) / full;
}

/* The next `count` frames, all of them. */
static clt_status record_frames(clt_shots *shots, recording *self, int count, int64_t *last_ns, uint64_t *digest,
                                clt_latency *out, clt_error *error) {
  uint32_t sequence = 0;
  for (int n = 0; n < count && self->frames < FRAMES_MAX; n++) {
    clt_frame frame;
    clt_status status = shots->camera->driver->next(shots->camera, *last_ns + 1, shots->timeout_s, &frame, error);
    if (status != CLT_OK) {
      return status;
    }
    uint64_t now = shots->noisy ? clt_shots_digest(&frame) : 0;
    out->duplicates += now != 0 && now == *digest;
    out->lost += n > 0 ? (long)(frame.sequence - sequence) - 1 : 0;
    sequence = frame.sequence;
    *digest = now;
    *last_ns = frame.exposed_ns;
    self->frame[self->frames++] =
        (sighting){1e-9 * (double)frame.exposed_ns, frame.exposure_s, mean_light(shots, &frame)};
  }
  return CLT_OK;
}

/* Flashes by chance, each for 2 to FRAMES_PER_FLASH - 1 frames. */
static clt_status record(clt_shots *shots, recording *self, const clt_latency_options *options, clt_latency *out,
                         clt_error *error) {
  size_t values = (size_t)shots->panel.width * (size_t)shots->panel.height * (size_t)shots->panel.channels;
  float *codes = clt_alloc(values, sizeof *codes);
  uint64_t key = clt_random_key(options->seed, 7), digest = 0;
  int64_t last_ns = -1, complete_ns = 0;
  clt_status status =
      codes != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for a flash of %zu values", values);
  if (status == CLT_OK) {
    status = shots->camera->driver->set_exposure(shots->camera, options->exposure_s, error);
  }
  for (int i = 0; i < options->flashes && status == CLT_OK; i++) {
    uint64_t bits = clt_random_bits(key, (uint64_t)i);
    self->level[i] = (double)(bits & 1);
    for (size_t k = 0; k < values; k++) {
      codes[k] = (float)self->level[i];
    }
    status = clt_shots_show(shots, codes, &complete_ns, error);
    self->shown_s[i] = 1e-9 * (double)complete_ns - shots->latency_s;
    self->flashes = i + 1;
    if (status == CLT_OK) {
      status =
          record_frames(shots, self, 2 + (int)((bits >> 8) % (FRAMES_PER_FLASH - 2)), &last_ns, &digest, out, error);
    }
    if (status == CLT_OK && options->progress != NULL &&
        !options->progress(options->context, i + 1, options->flashes)) {
      status = clt_fail(error, CLT_CANCELLED, "timing was stopped after %d flashes", i + 1);
    }
  }
  free(codes);
  return status;
}

/* Share of the bright level in a frame, were every change `delay` (or, where there are, its own delay) late; negative
 * where the frame may have seen what was before the first flash. */
static double share_of(const recording *self, const sighting *frame, double delay, bool own) {
  double end = frame->start_s + frame->length_s, share = 0;
  if (frame->start_s < self->first_s) {
    return -1;
  }
  int low = 0, high = self->flashes;
  while (high - low > 1) { /* the last flash that is lit when the frame begins */
    int middle = (low + high) / 2;
    double lit = self->shown_s[middle] + (own ? self->delay_s[middle] : delay);
    *(lit <= frame->start_s ? &low : &high) = middle;
  }
  for (int i = low; i < self->flashes; i++) {
    double from = fmax(self->shown_s[i] + (own ? self->delay_s[i] : delay), frame->start_s);
    double to = i + 1 < self->flashes ? self->shown_s[i + 1] + (own ? self->delay_s[i + 1] : delay) : end;
    if (from >= end) {
      break;
    }
    share += self->level[i] * fmax(fmin(to, end) - from, 0);
  }
  return share / frame->length_s;
}

/* Mean squared departure from dark + (bright - dark) share at the best dark and bright, which are kept. */
static double misfit_at(recording *self, double delay) {
  double n = 0, x = 0, xx = 0, y = 0, xy = 0, yy = 0;
  for (int f = 0; f < self->frames; f++) {
    double share = share_of(self, &self->frame[f], delay, false), light = self->frame[f].light;
    if (share >= 0) {
      n += 1;
      x += share;
      xx += share * share;
      y += light;
      xy += share * light;
      yy += light * light;
    }
  }
  double determinant = n * xx - x * x;
  if (!(determinant > 0)) {
    return INFINITY;
  }
  double step = (n * xy - x * y) / determinant, dark = (y - step * x) / n;
  self->dark = dark;
  self->bright = dark + step;
  return step > 0 ? fmax(yy - dark * y - step * xy, 0) / n : INFINITY;
}

/* How far in steps of `step` (of either sign) a delay can be moved without fitting worse. */
static double reach_from(recording *self, double best, double step, double enough) {
  double delay = best;
  while (delay + step >= 0 && fabs(delay + step - best) < 1 && misfit_at(self, delay + step) <= enough) {
    delay += step;
  }
  return delay;
}

/* The delay of least misfit, up to longest_s: on a grid of an eighth of an exposure, then by shrinking around it; the
 * middle of those that fit equally well, and half their range. */
static double best_delay(recording *self, double longest_s, double *uncertain_s) {
  double grid = self->frame[0].length_s / 8, step = grid, best = 0, least = INFINITY;
  for (double delay = 0; delay <= longest_s; delay += step) {
    double misfit = misfit_at(self, delay);
    if (misfit < least) {
      least = misfit;
      best = delay;
    }
  }
  for (; step > 1e-6; step *= 0.6) {
    double below = misfit_at(self, fmax(best - step, 0)), above = misfit_at(self, best + step);
    best = below < least ? fmax(best - step, 0) : above < least ? best + step : best;
    least = fmin(least, fmin(below, above));
  }
  double enough = least * (1 + EQUALLY_WELL / self->frames) + 1e-12;
  double low = reach_from(self, best, -grid / 16, enough), high = reach_from(self, best, grid / 16, enough);
  *uncertain_s = 0.5 * (high - low);
  misfit_at(self, 0.5 * (low + high));
  return 0.5 * (low + high);
}

/* Departure of a frame, of the step from dark to bright, from what the flashes' own delays say. */
static double departure(const recording *self, const sighting *frame) {
  double share = share_of(self, frame, 0, true);
  return share >= 0 ? (frame->light - self->dark) / (self->bright - self->dark) - share : 0;
}

/* Squares of the departures of the frames that a change at shown + delay +- reach can touch. */
static double local_misfit(const recording *self, int flash, double around, double reach) {
  double centre = self->shown_s[flash] + around, squares = 0;
  for (int f = 0; f < self->frames; f++) {
    const sighting *frame = &self->frame[f];
    if (frame->start_s + frame->length_s > centre - reach && frame->start_s < centre + reach) {
      double off = departure(self, frame);
      squares += off * off;
    }
  }
  return squares;
}

/* Variance of frames that no change comes near: their noise. */
static double noise_of(const recording *self, double reach) {
  double squares = 0, count = 0;
  for (int f = 0; f < self->frames; f++) {
    const sighting *frame = &self->frame[f];
    bool near = false;
    for (int i = 0; i < self->flashes; i++) {
      double change = self->shown_s[i] + self->delay_s[i];
      near = near || (change > frame->start_s - reach && change < frame->start_s + frame->length_s + reach);
    }
    double off = departure(self, frame);
    if (!near && fabs(off) < WRONG) {
      squares += off * off;
      count += 1;
    }
  }
  return count > 0 ? squares / count : 0;
}

/* The delay of one change by the frames around it, the others' held: the middle of those that fit equally well, where
 * these are close together. */
static void time_change(recording *self, int flash, double around, double reach, double noise) {
  double misfit[2 * STEPS + 1], least = INFINITY, sum = 0, count = 0, first = INFINITY, last = 0;
  for (int k = 0; k <= 2 * STEPS; k++) {
    self->delay_s[flash] = fmax(around + reach * (k - STEPS) / STEPS, 0);
    misfit[k] = local_misfit(self, flash, around, reach);
    least = fmin(least, misfit[k]);
  }
  for (int k = 0; k <= 2 * STEPS; k++) {
    if (misfit[k] <= least + EQUALLY_WELL * noise + 1e-9) {
      double delay = around + reach * (k - STEPS) / STEPS;
      sum += delay;
      count += 1;
      first = fmin(first, delay);
      last = delay;
    }
  }
  self->timed[flash] = least < WRONG * WRONG && last - first <= TIMED_TO * reach / REACH_FRAMES;
  self->delay_s[flash] = least < WRONG * WRONG ? fmax(sum / count, 0) : around;
}

static void time_changes(recording *self, double around, double frame_s) {
  double reach = REACH_FRAMES * frame_s;
  for (int i = 0; i < self->flashes; i++) {
    self->delay_s[i] = around;
  }
  double noise = noise_of(self, reach);
  for (int pass = 0; pass < 2; pass++) {
    for (int i = 1; i < self->flashes; i++) {
      double change = self->shown_s[i] + around;
      bool seen = change - reach > self->first_s && change + reach < self->frame[self->frames - 1].start_s;
      if (seen && self->level[i] != self->level[i - 1]) {
        time_change(self, i, around, reach, noise);
      }
    }
  }
}

static void summarise(const recording *self, const clt_shots *shots, double around, clt_latency *out) {
  double sum = 0, squares = 0;
  out->earliest_s = INFINITY;
  for (int i = 1; i < self->flashes; i++) {
    if (self->timed[i]) {
      sum += self->delay_s[i];
      out->earliest_s = fmin(out->earliest_s, self->delay_s[i]);
      out->latest_s = fmax(out->latest_s, self->delay_s[i]);
      out->changes++;
    }
  }
  out->seconds = sum / fmax(out->changes, 1);
  if (out->changes < ENOUGH_CHANGES) {
    double shut_s = fmax(out->frame_s - self->frame[0].length_s, 0), either_s = fmax(out->uncertain_s, 0.5 * shut_s);
    out->seconds = around;
    out->earliest_s = fmax(around - either_s, 0);
    out->latest_s = around + either_s;
  }
  out->bin_first_s = out->earliest_s;
  out->bin_s = fmax((out->latest_s - out->earliest_s) / CLT_LATENCY_BINS, 1e-4);
  for (int i = 1; i < self->flashes && out->changes >= ENOUGH_CHANGES; i++) {
    if (self->timed[i]) {
      int bin = (int)((self->delay_s[i] - out->bin_first_s) / out->bin_s);
      out->histogram[bin < CLT_LATENCY_BINS ? bin : CLT_LATENCY_BINS - 1]++;
      squares += (self->delay_s[i] - out->seconds) * (self->delay_s[i] - out->seconds);
    }
  }
  out->jitter_s = sqrt(squares / fmax(out->changes - 1, 1));
  out->complete_s = out->latest_s + 0.25 * shots->panel.refresh_s;
  squares = 0;
  for (int f = 0; f < self->frames; f++) {
    double off = departure(self, &self->frame[f]);
    out->wrong += fabs(off) > WRONG;
    squares += off * off;
  }
  out->misfit = sqrt(squares / self->frames);
  out->frames = self->frames;
}

static double median_frame(const recording *self) {
  double steps[FRAMES_MAX];
  for (int f = 1; f < self->frames; f++) {
    steps[f - 1] = self->frame[f].start_s - self->frame[f - 1].start_s;
  }
  clt_sort_doubles(steps, (size_t)self->frames - 1);
  return steps[(self->frames - 1) / 2];
}

static clt_status evaluate(recording *self, const clt_shots *shots, const clt_latency_options *options,
                           clt_latency *out, clt_error *error) {
  out->frame_s = median_frame(self);
  self->first_s = self->shown_s[0] + options->longest_s;
  double around = best_delay(self, options->longest_s, &out->uncertain_s);
  if (!(self->bright - self->dark > LEAST_STEP)) {
    return clt_fail(
        error, CLT_FAILED,
        "the camera does not see the flashes: bright and dark differ by %.2g of full scale; is the projector "
        "on, and its delay below %.3g s?",
        self->bright - self->dark, options->longest_s);
  }
  time_changes(self, around, out->frame_s);
  summarise(self, shots, around, out);
  if (out->wrong > out->frames / 3) {
    return clt_fail(
        error, CLT_FAILED,
        "no one delay explains what the camera saw: of %ld frames %ld do not fit, %ld repeat the one before "
        "and %ld are missing; check the camera's connection and its time stamps",
        out->frames, out->wrong, out->duplicates, out->lost);
  }
  return CLT_OK;
}

static void judge(const clt_latency *latency, clt_findings *findings) {
  double all = (double)(latency->frames + latency->lost);
  if ((double)latency->lost > 0.01 * all) {
    clt_findings_add(
        findings, false,
        "the camera lost %ld of %.0f frames: give it a port of its own, or a smaller picture or frame rate",
        latency->lost, all);
  }
  if (latency->duplicates > 0) {
    clt_findings_add(findings, true, "%ld of %ld frames repeat the one before: check the camera's cable and port",
                     latency->duplicates, latency->frames);
  }
  if (latency->wrong > 0) {
    clt_findings_add(
        findings, true,
        "%ld of %ld frames do not show what was there at their time: they are torn or late; reserve a patch "
        "and verify exposures",
        latency->wrong, latency->frames);
  }
  if (latency->latest_s - latency->earliest_s > latency->frame_s) {
    clt_findings_add(
        findings, false,
        "the latency varies from %.1f to %.1f ms: switch the projector to game mode, frame interpolation off",
        latency->earliest_s * 1e3, latency->latest_s * 1e3);
  }
}

clt_status clt_latency_measure(clt_shots *shots, const clt_latency_options *options, clt_latency *out,
                               clt_findings *findings, clt_error *error) {
  clt_latency_options whole = *options;
  whole.flashes = whole.flashes > 0 ? whole.flashes : 64;
  whole.longest_s = whole.longest_s > 0 ? whole.longest_s : 0.5;
  whole.exposure_s = whole.exposure_s > 0 ? whole.exposure_s : shots->sensor.frame_s;
  *out = (clt_latency){0};
  if (whole.flashes < 8 || whole.flashes > FLASHES_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%d flashes; legal are 8 to %d", whole.flashes, FLASHES_MAX);
  }
  recording *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for timing %d flashes", whole.flashes);
  }
  clt_status status = record(shots, self, &whole, out, error);
  status = status == CLT_OK ? evaluate(self, shots, &whole, out, error) : status;
  if (status == CLT_OK) {
    judge(out, findings);
  }
  free(self);
  return status;
}
