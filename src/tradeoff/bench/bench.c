/* The bench as a whole, and how time grows with the grid. */
#include "tradeoff/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/order.h"

double clt_bench_median(double *times, size_t count) {
  clt_sort_doubles(times, count);
  return times[count / 2];
}

/* One grid of a room in closed form. */
static clt_status measure_point(int width, int height, const clt_bench_options *options, clt_bench_point *point,
                                clt_error *error) {
  enum { BLOCKS = 8, FRAMES = 15 };
  clt_transport *room = NULL;
  clt_certificate *certificate = NULL;
  clt_bench_frame frame;
  const clt_bench_options brief = {.frames = FRAMES, .target_error = options->target_error};
  clt_status status = clt_bench_room(width, height, BLOCKS, 1, &room, error);
  if (status == CLT_OK) {
    status = clt_certify(room, &certificate, error);
  }
  if (status == CLT_OK) {
    status = clt_bench_frames(room, certificate, &brief, CLT_BENCH_WITHIN, &frame, error);
  }
  if (status == CLT_OK) {
    *point = (clt_bench_point){(double)width * height, frame.p50_ms};
  }
  clt_certificate_destroy(certificate);
  clt_transport_destroy(room);
  return status;
}

/* The slope of log ms over log cells. */
static double fit_exponent(const clt_bench_point *points, int count) {
  double x = 0, y = 0, xx = 0, xy = 0;
  for (int k = 0; k < count; k++) {
    const double a = log(points[k].cells), b = log(points[k].ms);
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
  }
  const double spread = count * xx - x * x;
  return spread > 0 ? (count * xy - x * y) / spread : 0;
}

static clt_status measure_scaling(const clt_bench_options *options, clt_bench_report *report, clt_error *error) {
  static const int SIDE[][2] = {{128, 64}, {256, 128}, {512, 256}, {1024, 512}, {2048, 1024}};
  clt_status status = CLT_OK;
  for (size_t k = 0; status == CLT_OK && k < sizeof SIDE / sizeof SIDE[0]; k++) {
    status = measure_point(SIDE[k][0], SIDE[k][1], options, &report->point[report->point_count++], error);
  }
  report->exponent = fit_exponent(report->point, report->point_count);
  return status;
}

typedef struct method_run {
  clt_solver *solver;
  double *drive, *start, *wanted; /* channels x cells */
  float *target;
} method_run;

/* Frames of the moving picture, from nothing and from the drive of the frame before. */
static clt_status run_method(method_run *own, const clt_transport *transport, clt_bench_peer *peer, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  double ms[2][CLT_BENCH_TURNS];
  clt_status status = CLT_OK;
  peer->converged = true;
  for (int k = 0; status == CLT_OK && peer->converged && k < 2 * CLT_BENCH_TURNS; k++) {
    const bool warm = k >= CLT_BENCH_TURNS;
    clt_solve_result result;
    memcpy(own->start, own->drive, (size_t)info.channels * info.cols * sizeof *own->start);
    clt_bench_picture(transport, warm ? k + 1 - CLT_BENCH_TURNS : 0, CLT_BENCH_WITHIN, own->drive, own->wanted,
                      own->target);
    status = clt_solver_run(own->solver, own->wanted, warm ? own->start : NULL, own->drive, &result, error);
    ms[warm][k % CLT_BENCH_TURNS] = 1e3 * result.seconds;
    peer->error = warm ? peer->error : result.residual;
    peer->converged = result.converged;
  }
  peer->ms = clt_bench_median(ms[0], CLT_BENCH_TURNS);
  peer->warm_ms = clt_bench_median(ms[1], CLT_BENCH_TURNS);
  return status;
}

/* What the table of methods takes, beside the report's iteration. */
static clt_status measure_method(const clt_transport *transport, const clt_certificate *certificate, const char *method,
                                 const clt_bench_options *options, clt_bench_peer *peer, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  const size_t values = (size_t)info.channels * info.cols;
  method_run own = {.drive = clt_alloc(values, 3 * sizeof *own.drive), .target = clt_alloc(values, sizeof *own.target)};
  own.start = own.drive + values;
  own.wanted = own.drive + 2 * values;
  const clt_solve_options asked = {.method = method, .tolerance = options->target_error, .together = true};
  snprintf(peer->name, sizeof peer->name, "%s-%s", method, info.storage);
  clt_status status = own.drive != NULL && own.target != NULL
                          ? clt_solver_create(transport, certificate, &asked, &own.solver, error)
                          : clt_fail(error, CLT_FAILED, "no memory for a solve of %zu cells", info.cols);
  if (status == CLT_OK) {
    status = run_method(&own, transport, peer, error);
  }
  clt_solver_destroy(own.solver);
  free(own.drive);
  free(own.target);
  return status;
}

static clt_status measure_peers(const clt_transport *transport, const clt_certificate *certificate,
                                const clt_bench_options *options, clt_bench_report *report, clt_error *error) {
  clt_status status =
      clt_bench_jacobi(transport, certificate, options->target_error, &report->peer[report->peer_count++], error);
  static const char *const METHODS[] = {"gmres", "bounded"};
  for (size_t k = 0; status == CLT_OK && k < 2; k++) {
    status = measure_method(transport, certificate, METHODS[k], options, &report->peer[report->peer_count++], error);
  }
  for (int k = 0; status == CLT_OK && k < report->peer_count; k++) {
    clt_bench_peer *peer = &report->peer[k];
    peer->ratio = peer->converged ? peer->ms / report->frame.cold_ms : 0;
    peer->warm_ratio = peer->converged ? peer->warm_ms / report->frame.p50_ms : 0;
  }
  return status;
}

clt_status clt_bench(const clt_transport *transport, const clt_bench_options *options, clt_bench_report *report,
                     clt_error *error) {
  enum { FRAMES = 120, FRAMES_LEAST = 10, FRAMES_MOST = 100000 };
  clt_bench_options asked = options != NULL ? *options : (clt_bench_options){0};
  clt_certificate *certificate = NULL;
  *report = (clt_bench_report){0};
  asked.frames = asked.frames != 0 ? asked.frames : FRAMES;
  asked.target_error = asked.target_error != 0 ? asked.target_error : 0.01;
  if (asked.frames < FRAMES_LEAST || asked.frames > FRAMES_MOST) {
    return clt_fail(error, CLT_BAD_INPUT, "%d frames; a bench takes %d..%d", asked.frames, FRAMES_LEAST, FRAMES_MOST);
  }
  clt_status status = clt_certify(transport, &certificate, error);
  if (status == CLT_OK && !clt_certificate_any_lit(certificate)) {
    status = clt_fail(error, CLT_BAD_INPUT, "no cell of the transport is lit, so that there is nothing to compensate");
  }
  if (status == CLT_OK) {
    status = clt_bench_kernels(transport, certificate, report, error);
  }
  if (status == CLT_OK) {
    status = clt_bench_frames(transport, certificate, &asked, CLT_BENCH_WITHIN, &report->frame, error);
  }
  if (status == CLT_OK) {
    status = clt_bench_frames(transport, certificate, &asked, CLT_BENCH_BEYOND, &report->held, error);
  }
  if (status == CLT_OK) {
    status = measure_peers(transport, certificate, &asked, report, error);
  }
  if (status == CLT_OK && asked.scaling) {
    status = measure_scaling(&asked, report, error);
  }
  clt_certificate_destroy(certificate);
  return status;
}
