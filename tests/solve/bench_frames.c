/* What a frame of 1920 x 1080 content costs with a transport, stage by stage: medians and the 99th percentile of frames
 * that move, fade and cut, and the encoder for projectors that do not encode by themselves. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "counterlight/device.h"
#include "counterlight/frames.h"
#include "counterlight/scene.h"

enum { WIDTH = 1920, HEIGHT = 1080, FRAMES = 120, SCENE = 40, MEASURES = CLT_FRAMES_STAGES + 2 };

static const char *const names[MEASURES] = {"mean", "map", "solve", "fields", "frame", "encode"};

static void need(clt_status status, const clt_error *error) {
  if (status != CLT_OK) {
    fprintf(stderr, "%s\n", error->message);
    exit(EXIT_FAILURE);
  }
}

static double now_ms(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

/* A disc over a ground that fades. */
static void draw(int frame, uint8_t *content) {
  double at = frame % SCENE / (double)SCENE, fade = 0.6 + 0.4 * cos(6.283 * at);
  for (int y = 0; y < HEIGHT; y++) {
    for (int x = 0; x < WIDTH; x++) {
      bool inside = hypot(x - at * WIDTH, y - 0.5 * HEIGHT) < 200;
      uint8_t *pixel = content + ((size_t)y * WIDTH + (size_t)x) * 3;
      pixel[0] = inside ? 230 : (uint8_t)((60 + 40 * (frame / SCENE)) * fade);
      pixel[1] = inside ? 220 : (uint8_t)(110 * fade);
      pixel[2] = inside ? 200 : (uint8_t)((150 - 30 * (frame / SCENE)) * fade);
    }
  }
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static const clt_transport *open_transport(const char *path, clt_transport **loaded, clt_scene **scene) {
  clt_error error = {0};
  if (strstr(path, ".h5") != NULL) {
    need(clt_transport_load(path, loaded, &error), &error);
    return *loaded;
  }
  need(clt_scene_open(path, scene, &error), &error);
  return clt_scene_transport(*scene);
}

/* ms[measure][frame]; the mean error of the frames. */
static double measure(clt_frames *frames, const clt_transport_info *grid, double ms[MEASURES][FRAMES]) {
  size_t cells = 3 * grid->cols;
  uint8_t *content = malloc((size_t)WIDTH * HEIGHT * 3);
  float *fields = malloc(2 * cells * sizeof *fields), *codes = malloc((size_t)WIDTH * HEIGHT * 3 * sizeof *codes);
  clt_error error = {0};
  double sum = 0;
  for (int frame = 0; frame < FRAMES && content != NULL && fields != NULL && codes != NULL; frame++) {
    clt_frames_result result;
    draw(frame, content);
    double start = now_ms();
    need(clt_frames_next(frames, content, WIDTH, HEIGHT, 1.0 / 60, fields, fields + cells, &result, &error), &error);
    ms[CLT_FRAMES_STAGES][frame] = now_ms() - start;
    for (int k = 0; k < CLT_FRAMES_STAGES; k++) {
      ms[k][frame] = result.ms[k];
    }
    clt_live_picture picture = {
        WIDTH,        HEIGHT, content,        grid->width,
        grid->height, fields, fields + cells, .panel = clt_panel_of_curve(&(clt_curve){.kind = CLT_CURVE_SRGB})};
    start = now_ms();
    need(clt_live_encode(&picture, 3, HEIGHT, WIDTH, codes, &error), &error);
    ms[MEASURES - 1][frame] = now_ms() - start;
    sum += result.live.error / FRAMES;
  }
  free(content);
  free(fields);
  free(codes);
  return sum;
}

int main(int count, char **arguments) {
  static double ms[MEASURES][FRAMES];
  clt_transport *loaded = NULL;
  clt_scene *scene = NULL;
  clt_certificate *certificate = NULL;
  clt_frames *frames = NULL;
  clt_error error = {0};
  if (count < 2) {
    fputs("bench_frames T.h5 | SCENE.cfg [BUDGET_MS [reach]]\n", stderr);
    return 2;
  }
  const clt_transport *transport = open_transport(arguments[1], &loaded, &scene);
  clt_transport_info grid = clt_transport_describe(transport);
  clt_frames_options options = {.live = {.target_error = 0.005, .budget_ms = count > 2 ? atof(arguments[2]) : 0},
                                .reach = count > 3};
  need(clt_certify(transport, &certificate, &error), &error);
  need(clt_frames_create(transport, certificate, &options, &frames, &error), &error);
  double off = measure(frames, &grid, ms);
  printf("%d x %d cells, budget %g ms, error %.3f %% by estimate\n", grid.width, grid.height, options.live.budget_ms,
         100 * off);
  for (int k = 0; k < MEASURES; k++) {
    qsort(ms[k], FRAMES, sizeof(double), ascending);
    printf("%-7s median %7.2f ms   99 %% %7.2f ms\n", names[k], ms[k][FRAMES / 2], ms[k][FRAMES * 99 / 100]);
  }
  clt_frames_destroy(frames);
  clt_certificate_destroy(certificate);
  clt_transport_destroy(loaded);
  clt_scene_close(scene);
  return 0;
}
