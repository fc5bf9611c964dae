/* What accuracy costs in time, on one transport and one picture: every method, in every storage of T, stopped at
 * tolerance after tolerance; how long each took, how far the picture is then off, and why.
 *
 * With b = target - b0, T the transport as given, T~ as stored for the solve, x what the method answered and x' = x cut
 * to 0..1, what is seen differs from the target by
 *
 *   T x' - b  =  (T~ x - b)  +  (T - T~) x  +  T (x' - x)              solver, storage, clipping
 *
 * for a method that knows no bounds. One that keeps 0..1 has x' = x and is measured from the best such drive x*:
 *
 *   T x - b  =  (T~ x - T x*)  +  (T - T~) x  +  (T x* - b)
 *
 * Every part is the norm of its vector over the lit cells of all channels, relative to that of the target (for a black
 * target: of white). The vectors add up to the error's, so the norms bound it from both sides: their sum is at least
 * the error, and the error at least the greatest part less the others. The noise part is that of T itself: entries of
 * standard deviation sigma_i show sigma_i ||x'|| in row i (NUMERICS' law), so that the real room is expected to be off
 * by sqrt(error^2 + noise^2). */
#ifndef COUNTERLIGHT_TRADEOFF_H
#define COUNTERLIGHT_TRADEOFF_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { CLT_TRADEOFF_SENTENCE_MAX = 320 };

/* One solve: relative RMS errors in appearance, all >= 0. */
typedef struct clt_tradeoff_point {
  char method[24];        /* that was asked for */
  char storage[12];       /* of T in the solve */
  double tolerance;       /* relative residual at which it stopped, and for which it prepared */
  int iterations;         /* the most that any channel took */
  int repeats;            /* solves that `seconds` is the median of */
  double seconds;         /* of a solve, preparation and the product for its residual not counted */
  double prepare_seconds; /* once for every picture */
  double error;           /* of what is seen under the transport as given */
  double solver_error, storage_error, clipping_error;
  double noise_error; /* < 0: the transport has no deviations */
  bool front;         /* no other is both faster and nearer */
} clt_tradeoff_point;

/* What was not measured, or not to the end, and why. */
typedef struct clt_tradeoff_gap {
  char method[24], storage[12];
  char why[CLT_MESSAGE_MAX];
} clt_tradeoff_gap;

typedef struct clt_tradeoff {
  int width, height, channels;
  size_t count, gap_count;
  clt_tradeoff_point *points; /* in the order in which they were measured */
  clt_tradeoff_gap *gaps;
  double limit;  /* the least error of any drive in 0..1 */
  double noise;  /* of the nearest point; < 0: not known */
  size_t chosen; /* the point that is recommended; always on the front */
  char chosen_why[120];
  char sentence[CLT_TRADEOFF_SENTENCE_MAX]; /* "1 % costs 2.1 ms; ...": a summary for people */
} clt_tradeoff;

typedef struct clt_tradeoff_options {
  clt_white white;
  double tolerance;   /* > 0: choose the fastest point of at most this error; 0: of what time can buy, all */
  double deadline_s;  /* > 0: choose the nearest point within this time */
  double seconds;     /* to spend, roughly; 0: 45 */
  bool brief;         /* a few methods, T as it is stored, a few tolerances: for a running daemon */
  const char *drives; /* NULL, or an existing folder for the drives x, drive-NUMBER.npy of points[NUMBER] */
  /* Told as the work goes on, `done` of `steps`; false stops (CLT_CANCELLED). NULL: nobody is told. */
  bool (*progress)(void *context, const char *what, int done, int steps);
  void *context;
} clt_tradeoff_options;

/* Measures. picture is linear light on the transport's grid. CLT_BAD_INPUT for options or pictures out of range, for
 * rows != cols and where no cell is lit. What a method refuses is told in `gaps`. */
CLT_PUBLIC clt_status clt_tradeoff_measure(const clt_transport *transport, const clt_certificate *certificate,
                                           const clt_image *picture, const clt_tradeoff_options *options,
                                           clt_tradeoff *out, clt_error *error);
CLT_PUBLIC void clt_tradeoff_finish(clt_tradeoff *tradeoff); /* accepts a zeroed one */

/* Writes tradeoff.csv, tradeoff.svg and tradeoff.html into a folder that exists. */
CLT_PUBLIC clt_status clt_tradeoff_write(const clt_tradeoff *tradeoff, const char *folder, clt_error *error);

/* sqrt(error^2 + noise^2): what the real room is expected to be off by. */
CLT_PUBLIC double clt_tradeoff_expected(const clt_tradeoff_point *point);

#ifdef __cplusplus
}
#endif
#endif
