/* Every method in every storage, tolerance after tolerance, within the time that there is. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/memory.h"
#include "base/order.h"
#include "solve/method.h"
#include "tradeoff/front.h"
#include "tradeoff/judge.h"

static const double DEFAULT_SECONDS = 45;
static const double BEST_SHARE = 0.3; /* of the time, at most, for the best drive in 0..1 */
static const double HELD_MOST = 2e9;  /* bytes that a converted T may take */
enum { POINTS_MOST = 1024, GAPS_MOST = 256, REPEATS_MOST = 5 };

/* At which solves stop. In storage that errs by more than the finest ask for, those would tell nothing more. */
static const double TOLERANCES[] = {0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6};
static const double COARSE_TOLERANCES[] = {0.1, 0.01, 1e-3, 1e-4};
enum {
  TOLERANCE_COUNT = sizeof TOLERANCES / sizeof TOLERANCES[0],
  COARSE_COUNT = sizeof COARSE_TOLERANCES / sizeof COARSE_TOLERANCES[0]
};

/* A method in a storage. */
typedef struct series {
  const char *method, *storage; /* storage NULL: as given */
} series;

typedef struct work {
  const clt_tradeoff_options *options;
  clt_judge judge;
  clt_tradeoff *out;
  series list[256];
  int count, done;
  int64_t start_ns;
  double budget_s;
  double *drive;
  clt_transport *converted; /* to `storage`; NULL: none is */
  const char *storage;
} work;

static void note_gap(work *of, const series *at, const char *format, ...) CLT_PRINTF(3, 4);
static void note_gap(work *of, const series *at, const char *format, ...) {
  if (of->out->gap_count == GAPS_MOST) {
    return;
  }
  clt_tradeoff_gap *gap = &of->out->gaps[of->out->gap_count++];
  va_list arguments;
  snprintf(gap->method, sizeof gap->method, "%s", at->method);
  snprintf(gap->storage, sizeof gap->storage, "%s", at->storage != NULL ? at->storage : of->judge.info.storage);
  va_start(arguments, format);
  vsnprintf(gap->why, sizeof gap->why, format, arguments);
  va_end(arguments);
}

/* What this series may take of the time that is left: its even share. */
static double share_s(const work *of) {
  return fmax(of->budget_s - clt_clock_since(of->start_ns), 0) / fmax(of->count - of->done, 1);
}

/* True for those that keep the entries of T in a form of their own, whatever T is stored in. */
static bool keeps_entries(const char *name) {
  const clt_method *method = clt_method_find(name);
  return method != NULL && method->apart;
}

static bool keeps_bounds(const char *name) {
  const clt_method *method = clt_method_find(name);
  return method == NULL || method->bounded; /* NULL: auto */
}

/* Adds a series. One that the certificate refuses is noted instead, once for every storage. */
static void add_series(work *of, const char *method, const char *storage) {
  series added = {method, storage};
  clt_solve_options options = {.method = method};
  clt_forecast foretold = {.possible = true};
  clt_forecast_solve(of->judge.transport, of->judge.certificate, &options, &foretold, NULL);
  if (foretold.possible) {
    of->list[of->count++] = added;
  } else if (storage == NULL) {
    note_gap(of, &added, "%s", foretold.why_not);
  }
}

static void add_products(work *of, const char *storage) {
  add_series(of, "auto", storage);
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    if (!keeps_entries(clt_method_name(m))) {
      add_series(of, clt_method_name(m), storage);
    }
  }
}

/* False, with a note, where T would be too large so stored. */
static bool fits(work *of, const char *storage) {
  const clt_transport_info *info = &of->judge.info;
  double entry = strcmp(storage, "dense64") == 0 ? 8 : strcmp(storage, "dense") == 0 ? 4 : 2;
  double bytes = entry * (double)info->channels * (double)info->rows * (double)info->cols;
  if (bytes > HELD_MOST) {
    note_gap(of, &(series){"every method", storage}, "T would take %.1f GB", 1e-9 * bytes);
  }
  return bytes <= HELD_MOST;
}

/* T as given first, then converted; last those that keep entries, which may need long to be made ready. */
static void list_series(work *of) {
  static const char *const few[] = {"auto", "damped", "chebyshev", "pcg", "gmres", "bounded"};
  for (size_t i = 0; of->options->brief && i < sizeof few / sizeof few[0]; i++) {
    add_series(of, few[i], NULL);
  }
  if (of->options->brief) {
    return;
  }
  add_products(of, NULL);
  for (size_t s = 0; clt_transport_storage_name(s) != NULL; s++) {
    const char *storage = clt_transport_storage_name(s);
    if (strcmp(storage, of->judge.info.storage) != 0 && fits(of, storage)) {
      add_products(of, storage);
    }
  }
  for (size_t m = 0; clt_method_name(m) != NULL; m++) {
    if (keeps_entries(clt_method_name(m))) {
      add_series(of, clt_method_name(m), NULL);
    }
  }
}

/* Solves again while that takes no more than `allowed_s`, and takes the median time. */
static clt_status repeat(work *of, clt_solver *solver, double allowed_s, clt_solve_result *result,
                         clt_tradeoff_point *point, clt_error *error) {
  double times[REPEATS_MOST];
  int64_t start_ns = clt_clock_ns();
  clt_status status = CLT_OK;
  do {
    status = clt_solver_run(solver, of->judge.wanted, NULL, of->drive, result, error);
    times[point->repeats++] = result->method_seconds;
  } while (status == CLT_OK && point->repeats < REPEATS_MOST &&
           clt_clock_since(start_ns) * (point->repeats + 1) / point->repeats < allowed_s);
  clt_sort_doubles(times, (size_t)point->repeats);
  point->seconds = times[point->repeats / 2];
  return status;
}

/* The drive x of a point, for who wants to check it: before it is cut to 0..1. */
static clt_status keep_drive(const work *of, size_t number, clt_error *error) {
  char name[40], path[CLT_PATH_MAX];
  clt_image image = {0};
  const clt_transport_info *info = &of->judge.info;
  snprintf(name, sizeof name, "drive-%zu.npy", number);
  clt_status status = clt_file_join(of->options->drives, name, path, error);
  status = status == CLT_OK ? clt_image_init(&image, info->channels, info->height, info->width, error) : status;
  for (size_t i = 0; status == CLT_OK && i < of->judge.values; i++) {
    image.data[i] = (float)of->drive[i];
  }
  status = status == CLT_OK ? clt_image_write(path, NULL, &image, error) : status;
  clt_image_finish(&image);
  return status;
}

/* One solve of a series. *again is false where finer tolerances are of no use. */
static clt_status solve_point(work *of, const series *at, double tolerance, double allowed_s, bool *again,
                              clt_error *error) {
  const clt_transport *stored = of->converted != NULL ? of->converted : of->judge.transport;
  clt_solve_options options = {.method = at->method, .tolerance = tolerance};
  clt_solve_result result = {0};
  clt_solver *solver = NULL;
  clt_error refusal = {0};
  clt_tradeoff_point point = {.tolerance = tolerance};
  if (clt_solver_create(stored, of->judge.certificate, &options, &solver, &refusal) != CLT_OK) {
    note_gap(of, at, "%s", refusal.message);
    *again = false;
    return CLT_OK;
  }
  clt_status status = repeat(of, solver, allowed_s, &result, &point, error);
  clt_solver_destroy(solver);
  if (status != CLT_OK) {
    return status;
  }
  if (keeps_bounds(at->method) || strcmp(result.method, at->method) == 0) {
    snprintf(point.method, sizeof point.method, "%s", at->method);
    snprintf(point.storage, sizeof point.storage, "%s", clt_transport_describe(stored).storage);
    point.iterations = result.iterations;
    point.prepare_seconds = result.prepare_seconds;
    clt_judge_drive(&of->judge, stored, of->drive, keeps_bounds(at->method), &point);
    status = of->options->drives != NULL ? keep_drive(of, of->out->count, error) : CLT_OK;
    of->out->points[of->out->count++] = point;
  } else {
    note_gap(of, at, "at %.0e: %s", tolerance, result.reason);
  }
  *again = result.converged && of->out->count < POINTS_MOST;
  return status;
}

/* False, with a note, where what is foretold does not fit into the time. */
static bool has_time(work *of, const series *at, double tolerance, double left_s) {
  const clt_transport *stored = of->converted != NULL ? of->converted : of->judge.transport;
  clt_solve_options options = {.method = at->method, .tolerance = tolerance};
  clt_forecast foretold;
  if (clt_forecast_solve(stored, of->judge.certificate, &options, &foretold, NULL) != CLT_OK || !foretold.possible) {
    return true; /* the refusal says why */
  }
  double needed = foretold.prepare_seconds + foretold.seconds;
  if (needed <= left_s || of->out->count == 0) { /* one point there is, however long it takes */
    return true;
  }
  note_gap(of, at, "tolerances of %.0e and below would take about %.2g s, more than its share of the time", tolerance,
           needed);
  return false;
}

static clt_status measure_series(work *of, const series *at, clt_error *error) {
  bool coarse = of->options->brief || of->converted != NULL;
  const double *tolerances = coarse ? COARSE_TOLERANCES : TOLERANCES;
  int count = coarse ? COARSE_COUNT : TOLERANCE_COUNT;
  double share = share_s(of);
  int64_t start_ns = clt_clock_ns();
  bool again = true;
  clt_status status = CLT_OK;
  for (int t = 0; t < count && again && status == CLT_OK; t++) {
    double left = share - clt_clock_since(start_ns);
    again = has_time(of, at, tolerances[t], left);
    status = again ? solve_point(of, at, tolerances[t], left / (count - t), &again, error) : status;
  }
  return status;
}

/* Turns to the storage of a series; false, with a note, where it cannot be had. */
static bool take_storage(work *of, const series *at) {
  clt_error why = {0};
  if (of->storage == at->storage && (at->storage == NULL || of->converted != NULL)) {
    return true;
  }
  clt_transport_destroy(of->converted);
  of->converted = NULL;
  of->storage = at->storage;
  if (at->storage == NULL || clt_transport_convert(of->judge.transport, at->storage, &of->converted, &why) == CLT_OK) {
    return true;
  }
  note_gap(of, at, "%s", why.message);
  return false;
}

static clt_status tell_progress(const work *of, const series *at, clt_error *error) {
  char what[48];
  snprintf(what, sizeof what, "%s, %s", at->method, at->storage != NULL ? at->storage : of->judge.info.storage);
  bool goes_on =
      of->options->progress == NULL || of->options->progress(of->options->context, what, of->done, of->count);
  return goes_on ? CLT_OK : clt_fail(error, CLT_CANCELLED, "interrupted; nothing was written");
}

static clt_status measure_all(work *of, clt_error *error) {
  clt_status status = CLT_OK;
  for (; of->done < of->count && status == CLT_OK; of->done++) {
    const series *at = &of->list[of->done];
    status = tell_progress(of, at, error);
    if (status == CLT_OK && take_storage(of, at)) {
      status = measure_series(of, at, error);
    }
  }
  if (status == CLT_OK && of->out->count == 0) {
    status = clt_fail(error, CLT_FAILED, "nothing could be measured: %s",
                      of->out->gap_count > 0 ? of->out->gaps[0].why : "no method serves this transport");
  }
  return status;
}

static clt_status check_options(const clt_tradeoff_options *options, clt_error *error) {
  const struct {
    const char *name;
    double value;
  } numbers[] = {{"tolerance", options->tolerance}, {"deadline", options->deadline_s}, {"time", options->seconds}};
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
    if (!(numbers[i].value >= 0) || !isfinite(numbers[i].value)) {
      return clt_fail(error, CLT_BAD_INPUT, "the %s %g is not a positive number; use one, or 0 for the default",
                      numbers[i].name, numbers[i].value);
    }
  }
  return CLT_OK;
}

static clt_status begin(work *of, const clt_transport *transport, const clt_certificate *certificate,
                        const clt_image *picture, clt_error *error) {
  clt_tradeoff *out = of->out;
  clt_status status = clt_judge_init(&of->judge, transport, certificate, picture, &of->options->white,
                                     BEST_SHARE * of->budget_s, error);
  if (status != CLT_OK) {
    return status;
  }
  *out = (clt_tradeoff){.width = of->judge.info.width,
                        .height = of->judge.info.height,
                        .channels = of->judge.info.channels,
                        .limit = of->judge.limit};
  out->points = clt_alloc(POINTS_MOST, sizeof *out->points);
  out->gaps = clt_alloc(GAPS_MOST, sizeof *out->gaps);
  of->drive = clt_alloc(of->judge.values, sizeof *of->drive);
  return out->points != NULL && out->gaps != NULL && of->drive != NULL
             ? CLT_OK
             : clt_fail(error, CLT_FAILED, "not enough memory for the points of a tradeoff");
}

clt_status clt_tradeoff_measure(const clt_transport *transport, const clt_certificate *certificate,
                                const clt_image *picture, const clt_tradeoff_options *options, clt_tradeoff *out,
                                clt_error *error) {
  static const clt_tradeoff_options DEFAULTS = {.seconds = 0};
  work *of = clt_alloc(1, sizeof *of);
  *out = (clt_tradeoff){0};
  if (of == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a tradeoff");
  }
  of->out = out;
  of->options = options != NULL ? options : &DEFAULTS;
  of->start_ns = clt_clock_ns();
  of->budget_s = of->options->seconds > 0 ? of->options->seconds : DEFAULT_SECONDS;
  clt_status status = check_options(of->options, error);
  if (status == CLT_OK) {
    status = begin(of, transport, certificate, picture, error);
  }
  if (status == CLT_OK) {
    list_series(of);
    status = measure_all(of, error);
  }
  if (status == CLT_OK) {
    status = clt_front_mark(out, error);
  }
  if (status == CLT_OK) {
    status = clt_front_tell(out, of->options, error);
  }
  clt_judge_finish(&of->judge);
  clt_transport_destroy(of->converted);
  free(of->drive);
  free(of);
  if (status != CLT_OK) {
    clt_tradeoff_finish(out);
  }
  return status;
}

void clt_tradeoff_finish(clt_tradeoff *tradeoff) {
  free(tradeoff->points);
  free(tradeoff->gaps);
  *tradeoff = (clt_tradeoff){0};
}
