/* Frames of a moving picture. */
#include <cblas.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "tradeoff/bench/bench.h"

void clt_bench_picture(const clt_transport *transport, int number, double swing, double *drive, double *seen,
                       float *target) {
  const clt_transport_info info = clt_transport_describe(transport);
  const size_t values = (size_t)info.channels * info.cols;
  for (size_t at = 0; at < values; at++) {
    const double x = (double)(at % (size_t)info.width) / info.width + 0.004 * number;
    const double y = (double)(at % info.cols / (size_t)info.width) / info.height - 0.002 * number;
    drive[at] = 0.5 + swing * sin(13 * x + 2 * (double)(at / info.cols)) * cos(9 * y);
  }
  clt_transport_apply_all(transport, drive, seen);
  for (size_t at = 0; at < values; at++) {
    target[at] = fmaxf(0, (float)seen[at] + clt_transport_black(transport, (int)(at / info.cols))[at % info.cols]);
  }
}

typedef struct film {
  clt_live *live;
  double swing;
  double *drive, *seen, *times; /* times: frames, of the whole and of each stage */
  float *target, *answer;
} film;

static clt_status show(film *own, const clt_transport *transport, int number, clt_live_result *result,
                       clt_bench_frame *frame, clt_error *error) {
  clt_bench_picture(transport, number, own->swing, own->drive, own->seen, own->target);
  clt_status status = clt_live_solve(own->live, own->target, own->answer, result, error);
  frame->error = fmax(frame->error, result->error);
  frame->residual = fmax(frame->residual, result->residual);
  frame->clipped = fmax(frame->clipped, result->clipped_fraction);
  frame->steps = result->steps > frame->steps ? result->steps : frame->steps;
  return status;
}

static clt_status start_cold(film *own, const clt_transport *transport, clt_bench_frame *frame, clt_error *error) {
  enum { STARTS = 9 };
  clt_status status = CLT_OK;
  for (int k = 0; status == CLT_OK && k < STARTS; k++) {
    clt_live_result result;
    clt_live_reset(own->live);
    status = show(own, transport, 0, &result, frame, error);
    own->times[k] = result.total_ms;
  }
  frame->cold_ms = clt_bench_median(own->times, STARTS);
  return status;
}

static clt_status move(film *own, const clt_transport *transport, int frames, clt_bench_frame *frame,
                       clt_error *error) {
  enum { SHOT = 40, CUT = 500 }; /* frames of one, and that the next one is ahead */
  const size_t count = (size_t)frames;
  clt_status status = CLT_OK;
  for (size_t k = 0; status == CLT_OK && k < count; k++) {
    clt_live_result result;
    status = show(own, transport, (int)k + 1 + CUT * (int)(k / SHOT), &result, frame, error);
    own->times[k] = result.total_ms;
    for (size_t stage = 0; stage < CLT_LIVE_STAGES; stage++) {
      own->times[(stage + 1) * count + k] = result.ms[stage];
    }
  }
  frame->p50_ms = clt_bench_median(own->times, count);
  frame->p99_ms = own->times[(count * 99 + 99) / 100 - 1];
  for (size_t stage = 0; stage < CLT_LIVE_STAGES; stage++) {
    frame->stage_ms[stage] = clt_bench_median(own->times + (stage + 1) * count, count);
  }
  return status;
}

clt_status clt_bench_frames(const clt_transport *transport, const clt_certificate *certificate,
                            const clt_bench_options *options, double swing, clt_bench_frame *frame, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  const size_t values = (size_t)info.channels * info.cols;
  const clt_live_options asked = {.target_error = options->target_error};
  const int threads = openblas_get_num_threads();
  film own = {.swing = swing,
              .drive = clt_alloc(values, 2 * sizeof(double)),
              .times = clt_alloc((size_t)options->frames, (1 + CLT_LIVE_STAGES) * sizeof(double)),
              .target = clt_alloc_large(values, 2 * sizeof(float))};
  openblas_set_num_threads(1); /* counterlight/live.h */
  own.seen = own.drive + values;
  own.answer = own.target + values;
  *frame = (clt_bench_frame){.cells = info.cols, .channels = info.channels};
  clt_status status = own.drive != NULL && own.times != NULL && own.target != NULL
                          ? clt_live_create(transport, certificate, &asked, &own.live, error)
                          : clt_fail(error, CLT_FAILED, "no memory for frames of %zu cells", info.cols);
  if (status == CLT_OK) {
    status = start_cold(&own, transport, frame, error);
  }
  if (status == CLT_OK) {
    status = move(&own, transport, options->frames, frame, error);
  }
  openblas_set_num_threads(threads);
  clt_live_destroy(own.live);
  free(own.drive);
  free(own.times);
  free(own.target);
  return status;
}
