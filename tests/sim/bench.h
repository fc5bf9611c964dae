/* What the simulator's benchmarks share: a scene from a text, and the time of its photographs. */
#ifndef CLT_TESTS_SIM_BENCH_H
#define CLT_TESTS_SIM_BENCH_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "counterlight/scene.h"

enum { BENCH_REPEATS = 11, BENCH_CHANNELS = 3 };

/* Ends the benchmark where something fails. */
static inline void bench_need(clt_status status, const clt_error *error) {
  if (status != CLT_OK) {
    fprintf(stderr, "%s\n", error->message);
    exit(1);
  }
}

/* Writes the text into a temporary scene file and opens it; *opening_ms: wall time of the opening. */
static inline clt_scene *bench_open(const char *text, double *opening_ms) {
  char path[] = "/tmp/counterlight-bench-XXXXXX";
  clt_error error = {.status = CLT_OK};
  clt_scene *scene = NULL;
  int file = mkstemp(path);
  if (file < 0 || write(file, text, strlen(text)) != (ssize_t)strlen(text)) {
    perror(path);
    exit(1);
  }
  close(file);
  int64_t start_ns = clt_clock_ns();
  clt_status status = clt_scene_open(path, &scene, &error);
  *opening_ms = 1e3 * clt_clock_since(start_ns);
  unlink(path);
  bench_need(status, &error);
  return scene;
}

static inline int bench_compare(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static inline double bench_median(double *values, int count) {
  qsort(values, (size_t)count, sizeof *values, bench_compare);
  return values[count / 2];
}

/* Median wall time of a photograph, ms: a new pattern is shown, and the first frame exposed to it is taken. */
static inline double bench_photograph(clt_scene *scene) {
  clt_error error = {.status = CLT_OK};
  clt_transport_info info = clt_transport_describe(clt_scene_transport(scene));
  size_t values = info.cols * (size_t)info.channels;
  float *codes = malloc(values * sizeof *codes);
  clt_projector *projector = NULL;
  clt_camera *camera = NULL;
  bench_need(clt_scene_open_projector(scene, &projector, &error), &error);
  bench_need(clt_scene_open_camera(scene, &camera, &error), &error);
  double ms[BENCH_REPEATS];
  for (int n = 0; n < BENCH_REPEATS; n++) {
    for (size_t k = 0; k < values; k++) {
      codes[k] = (float)((k * 7919 + (size_t)n * 104729) % 1021) / 1020.0f;
    }
    int64_t shown_ns = 0, start_ns = clt_clock_ns();
    clt_frame frame;
    bench_need(projector->driver->present(projector, codes, &shown_ns, &error), &error);
    bench_need(camera->driver->next(camera, shown_ns + 100000000, 1e5, &frame, &error), &error);
    ms[n] = 1e3 * clt_clock_since(start_ns);
  }
  camera->driver->close(camera);
  projector->driver->close(projector);
  free(codes);
  return bench_median(ms, BENCH_REPEATS);
}

#endif
