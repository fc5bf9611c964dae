/* Products beside a plain read of memory, turn by turn, so that whatever else the machine does strikes both. */
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "solve/live.h"
#include "tradeoff/bench/bench.h"

enum { REPEATS = 9, KERNELS = 4, READ_BYTES = 1 << 27 };

typedef struct trial {
  uint64_t *words; /* READ_BYTES of them, more than caches hold */
  double *x, *y;   /* channels x cells */
  double times[KERNELS + 1][REPEATS];
} trial;

uint64_t clt_bench_read(const uint64_t *words, size_t count) {
  enum { LANES = 16 };
  uint64_t whole = 0;
#pragma omp parallel reduction(+ : whole)
  {
    const size_t threads = (size_t)omp_get_num_threads(), me = (size_t)omp_get_thread_num(), blocks = count / LANES;
    uint64_t lane[LANES] = {0};
    for (size_t k = blocks * me / threads; k < blocks * (me + 1) / threads; k++) {
      for (size_t l = 0; l < LANES; l++) {
        lane[l] += words[k * LANES + l];
      }
    }
    for (size_t l = 0; l < LANES; l++) {
      whole += lane[l];
    }
  }
  return whole;
}

static void transposed_all(const clt_transport *transport, const double *y, double *x) {
  const clt_transport_info info = clt_transport_describe(transport);
  for (int c = 0; c < info.channels; c++) {
    clt_transport_apply_transposed(transport, c, y + (size_t)c * info.rows, x + (size_t)c * info.cols);
  }
}

/* Returns the sum that was read, so that no compiler leaves the reading out. */
static uint64_t run_turn(trial *own, const clt_transport *transport, const clt_transport *hierarchy, int turn) {
  int64_t since_ns = clt_clock_ns();
  const uint64_t sum = clt_bench_read(own->words, READ_BYTES / sizeof *own->words);
  own->times[KERNELS][turn] = clt_clock_since(since_ns);
  since_ns = clt_clock_ns();
  clt_transport_apply_all(transport, own->x, own->y);
  own->times[0][turn] = clt_clock_since(since_ns);
  since_ns = clt_clock_ns();
  transposed_all(transport, own->y, own->x);
  own->times[1][turn] = clt_clock_since(since_ns);
  if (hierarchy != NULL) {
    since_ns = clt_clock_ns();
    clt_transport_apply_all(hierarchy, own->x, own->y);
    own->times[2][turn] = clt_clock_since(since_ns);
    since_ns = clt_clock_ns();
    transposed_all(hierarchy, own->y, own->x);
    own->times[3][turn] = clt_clock_since(since_ns);
  }
  return sum;
}

static void tell(clt_bench_report *report, const char *what, const char *storage, double bytes, double seconds) {
  clt_bench_kernel *kernel = &report->kernel[report->kernel_count++];
  snprintf(kernel->name, sizeof kernel->name, "%s%s%s", what, storage[0] != 0 ? " " : "", storage);
  kernel->bytes = bytes;
  kernel->ms = 1e3 * seconds;
  kernel->fraction = 1e-9 * bytes / seconds / report->bandwidth_gbs;
}

/* What a product reads and writes: T, and a vector on either side. */
static double bytes_of(const clt_transport_info *info) {
  return (double)info->bytes + (double)info->channels * (double)(info->rows + info->cols) * sizeof(double);
}

static clt_status measure(trial *own, const clt_transport *transport, clt_bench_report *report, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  clt_transport *hierarchy = NULL;
  clt_status status =
      strcmp(info.storage, "blocks") == 0 ? clt_transport_create_hierarchy(transport, 5e-3, &hierarchy, error) : CLT_OK;
  uint64_t sum = 0;
  for (int turn = 0; status == CLT_OK && turn < REPEATS; turn++) {
    for (size_t at = 0; at < (size_t)info.channels * info.cols; at++) {
      own->x[at] = 0.5;
    }
    sum += run_turn(own, transport, hierarchy, turn);
  }
  if (status == CLT_OK && sum == 0) {
    report->bandwidth_gbs = 1e-9 * READ_BYTES / clt_bench_median(own->times[KERNELS], REPEATS);
    tell(report, "T x", info.storage, bytes_of(&info), clt_bench_median(own->times[0], REPEATS));
    tell(report, "T' y", info.storage, bytes_of(&info), clt_bench_median(own->times[1], REPEATS));
  }
  if (status == CLT_OK && hierarchy != NULL) {
    const clt_transport_info made = clt_transport_describe(hierarchy);
    tell(report, "T x", made.storage, bytes_of(&made), clt_bench_median(own->times[2], REPEATS));
    tell(report, "T' y", made.storage, bytes_of(&made), clt_bench_median(own->times[3], REPEATS));
  }
  clt_transport_destroy(hierarchy);
  return status;
}

/* The passes that frames are made of, each after a frame. */
static clt_status measure_passes(trial *own, const clt_transport *transport, const clt_certificate *certificate,
                                 clt_bench_report *report, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  const size_t values = (size_t)info.channels * info.cols;
  float *target = clt_alloc(values, 2 * sizeof *target);
  double seconds[CLT_LIVE_PASSES][REPEATS];
  clt_live_pass pass[CLT_LIVE_PASSES];
  clt_live *live = NULL;
  clt_live_result result;
  bool has_passes = true;
  clt_status status = target != NULL ? clt_live_create(transport, certificate, NULL, &live, error)
                                     : clt_fail(error, CLT_FAILED, "no memory for frames of %zu cells", info.cols);
  for (int turn = 0; status == CLT_OK && has_passes && turn < REPEATS; turn++) {
    clt_bench_picture(transport, turn, CLT_BENCH_WITHIN, own->x, own->y, target);
    status = clt_live_solve(live, target, target + values, &result, error);
    has_passes = status == CLT_OK && clt_live_time_passes(live, target, pass);
    for (size_t k = 0; has_passes && k < CLT_LIVE_PASSES; k++) {
      seconds[k][turn] = pass[k].seconds;
    }
  }
  for (size_t k = 0; status == CLT_OK && has_passes && k < CLT_LIVE_PASSES; k++) {
    tell(report, pass[k].name, "", pass[k].bytes, clt_bench_median(seconds[k], REPEATS));
  }
  clt_live_destroy(live);
  free(target);
  return status;
}

clt_status clt_bench_kernels(const clt_transport *transport, const clt_certificate *certificate,
                             clt_bench_report *report, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  const size_t values = (size_t)info.channels * info.cols;
  trial own = {.words = clt_alloc(READ_BYTES, 1), .x = clt_alloc(values, 2 * sizeof(double))};
  own.y = own.x + values;
  clt_status status = own.words != NULL && own.x != NULL
                          ? CLT_OK
                          : clt_fail(error, CLT_FAILED, "no memory for products of %zu cells", info.cols);
  if (status == CLT_OK) {
    memset(own.words, 0, READ_BYTES); /* so that every page is there */
    status = measure(&own, transport, report, error);
  }
  if (status == CLT_OK) {
    status = measure_passes(&own, transport, certificate, report, error);
  }
  free(own.words);
  free(own.x);
  return status;
}
