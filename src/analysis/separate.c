/* Direct and global light by shifted checkerboards.
 *
 * Under squares of level L with a share a of the cells on, a cell shows
 *   on:  b0 + L (direct + a global)      off:  b0 + L a global
 * where global light is smooth at the size of the squares (Nayar et al. 2006, eq. 5; b0 holds what the projector's
 * black adds). Sums over patterns of the cells well inside a square give both. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"
#include "counterlight/analysis.h"

enum { SQUARE_FINE = 2, SQUARE_COARSE = 4, SQUARE_MAX = 16, REPEATS_MAX = 64 };
static const double FINE_CONTRAST = 0.98; /* of the coarse squares': below that fine ones are blurred */

/* Sums of radiance and variance of one kind of observation, per value of the grid. */
typedef struct tally {
  double *radiance, *variance, *active; /* active: share of cells on in the patterns counted */
  int *count;
} tally;

typedef struct separator {
  clt_rig *rig;
  clt_rig_info info;
  clt_separation_options options;
  int margin;
  size_t values;
  clt_image drive, radiance, deviation;
  tally black, flood, on, off;
  double *pool;
  int *counts;
  long done, total;
  double active_sum;
} separator;

static clt_status read_options(separator *s, clt_error *error) {
  clt_separation_options *o = &s->options;
  o->step = o->step != 0 ? o->step : o->square > 1 && o->square % 2 == 0 ? o->square / 2 : 1;
  o->repeats = o->repeats != 0 ? o->repeats : 1;
  o->level = o->level != 0 ? o->level : 1;
  if (o->square < 1 || o->square > SQUARE_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "squares of %d cells were asked for; 1 to %d", o->square, SQUARE_MAX);
  }
  if (o->step < 1 || o->square % o->step != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "a step of %d does not divide the squares' %d cells", o->step, o->square);
  }
  if (o->repeats < 1 || o->repeats > REPEATS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%d repeats were asked for; 1 to %d", o->repeats, REPEATS_MAX);
  }
  if (!(o->level > 0 && o->level <= 1)) {
    return clt_fail(error, CLT_BAD_INPUT, "the drive level %g is not above 0 and up to 1", o->level);
  }
  s->rig->operations->describe(s->rig, &s->info);
  if (s->info.width < 2 * o->square || s->info.height < o->square) {
    return clt_fail(error, CLT_BAD_INPUT, "a grid of %d x %d cells is too small for squares of %d; take smaller ones",
                    s->info.width, s->info.height, o->square);
  }
  s->margin = (o->square - o->step) / 2;
  s->total = (long)o->repeats * (2 + (2L * o->square / o->step) * (o->square / o->step));
  return CLT_OK;
}

static tally lay_out(const separator *s, size_t index) {
  double *numbers = s->pool + 3 * index * s->values;
  return (tally){numbers, numbers + s->values, numbers + 2 * s->values, s->counts + index * s->values};
}

static clt_status prepare(separator *s, clt_error *error) {
  const clt_rig_info *info = &s->info;
  s->values = (size_t)info->channels * (size_t)info->height * (size_t)info->width;
  clt_image *images[] = {&s->drive, &s->radiance, &s->deviation};
  for (int i = 0; i < 3; i++) {
    clt_status status = clt_image_init(images[i], info->channels, info->height, info->width, error);
    if (status != CLT_OK) {
      return status;
    }
  }
  s->pool = clt_alloc(4 * s->values, 3 * sizeof *s->pool);
  s->counts = clt_alloc(4 * s->values, sizeof *s->counts);
  if (s->pool == NULL || s->counts == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to separate the light of %zu cells", s->values);
  }
  s->black = lay_out(s, 0);
  s->flood = lay_out(s, 1);
  s->on = lay_out(s, 2);
  s->off = lay_out(s, 3);
  return CLT_OK;
}

static clt_status observe(separator *s, clt_error *error) {
  clt_status status = s->rig->operations->observe(s->rig, &s->drive, &s->radiance, &s->deviation, error);
  s->done++;
  if (status == CLT_OK && s->options.progress != NULL && !s->options.progress(s->options.context, s->done, s->total)) {
    status = clt_fail(error, CLT_CANCELLED, "separating direct and global light was cancelled");
  }
  return status;
}

static void count_value(const separator *s, tally *into, size_t at, double active) {
  double deviation = s->deviation.data[at];
  if (isfinite(deviation)) {
    into->radiance[at] += s->radiance.data[at];
    into->variance[at] += deviation * deviation;
    into->active[at] += active;
    into->count[at]++;
  }
}

/* One drive everywhere. */
static clt_status observe_even(separator *s, double level, tally *into, clt_error *error) {
  for (size_t i = 0; i < s->values; i++) {
    s->drive.data[i] = (float)level;
  }
  clt_status status = CLT_OK;
  for (int n = 0; n < s->options.repeats && status == CLT_OK; n++) {
    status = observe(s, error);
    for (size_t i = 0; i < s->values && status == CLT_OK; i++) {
      count_value(s, into, i, level > 0);
    }
  }
  return status;
}

/* Cells from a line to its nearest edge of a square, 0 beside it. */
static int from_edge(int position, int square) {
  int within = position % square;
  return within < square - 1 - within ? within : square - 1 - within;
}

/* Puts the checkerboard shifted by (sx, sy) into drive; the share of cells that are on. */
static double draw(separator *s, int sx, int sy) {
  int square = s->options.square, width = s->info.width, height = s->info.height;
  size_t cells = (size_t)width * (size_t)height, on = 0;
  for (int y = 0; y < height; y++) {
    for (int x = 0; x < width; x++) {
      bool lit = ((x + sx) / square + (y + sy) / square) % 2 == 0;
      on += lit;
      for (int c = 0; c < s->info.channels; c++) {
        s->drive.data[(size_t)c * cells + (size_t)y * (size_t)width + (size_t)x] = lit ? (float)s->options.level : 0;
      }
    }
  }
  return (double)on / (double)cells;
}

static void count_pattern(separator *s, int sx, int sy, double active) {
  int square = s->options.square, width = s->info.width, height = s->info.height;
  for (size_t i = 0; i < s->values; i++) {
    int x = (int)(i % (size_t)width), y = (int)(i / (size_t)width % (size_t)height);
    if (from_edge(x + sx, square) >= s->margin && from_edge(y + sy, square) >= s->margin) {
      count_value(s, s->drive.data[i] > 0 ? &s->on : &s->off, i, active);
    }
  }
  s->active_sum += active;
}

static clt_status observe_patterns(separator *s, clt_error *error) {
  clt_status status = CLT_OK;
  int square = s->options.square, step = s->options.step, patterns = 0;
  for (int sy = 0; sy < square; sy += step) {
    for (int sx = 0; sx < 2 * square; sx += step, patterns++) {
      double active = draw(s, sx, sy);
      for (int n = 0; n < s->options.repeats && status == CLT_OK; n++) {
        status = observe(s, error);
        if (status == CLT_OK) {
          count_pattern(s, sx, sy, active);
        }
      }
    }
  }
  s->active_sum /= (double)patterns * s->options.repeats;
  return status;
}

/* Mean, and the variance of the mean. */
static void mean_of(const tally *of, size_t at, double *mean, double *variance) {
  double count = of->count[at];
  *mean = of->radiance[at] / count;
  *variance = of->variance[at] / (count * count);
}

/* direct = (on - off) / L, global = (off - b0) / (a L). The share a is that of the off patterns; where the on ones had
 * another one (odd grids), their global light differs by that much. */
static void split(const separator *s, size_t at, clt_separation *out) {
  double black, on, off, black_variance, on_variance, off_variance, level = s->options.level;
  mean_of(&s->black, at, &black, &black_variance);
  mean_of(&s->on, at, &on, &on_variance);
  mean_of(&s->off, at, &off, &off_variance);
  double off_share = s->off.active[at] / s->off.count[at];
  double on_share = s->on.active[at] / s->on.count[at];
  double global = (off - black) / (off_share * level);
  out->global.data[at] = (float)global;
  out->direct.data[at] = (float)((on - off) / level - (on_share - off_share) * global);
  out->global_deviation.data[at] = (float)(sqrt(off_variance + black_variance) / (off_share * level));
  out->direct_deviation.data[at] = (float)(sqrt(on_variance + off_variance) / level);
}

/* The flood against direct + global, and what noise would make of that. */
static void close_sum(const separator *s, clt_separation *out) {
  double rest = 0, noise = 0, whole = 0;
  for (size_t i = 0; i < s->values; i++) {
    if (!isfinite(out->direct_deviation.data[i]) || s->flood.count[i] == 0) {
      continue;
    }
    double flood, black, flood_variance, black_variance, level = s->options.level;
    mean_of(&s->flood, i, &flood, &flood_variance);
    mean_of(&s->black, i, &black, &black_variance);
    double total = (flood - black) / level, sum = (double)out->direct.data[i] + (double)out->global.data[i];
    double direct = out->direct_deviation.data[i], global = out->global_deviation.data[i];
    rest += (sum - total) * (sum - total);
    noise += (flood_variance + black_variance) / (level * level) + direct * direct + global * global;
    whole += total * total;
  }
  out->closure = whole > 0 ? sqrt(rest / whole) : 0;
  out->closure_noise = whole > 0 ? sqrt(noise / whole) : 0;
}

static clt_status conclude(const separator *s, clt_separation *out, clt_error *error) {
  clt_image *images[] = {&out->direct, &out->global, &out->direct_deviation, &out->global_deviation};
  for (int i = 0; i < 4; i++) {
    clt_status status = clt_image_init(images[i], s->info.channels, s->info.height, s->info.width, error);
    if (status != CLT_OK) {
      return status;
    }
  }
  out->active = s->active_sum;
  out->patterns = s->done;
  for (size_t i = 0; i < s->values; i++) {
    if (s->black.count[i] > 0 && s->on.count[i] > 0 && s->off.count[i] > 0 && s->off.active[i] > 0) {
      split(s, i, out);
    } else {
      out->unseen++;
      out->direct_deviation.data[i] = out->global_deviation.data[i] = INFINITY;
    }
  }
  close_sum(s, out);
  return CLT_OK;
}

/* With squares of one size. *done counts on over several. */
static clt_status separate_by(clt_rig *rig, const clt_separation_options *options, long *done, long total,
                              clt_separation *out, clt_error *error) {
  separator s = {.rig = rig, .options = *options, .done = *done};
  *out = (clt_separation){.square = options->square};
  clt_status status = read_options(&s, error);
  s.total = total > 0 ? total : s.total;
  if (status == CLT_OK) {
    status = prepare(&s, error);
  }
  if (status == CLT_OK) {
    status = observe_even(&s, 0, &s.black, error);
  }
  if (status == CLT_OK) {
    status = observe_even(&s, s.options.level, &s.flood, error);
  }
  if (status == CLT_OK) {
    status = observe_patterns(&s, error);
  }
  if (status == CLT_OK) {
    status = conclude(&s, out, error);
  }
  *done = s.done;
  clt_image_finish(&s.drive);
  clt_image_finish(&s.radiance);
  clt_image_finish(&s.deviation);
  free(s.pool);
  free(s.counts);
  if (status != CLT_OK) {
    clt_separation_finish(out);
  }
  return status;
}

/* Median of fine / coarse direct light over cells where that stands out of the noise; 1 where none does. */
static clt_status compare_contrast(const clt_separation *fine, const clt_separation *coarse, double *contrast,
                                   clt_error *error) {
  size_t values = clt_image_size(&fine->direct), count = 0;
  double *ratio = clt_alloc(values, sizeof *ratio);
  if (ratio == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to separate the light of %zu cells", values);
  }
  for (size_t i = 0; i < values; i++) {
    double direct = coarse->direct.data[i];
    if (direct > 5 * (double)coarse->direct_deviation.data[i] && isfinite(fine->direct_deviation.data[i])) {
      ratio[count++] = fine->direct.data[i] / direct;
    }
  }
  clt_sort_doubles(ratio, count);
  *contrast = count > 0 ? ratio[count / 2] : 1;
  free(ratio);
  return CLT_OK;
}

/* Fine squares tell rough global light apart, coarse ones stand blur: both are observed. */
static clt_status separate_by_both(clt_rig *rig, const clt_separation_options *options, clt_separation *out,
                                   clt_error *error) {
  clt_separation fine, coarse;
  clt_separation_options both = *options;
  long done = 0, total = (options->repeats != 0 ? options->repeats : 1) * 2L * (2 + 2 * 2 * 2);
  double contrast = 1;
  both.square = SQUARE_FINE;
  clt_status status = separate_by(rig, &both, &done, total, &fine, error);
  if (status != CLT_OK) {
    return status;
  }
  both.square = SQUARE_COARSE;
  status = separate_by(rig, &both, &done, total, &coarse, error);
  if (status == CLT_OK) {
    status = compare_contrast(&fine, &coarse, &contrast, error);
  }
  bool sharp = contrast >= FINE_CONTRAST;
  if (status == CLT_OK) {
    *out = sharp ? fine : coarse;
    out->patterns = done;
    out->contrast = contrast;
  }
  if (status != CLT_OK || !sharp) {
    clt_separation_finish(&fine);
  }
  if (status != CLT_OK || sharp) {
    clt_separation_finish(&coarse);
  }
  return status;
}

clt_status clt_separate(clt_rig *rig, const clt_separation_options *options, clt_separation *out, clt_error *error) {
  clt_separation_options chosen = options != NULL ? *options : (clt_separation_options){0};
  clt_rig_info info;
  long done = 0;
  *out = (clt_separation){0};
  rig->operations->describe(rig, &info);
  if (chosen.square != 0) {
    return separate_by(rig, &chosen, &done, 0, out, error);
  }
  if (chosen.step != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "a step of %d was asked for without a size of squares; give both",
                    chosen.step);
  }
  if (info.width >= 2 * SQUARE_COARSE && info.height >= SQUARE_COARSE) {
    return separate_by_both(rig, &chosen, out, error);
  }
  chosen.square = SQUARE_FINE;
  return separate_by(rig, &chosen, &done, 0, out, error);
}

void clt_separation_finish(clt_separation *separation) {
  if (separation != NULL) {
    clt_image_finish(&separation->direct);
    clt_image_finish(&separation->global);
    clt_image_finish(&separation->direct_deviation);
    clt_image_finish(&separation->global_deviation);
    *separation = (clt_separation){0};
  }
}
