/* What a scene really shows, by its exact light in double, of the drives that frames find with a T: from nothing to a
 * tenth of a percent, and of a moving picture warm to one percent.
 *
 *   bench_exact SCENE.cfg [T.h5]     (without T.h5 by the scene's own transport) */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "counterlight/live.h"
#include "counterlight/scene.h"

typedef enum picture { SMOOTH, FIELDS, RANDOM, MOVING, HALF, CHECKER, SINGLE, BLACK, PICTURES } picture;
static const char *const names[PICTURES] = {"smooth", "fields of 8 cells, .4..1", "random cells, .4..1", "moving",
                                            "half",   "fields of 8 cells, 0..1",  "a single cell",       "black"};

typedef struct stage {
  clt_scene *scene;
  const clt_transport *transport;
  clt_transport_info info;
  clt_certificate *certificate;
  clt_live *live;
  clt_image drive;
  float *target;
} stage;

static void need(clt_status status, const clt_error *error) {
  if (status != CLT_OK) {
    fprintf(stderr, "%s\n", error->message);
    exit(EXIT_FAILURE);
  }
}

static double level(picture what, size_t x, size_t y, size_t channel, const clt_transport_info *info, int number) {
  const double u = (double)x / info->width + 0.03 * number, v = (double)y / info->height - 0.01 * number;
  const bool odd = (x / 8 + y / 8) % 2 == 1;
  const double all[PICTURES] = {[SMOOTH] = 0.55 + 0.35 * sin(6 * u + (double)channel) * cos(5 * v),
                                [FIELDS] = odd ? 1 : 0.4,
                                [RANDOM] = 0.4 + 0.6 * rand() / RAND_MAX,
                                [MOVING] = 0.5 + 0.3 * sin(13 * u + 2 * (double)channel) * cos(9 * v),
                                [HALF] = u < 0.5,
                                [CHECKER] = odd,
                                [SINGLE] = x == (size_t)info->width * 2 / 5 && y == (size_t)info->height * 2 / 5,
                                [BLACK] = 0};
  return all[what];
}

/* Pictures up to MOVING are what the scene shows of that drive, so that they can be reached; the others are parts of
 * white. */
static void draw(const stage *own, picture what, int number) {
  const size_t values = (size_t)own->info.channels * own->info.cols;
  clt_error error;
  for (size_t at = 0; at < values; at++) {
    const size_t cell = at % own->info.cols, channel = at / own->info.cols;
    const double white = what > MOVING ? clt_certificate_channel(own->certificate, (int)channel)->white : 1;
    own->drive.data[at] = (float)(white * level(what, cell % (size_t)own->info.width, cell / (size_t)own->info.width,
                                                channel, &own->info, number));
  }
  if (what > MOVING) {
    memcpy(own->target, own->drive.data, values * sizeof *own->target);
    return;
  }
  clt_image seen;
  need(clt_scene_appearance(own->scene, &own->drive, &seen, &error), &error);
  memcpy(own->target, seen.data, values * sizeof *own->target);
  clt_image_finish(&seen);
}

/* ||seen - target|| / ||target|| over lit cells; of a black target relative to white. */
static double appearance_error(const stage *own) {
  double apart = 0, size = 0, bright = 0;
  clt_image seen;
  clt_error error;
  need(clt_scene_appearance(own->scene, &own->drive, &seen, &error), &error);
  for (size_t at = 0; at < (size_t)own->info.channels * own->info.cols; at++) {
    const int channel = (int)(at / own->info.cols);
    if (clt_certificate_lit(own->certificate, channel)[at % own->info.cols]) {
      const double target = (double)own->target[at], off = (double)seen.data[at] - target;
      const double white = clt_certificate_channel(own->certificate, channel)->white;
      apart += off * off;
      size += target * target;
      bright += white * white;
    }
  }
  clt_image_finish(&seen);
  return sqrt(apart / (size > 0 ? size : bright));
}

static void show(stage *own, picture what, int number, bool warm) {
  clt_live_result result;
  clt_error error;
  draw(own, what, number);
  if (!warm) {
    clt_live_reset(own->live);
  }
  need(clt_live_solve(own->live, own->target, own->drive.data, &result, &error), &error);
  const double off = appearance_error(own);
  printf("%-26s %8.3f %% off, %8.3f %% told, %8.3f %% by T; %6.2f ms%s\n", names[what], 100 * off, 100 * result.error,
         100 * result.residual, result.total_ms, warm ? ", warm" : "");
}

static void set_up(stage *own, double target_error) {
  const clt_live_options options = {.target_error = target_error};
  clt_error error;
  need(clt_live_create(own->transport, own->certificate, &options, &own->live, &error), &error);
}

static void tear_down(stage *own, clt_transport *loaded) {
  free(own->target);
  clt_image_finish(&own->drive);
  clt_certificate_destroy(own->certificate);
  clt_transport_destroy(loaded);
  clt_scene_close(own->scene);
}

int main(int count, char **arguments) {
  enum { FRAMES = 5 };
  stage own = {0};
  clt_transport *loaded = NULL;
  clt_error error;
  if (count < 2) {
    fputs("bench_exact SCENE.cfg [T.h5]\n", stderr);
    return 2;
  }
  need(clt_scene_open(arguments[1], &own.scene, &error), &error);
  if (count > 2) {
    need(clt_transport_load(arguments[2], &loaded, &error), &error);
  }
  own.transport = loaded != NULL ? loaded : clt_scene_transport(own.scene);
  own.info = clt_transport_describe(own.transport);
  own.target = malloc((size_t)own.info.channels * own.info.cols * sizeof *own.target);
  need(own.target != NULL ? CLT_OK : CLT_FAILED, &(clt_error){.message = "no memory for a target"});
  need(clt_image_init(&own.drive, own.info.channels, own.info.height, own.info.width, &error), &error);
  need(clt_certify(own.transport, &own.certificate, &error), &error);
  set_up(&own, 1e-3);
  for (picture what = SMOOTH; what < PICTURES; what++) {
    show(&own, what, 0, false);
  }
  clt_live_destroy(own.live);
  set_up(&own, 1e-2);
  for (int number = 0; number < FRAMES; number++) {
    show(&own, MOVING, number, number > 0);
  }
  clt_live_destroy(own.live);
  tear_down(&own, loaded);
  return 0;
}
