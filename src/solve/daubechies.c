#include "solve/daubechies.h"

#include <math.h>
#include <string.h>

/* h, and g_k = (-1)^k h_(3-k) (Daubechies 1988): (1 + sqrt 3, 3 + sqrt 3, 3 - sqrt 3, 1 - sqrt 3) / (4 sqrt 2) */
static const double LOW[4] = {0.48296291314453414, 0.83651630373780790, 0.22414386804201338, -0.12940952255126038};
static const double HIGH[4] = {-0.12940952255126038, -0.22414386804201338, 0.83651630373780790, -0.48296291314453414};
enum { BORDER = 5 }; /* samples that a border takes at most */

static double dot(const double *a, const double *b) {
  double sum = 0;
  for (int t = 0; t < BORDER; t++) {
    sum += a[t] * b[t];
  }
  return sum;
}

static void add(double factor, const double *from, double *to) {
  for (int t = 0; t < BORDER; t++) {
    to[t] += factor * from[t];
  }
}

/* Makes v orthogonal to the first `count` rows (twice, so that it stays so in double) and of length 1; returns what it
 * had. */
static double orthogonalise(double rows[][BORDER], int count, double *v) {
  for (int pass = 0; pass < 2; pass++) {
    for (int k = 0; k < count; k++) {
      add(-dot(rows[k], v), rows[k], v);
    }
  }
  double length = sqrt(dot(v, v));
  for (int t = 0; t < BORDER; t++) {
    v[t] /= length > 0 ? length : 1;
  }
  return length;
}

/* Splits the space of `count` orthonormal rows: out[0..1] span the parts of the two moments in it, the others, where
 * both moments vanish, complete them. */
static void split(double rows[][BORDER], int count, double moments[2][BORDER], double out[][BORDER]) {
  int done = 0;
  for (int k = 0; k < 2 + count && done < count; k++) {
    double v[BORDER] = {0};
    if (k < 2) {
      for (int row = 0; row < count; row++) {
        add(dot(rows[row], moments[k]), rows[row], v);
      }
    } else {
      memcpy(v, rows[k - 2], sizeof v);
    }
    double before = sqrt(dot(v, v)), left = orthogonalise(out, done, v);
    if (left > 1e-6 * before) {
      memcpy(out[done++], v, sizeof v);
    }
  }
}

/* The border at the left: the part of the filters at -2 that stays inside, and those at 0. */
static void fill_left(clt_d4_level *level, const double *constant, const double *linear) {
  double size = hypot(LOW[1], LOW[0]), out[4][BORDER] = {{0}}, moments[2][BORDER] = {{0}};
  double rows[3][BORDER] = {{LOW[1] / size, -LOW[0] / size}};
  memcpy(rows[1], LOW, sizeof LOW);
  memcpy(rows[2], HIGH, sizeof HIGH);
  memcpy(moments[0], constant, 4 * sizeof *constant);
  memcpy(moments[1], linear, 4 * sizeof *linear);
  split(rows, 3, moments, out);
  for (int k = 0; k < 3; k++) {
    memcpy(level->left[k], out[k], sizeof level->left[k]);
  }
}

/* The border at the right: the last inner filters, the part of those behind them that stays inside, and a sample that
 * is over where the count is odd. */
static void fill_right(clt_d4_level *level, const double *constant, const double *linear) {
  double size = hypot(LOW[3], LOW[2]), out[4][BORDER] = {{0}}, moments[2][BORDER] = {{0}};
  double rows[4][BORDER] = {{0, 0, LOW[3] / size, -LOW[2] / size}, {0}, {0}, {0, 0, 0, 0, 1}};
  memcpy(rows[1], LOW, sizeof LOW);
  memcpy(rows[2], HIGH, sizeof HIGH);
  size_t first = 2 * (level->pairs - 1), samples = level->right_samples;
  memcpy(moments[0], constant + first, samples * sizeof *constant);
  memcpy(moments[1], linear + first, samples * sizeof *linear);
  split(rows, (int)samples - 1, moments, out);
  memcpy(level->right, out, sizeof level->right);
}

/* One line of samples to its averages and details; and back. */
static void forward_line(const clt_d4_level *level, const double *in, double *out) {
  size_t pairs = level->pairs, samples = level->right_samples, first = 2 * (pairs - 1);
  double *high = out + level->lows;
  for (size_t k = 0; k < 3; k++) {
    double sum = 0;
    for (size_t t = 0; t < 4; t++) {
      sum += level->left[k][t] * in[t];
    }
    *(k < 2 ? &out[k] : &high[0]) = sum;
  }
  for (size_t k = 1; k + 1 < pairs; k++) {
    const double *at = in + 2 * k;
    out[k + 1] = LOW[0] * at[0] + LOW[1] * at[1] + LOW[2] * at[2] + LOW[3] * at[3];
    high[k] = HIGH[0] * at[0] + HIGH[1] * at[1] + HIGH[2] * at[2] + HIGH[3] * at[3];
  }
  for (size_t k = 0; k + 1 < samples; k++) {
    double sum = 0;
    for (size_t t = 0; t < samples; t++) {
      sum += level->right[k][t] * in[first + t];
    }
    *(k < 2 ? &out[pairs + k] : &high[pairs - 3 + k]) = sum;
  }
}

static void inverse_line(const clt_d4_level *level, const double *in, double *out) {
  size_t pairs = level->pairs, samples = level->right_samples, first = 2 * (pairs - 1);
  const double *high = in + level->lows;
  memset(out, 0, level->count * sizeof *out);
  for (size_t t = 0; t < 4; t++) {
    out[t] += level->left[0][t] * in[0] + level->left[1][t] * in[1] + level->left[2][t] * high[0];
  }
  for (size_t k = 1; k + 1 < pairs; k++) {
    double *at = out + 2 * k;
    for (size_t t = 0; t < 4; t++) {
      at[t] += LOW[t] * in[k + 1] + HIGH[t] * high[k];
    }
  }
  for (size_t k = 0; k + 1 < samples; k++) {
    double value = k < 2 ? in[pairs + k] : high[pairs - 3 + k];
    for (size_t t = 0; t < samples; t++) {
      out[first + t] += level->right[k][t] * value;
    }
  }
}

/* out += factor * in, `count` values. */
static void add_lane(double factor, const double *restrict in, double *restrict out, size_t count) {
  for (size_t i = 0; i < count; i++) {
    out[i] += factor * in[i];
  }
}

/* out = sum of four rows from `in`, `pitch` apart. */
static void combine(const double *taps, const double *restrict in, size_t pitch, double *restrict out, size_t count) {
  for (size_t i = 0; i < count; i++) {
    out[i] = (taps[0] * in[i] + taps[1] * in[pitch + i]) + (taps[2] * in[2 * pitch + i] + taps[3] * in[3 * pitch + i]);
  }
}

/* The same as the lines for `width` columns at once; in has rows `pitch` apart, out rows `width` apart. */
static void forward_columns(const clt_d4_level *level, const double *in, size_t pitch, size_t width, double *out) {
  size_t pairs = level->pairs, samples = level->right_samples, first = 2 * (pairs - 1);
  double *high = out + level->lows * width;
  for (size_t k = 0; k < 3; k++) {
    combine(level->left[k], in, pitch, k < 2 ? out + k * width : high, width);
  }
  for (size_t k = 1; k + 1 < pairs; k++) {
    combine(LOW, in + 2 * k * pitch, pitch, out + (k + 1) * width, width);
    combine(HIGH, in + 2 * k * pitch, pitch, high + k * width, width);
  }
  for (size_t k = 0; k + 1 < samples; k++) {
    double *to = k < 2 ? out + (pairs + k) * width : high + (pairs - 3 + k) * width;
    combine(level->right[k], in + first * pitch, pitch, to, width);
    if (samples > 4) {
      add_lane(level->right[k][4], in + (first + 4) * pitch, to, width);
    }
  }
}

static void inverse_columns(const clt_d4_level *level, const double *in, size_t pitch, size_t width, double *out) {
  size_t pairs = level->pairs, samples = level->right_samples, first = 2 * (pairs - 1);
  const double *high = in + level->lows * pitch;
  memset(out, 0, level->count * width * sizeof *out);
  for (size_t t = 0; t < 4; t++) {
    add_lane(level->left[0][t], in, out + t * width, width);
    add_lane(level->left[1][t], in + pitch, out + t * width, width);
    add_lane(level->left[2][t], high, out + t * width, width);
  }
  for (size_t k = 1; k + 1 < pairs; k++) {
    for (size_t t = 0; t < 4; t++) {
      add_lane(LOW[t], in + (k + 1) * pitch, out + (2 * k + t) * width, width);
      add_lane(HIGH[t], high + k * pitch, out + (2 * k + t) * width, width);
    }
  }
  for (size_t k = 0; k + 1 < samples; k++) {
    const double *from = k < 2 ? in + (pairs + k) * pitch : high + (pairs - 3 + k) * pitch;
    for (size_t t = 0; t < samples; t++) {
      add_lane(level->right[k][t], from, out + (first + t) * width, width);
    }
  }
}

/* The levels of an axis; the two moments go down with the averages. A grid's side is at most 16384 cells. */
static size_t fill_axis(clt_d4_level *levels, size_t count) {
  enum { SIDE_MAX = 16384 };
  double constant[SIDE_MAX], linear[SIDE_MAX], out[SIDE_MAX];
  size_t made = 0;
  for (size_t i = 0; i < count; i++) {
    constant[i] = 1;
    linear[i] = ((double)i + 0.5) / (double)count - 0.5;
  }
  while (count >= CLT_D4_LEAST && made < CLT_D4_LEVELS_MAX) {
    clt_d4_level *level = &levels[made++];
    *level = (clt_d4_level){.count = count, .pairs = count / 2 - 1, .right_samples = 4 + count % 2};
    level->lows = level->pairs + 2;
    fill_left(level, constant, linear);
    fill_right(level, constant, linear);
    forward_line(level, constant, out);
    memcpy(constant, out, level->lows * sizeof *out);
    forward_line(level, linear, out);
    memcpy(linear, out, level->lows * sizeof *out);
    count = level->lows;
  }
  return made;
}

void clt_d4_init(clt_d4 *d4, size_t width, size_t height) {
  *d4 = (clt_d4){.width = width, .height = height};
  d4->across = fill_axis(d4->row, width);
  d4->down = fill_axis(d4->column, height);
  d4->levels = d4->across > d4->down ? d4->across : d4->down;
}

/* What is left of an axis before level k. */
static size_t left_at(const clt_d4_level *levels, size_t made, size_t k, size_t whole) {
  return k < made ? levels[k].count : made > 0 ? levels[made - 1].lows : whole;
}

static void copy_back(const double *from, size_t width, size_t height, double *to, size_t pitch) {
  for (size_t y = 0; y < height; y++) {
    memcpy(to + y * pitch, from + y * width, width * sizeof *to);
  }
}

void clt_d4_forward(const clt_d4 *d4, double *values, double *scratch) {
  for (size_t k = 0; k < d4->levels; k++) {
    size_t width = left_at(d4->row, d4->across, k, d4->width), height = left_at(d4->column, d4->down, k, d4->height);
    for (size_t y = 0; k < d4->across && y < height; y++) {
      forward_line(&d4->row[k], values + y * d4->width, scratch);
      memcpy(values + y * d4->width, scratch, width * sizeof *values);
    }
    if (k < d4->down) {
      forward_columns(&d4->column[k], values, d4->width, width, scratch);
      copy_back(scratch, width, height, values, d4->width);
    }
  }
}

void clt_d4_inverse(const clt_d4 *d4, double *values, double *scratch) {
  for (size_t k = d4->levels; k-- > 0;) {
    size_t width = left_at(d4->row, d4->across, k, d4->width), height = left_at(d4->column, d4->down, k, d4->height);
    if (k < d4->down) {
      inverse_columns(&d4->column[k], values, d4->width, width, scratch);
      copy_back(scratch, width, height, values, d4->width);
    }
    for (size_t y = 0; k < d4->across && y < height; y++) {
      inverse_line(&d4->row[k], values + y * d4->width, scratch);
      memcpy(values + y * d4->width, scratch, width * sizeof *values);
    }
  }
}
