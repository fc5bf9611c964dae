/* What this machine makes of products and frames: each kernel beside a plain read of memory in the same run, frames of
 * moving pictures, the report's iteration on the same T, and how time grows with the grid. */
#ifndef COUNTERLIGHT_BENCH_H
#define COUNTERLIGHT_BENCH_H

#include "counterlight/live.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { CLT_BENCH_KERNELS = 9, CLT_BENCH_PEERS = 4, CLT_BENCH_POINTS = 8, CLT_BENCH_NAME_MAX = 40 };

typedef struct clt_bench_kernel {
  char name[CLT_BENCH_NAME_MAX];
  double bytes;    /* that it reads and writes, every channel */
  double ms;       /* median of several */
  double fraction; /* of the read bandwidth of the same run */
} clt_bench_kernel;

typedef struct clt_bench_frame {
  size_t cells;
  int channels;
  double cold_ms;                   /* from a drive of 0, median */
  double p50_ms, p99_ms;            /* warm: a picture that moves from frame to frame, with a cut every 40 */
  double stage_ms[CLT_LIVE_STAGES]; /* medians */
  double error, residual;           /* the worst of any frame: the estimate, and of T as stored */
  double clipped;                   /* the most of any frame: lit cells at 0 or 1 */
  int steps;                        /* the most of any frame */
} clt_bench_frame;

typedef struct clt_bench_peer {
  char name[CLT_BENCH_NAME_MAX];
  double ms, warm_ms;       /* of a solve from nothing, and from the answer for the frame before; medians */
  double error;             /* ||T x - b|| / ||b|| of the first, by T as stored */
  double ratio, warm_ratio; /* ms over the frame's cold_ms, warm_ms over its p50_ms */
  int entries;              /* that each row of its matrix keeps; 0: it takes T as stored */
  bool converged;           /* false: it does not come to the end here, and nothing else of it was measured */
} clt_bench_peer;

typedef struct clt_bench_point {
  double cells, ms; /* of a warm frame */
} clt_bench_point;

typedef struct clt_bench_report {
  double bandwidth_gbs;
  int kernel_count, peer_count, point_count;
  clt_bench_kernel kernel[CLT_BENCH_KERNELS];
  clt_bench_frame frame; /* of pictures that T can show */
  clt_bench_frame held;  /* of pictures with more contrast than that: many cells end at 0 or 1 */
  clt_bench_peer peer[CLT_BENCH_PEERS];
  double exponent; /* of ms over cells, by least squares of the logarithms */
  clt_bench_point point[CLT_BENCH_POINTS];
} clt_bench_report;

typedef struct clt_bench_options {
  int frames;          /* of the moving picture, 10..100000; 0 means 120 */
  double target_error; /* of every solve, as in clt_live_options; 0 means 0.01 */
  bool scaling;        /* also measure grids from 8 thousand to 2 million cells (2 GiB of memory, about a minute) */
} clt_bench_options;

/* A diffuse room in closed form, in blocks storage, 3 channels: near light that spills into the next cell, far light
 * that is bilinear over the grid from `blocks` blocks (1..256), half of all light at a full drive. The same seed gives
 * the same room. */
CLT_PUBLIC clt_status clt_bench_room(int width, int height, int blocks, unsigned seed, clt_transport **out,
                                     clt_error *error);
/* Measures with a transport whose rows are its cells. Progress is not told; it takes some seconds. CLT_BAD_INPUT where
 * no cell is lit. */
CLT_PUBLIC clt_status clt_bench(const clt_transport *transport, const clt_bench_options *options,
                                clt_bench_report *report, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
