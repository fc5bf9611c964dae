/* Frames at full rate on whatever display there is: how even their times are, and how many refreshes went by without a
 * new one. One line of JSON.
 *
 *   pacing_probe FRAMES */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "device/projector/glfw.h"

enum { WARMING = 60, PICTURES = 2 };

typedef struct pace {
  int frames, told_on_time, seen_on_time;
  double refresh_s, told_s, worst_s; /* a refresh as the mode says; the mean one as told; the longest between returns */
} pace;

/* A frame is on time where the one before it was shown one refresh earlier: by the times that the projector tells, and
 * by the clock when it returned. */
static clt_status count_frames(clt_projector *projector, const float *const codes[PICTURES], int frames, pace *out,
                               clt_error *error) {
  int64_t shown_ns = 0, told_ns = 0, seen_ns = 0, first_ns = 0;
  clt_status status = CLT_OK;
  for (int i = -WARMING; status == CLT_OK && i <= frames; i++) {
    status = projector->driver->present(projector, codes[abs(i) % PICTURES], &shown_ns, error);
    int64_t now_ns = clt_clock_ns();
    if (i == 0) {
      first_ns = shown_ns;
    } else if (i > 0) {
      double told = 1e-9 * (double)(shown_ns - told_ns), seen = 1e-9 * (double)(now_ns - seen_ns);
      out->told_on_time += fabs(told / out->refresh_s - 1) < 0.25;
      out->seen_on_time += fabs(seen / out->refresh_s - 1) < 0.5;
      out->worst_s = fmax(out->worst_s, seen);
    }
    told_ns = shown_ns;
    seen_ns = now_ns;
  }
  out->told_s = 1e-9 * (double)(shown_ns - first_ns) / frames;
  return status;
}

static clt_status run(int frames, clt_error *error) {
  const clt_projector_config config = {.driver = "glfw", .monitor = "auto"};
  clt_projector *projector = NULL;
  clt_projector_info info;
  clt_status status = clt_glfw_open_projector(&config, &projector, error);
  if (status != CLT_OK) {
    return status;
  }
  projector->driver->describe(projector, &info);
  size_t values = (size_t)info.width * (size_t)info.height * (size_t)info.channels;
  float *codes = calloc(PICTURES * values, sizeof *codes);
  const float *const pictures[PICTURES] = {codes, codes + values};
  for (size_t i = 0; codes != NULL && i < PICTURES * values; i++) {
    codes[i] = (float)(i % 251) / 250;
  }
  pace counted = {.frames = frames, .refresh_s = info.refresh_s};
  status = codes == NULL ? clt_fail(error, CLT_FAILED, "not enough memory for two pictures")
                         : count_frames(projector, pictures, frames, &counted, error);
  printf("{\"width\": %d, \"height\": %d, \"refresh_ms\": %.4f, \"frames\": %d, \"told_on_time\": %d, "
         "\"seen_on_time\": %d, "
         "\"told_ms\": %.4f, \"worst_ms\": %.3f}\n",
         info.width, info.height, 1e3 * counted.refresh_s, counted.frames, counted.told_on_time, counted.seen_on_time,
         1e3 * counted.told_s, 1e3 * counted.worst_s);
  projector->driver->close(projector);
  free(codes);
  return status;
}

int main(int argc, char **argv) {
  clt_error error = {0};
  int frames = argc > 1 ? atoi(argv[1]) : 600;
  if (run(frames, &error) != CLT_OK) {
    fprintf(stderr, "pacing_probe: %s\n", error.message);
    return 1;
  }
  return 0;
}
