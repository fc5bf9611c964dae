#include "tradeoff/front.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const double ENOUGH = 1.05;    /* times the least expected error: nearer than that nobody sees */
static const double INVISIBLE = 1e-3; /* an error below the steps of a panel of 8 bits */

double clt_tradeoff_expected(const clt_tradeoff_point *point) {
  return hypot(point->error, fmax(point->noise_error, 0));
}

void clt_front_time(double seconds, char text[24]) {
  if (seconds < 1) {
    snprintf(text, 24, seconds < 9.95e-3 ? "%.2g ms" : "%.3g ms", 1e3 * seconds);
  } else {
    snprintf(text, 24, "%.3g s", seconds);
  }
}

void clt_front_share(double share, char text[24]) {
  snprintf(text, 24, "%.2g %%", 100 * share);
}

/* Sorted by time, then by error. */
typedef struct entry {
  double seconds, error;
  size_t index;
} entry;

static int compare_entries(const void *left, const void *right) {
  const entry *a = left, *b = right;
  if (a->seconds != b->seconds) {
    return a->seconds < b->seconds ? -1 : 1;
  }
  return (a->error > b->error) - (a->error < b->error);
}

/* The points by rising time; NULL where memory is short. Freed by the caller. */
static entry *sort_points(const clt_tradeoff *tradeoff) {
  entry *entries = clt_alloc(tradeoff->count + 1, sizeof *entries);
  for (size_t k = 0; entries != NULL && k < tradeoff->count; k++) {
    entries[k] = (entry){tradeoff->points[k].seconds, tradeoff->points[k].error, k};
  }
  if (entries != NULL) {
    qsort(entries, tradeoff->count, sizeof *entries, compare_entries);
  }
  return entries;
}

clt_status clt_front_mark(clt_tradeoff *tradeoff, clt_error *error) {
  entry *entries = sort_points(tradeoff);
  double least = INFINITY;
  if (entries == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to sort %zu points", tradeoff->count);
  }
  for (size_t k = 0; k < tradeoff->count; k++) {
    tradeoff->points[entries[k].index].front = entries[k].error < least;
    least = fmin(least, entries[k].error);
  }
  free(entries);
  return CLT_OK;
}

size_t clt_front_list(const clt_tradeoff *tradeoff, size_t *order) {
  size_t count = 0;
  for (size_t k = 0; k < tradeoff->count; k++) {
    size_t at = count;
    if (!tradeoff->points[k].front) {
      continue;
    }
    for (; at > 0 && tradeoff->points[order[at - 1]].seconds > tradeoff->points[k].seconds; at--) {
      order[at] = order[at - 1];
    }
    order[at] = k;
    count++;
  }
  return count;
}

/* The front falls as time rises: its first point within the error is the fastest. */
static const clt_tradeoff_point *fastest_within(const clt_tradeoff *tradeoff, const size_t *order, size_t count,
                                                double most) {
  for (size_t k = 0; k < count; k++) {
    if (tradeoff->points[order[k]].error <= most) {
      return &tradeoff->points[order[k]];
    }
  }
  return NULL;
}

static void choose_by_tolerance(clt_tradeoff *tradeoff, const size_t *order, size_t count, double tolerance) {
  const clt_tradeoff_point *found = fastest_within(tradeoff, order, count, tolerance);
  char asked[24];
  clt_front_share(tolerance, asked);
  tradeoff->chosen = found != NULL ? (size_t)(found - tradeoff->points) : order[count - 1];
  snprintf(tradeoff->chosen_why, sizeof tradeoff->chosen_why,
           found != NULL ? "the fastest within %s" : "none comes within %s: this one comes nearest", asked);
}

static void choose_by_deadline(clt_tradeoff *tradeoff, const size_t *order, size_t count, double deadline_s) {
  char asked[24];
  size_t last = 0;
  clt_front_time(deadline_s, asked);
  while (last + 1 < count && tradeoff->points[order[last + 1]].seconds <= deadline_s) {
    last++;
  }
  bool found = tradeoff->points[order[last]].seconds <= deadline_s;
  tradeoff->chosen = order[last];
  snprintf(tradeoff->chosen_why, sizeof tradeoff->chosen_why,
           found ? "the nearest within %s" : "none is done within %s: this one is the fastest", asked);
}

static void choose_enough(clt_tradeoff *tradeoff, const size_t *order, size_t count) {
  double least = INFINITY;
  size_t k = 0;
  for (size_t i = 0; i < count; i++) {
    least = fmin(least, clt_tradeoff_expected(&tradeoff->points[order[i]]));
  }
  while (clt_tradeoff_expected(&tradeoff->points[order[k]]) > fmax(ENOUGH * least, INVISIBLE)) {
    k++;
  }
  tradeoff->chosen = order[k];
  snprintf(tradeoff->chosen_why, sizeof tradeoff->chosen_why, "more time makes no visible difference");
}

static void add_text(char *text, const char *format, ...) CLT_PRINTF(2, 3);
static void add_text(char *text, const char *format, ...) {
  size_t used = strlen(text);
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text + used, CLT_TRADEOFF_SENTENCE_MAX - used, format, arguments);
  va_end(arguments);
}

/* What keeps the nearest point from coming nearer. */
static void tell_limit(clt_tradeoff *tradeoff, const clt_tradeoff_point *nearest) {
  char level[24];
  bool noisy = nearest->noise_error >= nearest->error;
  bool bounded = nearest->clipping_error >= fmax(nearest->storage_error, nearest->solver_error);
  bool stored = nearest->storage_error > nearest->solver_error;
  clt_front_share(noisy ? nearest->noise_error : nearest->error, level);
  add_text(tradeoff->sentence, "below %s %s", level,
           noisy     ? "the camera's noise is the limit"
           : bounded ? "no drive between 0 and 1 comes"
           : stored  ? "the precision in which T is stored is the limit"
                     : "nothing came that was measured");
}

/* Level number k of 1, 1/2, 1/5, 1/10, ..., or of the powers of ten only. */
static double level_of(int k, bool coarse) {
  static const double steps[] = {1, .5, .2};
  return coarse ? pow(10, -k) : pow(10, -(k / 3)) * steps[k % 3];
}

static void tell_level(clt_tradeoff *tradeoff, double level, const clt_tradeoff_point *point) {
  char share[24], time[24];
  clt_front_share(level, share);
  clt_front_time(point->seconds, time);
  add_text(tradeoff->sentence, "%s costs %s; ", share, time);
}

/* Up to three levels of error and what each costs: powers of ten where the front spans enough of them. A point is told
 * at the finest level that it reaches; levels below `floor` mean nothing. */
static void tell_levels(clt_tradeoff *tradeoff, const size_t *order, size_t count, double floor) {
  enum { MOST = 3, LEVELS = 40 };
  const clt_tradeoff_point *first = &tradeoff->points[order[0]];
  bool coarse = first->error >= 30 * fmax(tradeoff->points[order[count - 1]].error, floor);
  int told = 0;
  for (int k = 0; k < LEVELS && told < MOST && level_of(k, coarse) >= floor; k++) {
    double next = level_of(k + 1, coarse);
    const clt_tradeoff_point *found = fastest_within(tradeoff, order, count, level_of(k, coarse));
    const clt_tradeoff_point *finer = next >= floor ? fastest_within(tradeoff, order, count, next) : NULL;
    if (found != NULL && found != finer) {
      tell_level(tradeoff, level_of(k, coarse), found);
      told++;
    }
  }
  if (told == 0) {
    tell_level(tradeoff, first->error, first);
  }
}

clt_status clt_front_tell(clt_tradeoff *tradeoff, const clt_tradeoff_options *options, clt_error *error) {
  size_t *order = clt_alloc(tradeoff->count + 1, sizeof *order);
  if (order == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to sort %zu points", tradeoff->count);
  }
  size_t count = clt_front_list(tradeoff, order);
  const clt_tradeoff_point *nearest = &tradeoff->points[order[count - 1]];
  if (options->tolerance > 0) {
    choose_by_tolerance(tradeoff, order, count, options->tolerance);
  } else if (options->deadline_s > 0) {
    choose_by_deadline(tradeoff, order, count, options->deadline_s);
  } else {
    choose_enough(tradeoff, order, count);
  }
  tradeoff->noise = nearest->noise_error;
  tradeoff->sentence[0] = '\0';
  tell_levels(tradeoff, order, count, fmax(nearest->noise_error, 0));
  tell_limit(tradeoff, nearest);
  free(order);
  return CLT_OK;
}
