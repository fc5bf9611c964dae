/* counterlight bench: what this machine makes of products and frames. */
#include "counterlight/bench.h"

#include <stdio.h>

#include "cli/command.h"

static const cli_option options[] = {
    {"frames", 0, "N", "of the moving picture (10..100000; default 120)"},
    {"target-error", 0, "X", "that every solve is stopped at (default 0.01)"},
    {"no-scaling", 0, NULL, "leave out the grids from 8 thousand to 2 million cells"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Measures in one run how fast memory is read, each product beside that, frames of a moving picture, the report's\n"
    "iteration over compressed rows and other methods for one of those frames, and how the time of a frame grows with\n"
    "the grid. Without T.h5 it takes a diffuse room in closed form of 512 x 256 cells. The errors are by T as stored.\n"
    "docs/performance.md says what the figures mean. Other programs that run meanwhile are measured too.\n";

static json_t *kernels_json(const clt_bench_report *report) {
  json_t *all = json_array();
  for (int k = 0; k < report->kernel_count; k++) {
    const clt_bench_kernel *kernel = &report->kernel[k];
    json_array_append_new(all, json_pack("{s:s, s:f, s:f, s:f, s:f}", "name", kernel->name, "bytes", kernel->bytes,
                                         "bytes_per_cell", kernel->bytes / (double)report->frame.cells, "ms",
                                         kernel->ms, "fraction", kernel->fraction));
  }
  return all;
}

static json_t *frame_json(const clt_bench_frame *frame) {
  return json_pack("{s:I, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:i, s:{s:f, s:f, s:f}}", "cells",
                   (json_int_t)frame->cells, "channels", frame->channels, "p50_ms", frame->p50_ms, "p99_ms",
                   frame->p99_ms, "error", frame->error, "residual", frame->residual, "clipped", frame->clipped,
                   "cold_ms", frame->cold_ms, "steps", frame->steps, "stage_ms", "prepare",
                   frame->stage_ms[CLT_LIVE_PREPARE], "solve", frame->stage_ms[CLT_LIVE_SOLVE], "estimate",
                   frame->stage_ms[CLT_LIVE_ESTIMATE]);
}

static json_t *peers_json(const clt_bench_report *report) {
  json_t *all = json_array();
  for (int k = 0; k < report->peer_count; k++) {
    const clt_bench_peer *peer = &report->peer[k];
    json_t *one = json_pack("{s:s, s:b}", "name", peer->name, "converged", peer->converged);
    if (peer->converged) {
      json_object_update_new(one, json_pack("{s:f, s:f, s:f, s:f, s:f, s:i}", "ms", peer->ms, "warm_ms", peer->warm_ms,
                                            "error", peer->error, "ratio", peer->ratio, "warm_ratio", peer->warm_ratio,
                                            "entries", peer->entries));
    }
    json_array_append_new(all, one);
  }
  return all;
}

static json_t *scaling_json(const clt_bench_report *report) {
  json_t *points = json_array();
  for (int k = 0; k < report->point_count; k++) {
    json_array_append_new(points, json_pack("{s:f, s:f}", "cells", report->point[k].cells, "ms", report->point[k].ms));
  }
  return json_pack("{s:o, s:o}", "exponent", report->point_count > 1 ? json_real(report->exponent) : json_null(),
                   "points", points);
}

static void print_peer(const clt_bench_peer *peer) {
  if (!peer->converged) {
    printf("%-22s does not converge with this transport\n", peer->name);
    return;
  }
  printf("%-22s %8.1f ms from nothing (%.0f x), %.1f ms warm (%.0f x), %.2f %% off", peer->name, peer->ms, peer->ratio,
         peer->warm_ms, peer->warm_ratio, 100 * peer->error);
  if (peer->entries > 0) {
    printf(", %d entries a row", peer->entries);
  }
  printf("\n");
}

static void print_frame(const char *name, const clt_bench_frame *frame) {
  printf("%-11s %zu cells x %d: %.2f ms (median), %.2f ms (99 %%), %.2f ms from nothing, at most %d steps\n", name,
         frame->cells, frame->channels, frame->p50_ms, frame->p99_ms, frame->cold_ms, frame->steps);
  printf("            prepare %.2f, solve %.2f, estimate %.2f ms; residual %.2f %%, estimated error %.2f %%",
         frame->stage_ms[CLT_LIVE_PREPARE], frame->stage_ms[CLT_LIVE_SOLVE], frame->stage_ms[CLT_LIVE_ESTIMATE],
         100 * frame->residual, 100 * frame->error);
  printf(", %.0f %% of cells at 0 or 1\n", 100 * frame->clipped);
}

static void print_report(const clt_bench_report *report) {
  printf("memory      %.1f GB/s read\n", report->bandwidth_gbs);
  for (int k = 0; k < report->kernel_count; k++) {
    const clt_bench_kernel *kernel = &report->kernel[k];
    printf("%-22s %8.1f MB (%.0f B a cell) %9.3f ms %4.0f %% of the read\n", kernel->name, 1e-6 * kernel->bytes,
           kernel->bytes / (double)report->frame.cells, kernel->ms, 100 * kernel->fraction);
  }
  print_frame("frames", &report->frame);
  print_frame("frames held", &report->held);
  for (int k = 0; k < report->peer_count; k++) {
    print_peer(&report->peer[k]);
  }
  for (int k = 0; k < report->point_count; k++) {
    printf("%9.0f cells %9.2f ms a frame\n", report->point[k].cells, report->point[k].ms);
  }
  if (report->point_count > 1) {
    printf("exponent    %.2f\n", report->exponent);
  }
}

static int answer(const cli_arguments *arguments, const clt_bench_report *report) {
  if (arguments->json) {
    return cli_print_json(json_pack("{s:f, s:o, s:o, s:o, s:o, s:o}", "bandwidth_gbs", report->bandwidth_gbs, "kernels",
                                    kernels_json(report), "frame", frame_json(&report->frame), "held",
                                    frame_json(&report->held), "peers", peers_json(report), "scaling",
                                    scaling_json(report)));
  }
  if (!arguments->quiet) {
    print_report(report);
  }
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  enum { WIDTH = 512, HEIGHT = 256, BLOCKS = 32 };
  clt_bench_options asked = {.scaling = cli_value(command, arguments, "no-scaling") == NULL};
  clt_bench_report report;
  clt_transport *transport = NULL;
  clt_error error = {0};
  clt_status status = cli_integer(command, arguments, "frames", 10, 100000, &asked.frames, &error);
  if (!status) {
    status = cli_number(command, arguments, "target-error", 1e-6, 0.5, &asked.target_error, &error);
  }
  if (!status) {
    status = arguments->positional_count > 0 ? clt_transport_load(arguments->positional[0], &transport, &error)
                                             : clt_bench_room(WIDTH, HEIGHT, BLOCKS, 1, &transport, &error);
  }
  if (!status) {
    status = clt_bench(transport, &asked, &report, &error);
  }
  clt_transport_destroy(transport);
  return status ? cli_fail(command, &error) : answer(arguments, &report);
}

const cli_command cli_command_bench = {
    .name = "bench",
    .synopsis = "[T.h5] [options]",
    .summary = "how fast products and frames are on this machine",
    .options = options,
    .positional_least = 0,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
