#include "acquire/watch.h"

#include <math.h>
#include <stdio.h>

#define PATIENCE_DEFAULT_S 30.0
#define DEVIATIONS 6.0
enum { TILES = 16 };

clt_status clt_watch_init(clt_watch *watch, const clt_acquire_options *options, const clt_rig_info *info,
                          clt_error *error) {
  *watch = (clt_watch){.every = options->watch,
                       .patience_s = options->patience_s > 0 ? options->patience_s : PATIENCE_DEFAULT_S};
  clt_image *const images[] = {&watch->drive, &watch->expected, &watch->variance};
  clt_status status = CLT_OK;
  for (size_t i = 0; watch->every > 0 && status == CLT_OK && i < sizeof images / sizeof images[0]; i++) {
    status = clt_image_init(images[i], info->channels, info->height, info->width, error);
  }
  return status;
}

void clt_watch_finish(clt_watch *watch) {
  clt_image_finish(&watch->drive);
  clt_image_finish(&watch->expected);
  clt_image_finish(&watch->variance);
}

/* Sums of the tile's cells from (x0, y0) up to (x1, y1). */
typedef struct tile {
  int channel, x0, y0, x1, y1;
  double light, difference, noise; /* noise is a variance */
} tile;

static void sum_tile(tile *t, const clt_image *expected, const clt_image *variance, const clt_image *seen,
                     const clt_image *deviation) {
  for (int y = t->y0; y < t->y1; y++) {
    for (int x = t->x0; x < t->x1; x++) {
      size_t at = ((size_t)t->channel * (size_t)seen->height + (size_t)y) * (size_t)seen->width + (size_t)x;
      double own = (double)deviation->data[at], noise = own * own + (double)variance->data[at];
      if (isfinite(noise)) {
        t->light += (double)expected->data[at];
        t->difference += (double)seen->data[at] - (double)expected->data[at];
        t->noise += noise;
      }
    }
  }
}

clt_change clt_watch_compare(const clt_image *expected, const clt_image *variance, const clt_image *seen,
                             const clt_image *deviation, double tolerance) {
  int wide = seen->width < TILES ? seen->width : TILES, high = seen->height < TILES ? seen->height : TILES;
  int count = wide * high * seen->channels, changed = 0;
  double most = 0;
  clt_change change = {0};
  for (int k = 0; k < count; k++) {
    int u = k % wide, v = k / wide % high;
    tile t = {.channel = k / (wide * high),
              .x0 = u * seen->width / wide,
              .y0 = v * seen->height / high,
              .x1 = (u + 1) * seen->width / wide,
              .y1 = (v + 1) * seen->height / high};
    sum_tile(&t, expected, variance, seen, deviation);
    double allowed = DEVIATIONS * sqrt(t.noise) + tolerance * fabs(t.light);
    changed += fabs(t.difference) > allowed;
    if (fabs(t.difference) > allowed && fabs(t.difference) - allowed > most) {
      most = fabs(t.difference) - allowed;
      change.x = (t.x0 + t.x1) / 2;
      change.y = (t.y0 + t.y1) / 2;
      change.percent = 100 * t.difference / fmax(fabs(t.light), 1e-3 * fabs(t.difference));
    }
  }
  change.share = (double)changed / count;
  return change;
}

double clt_watch_impossible(const clt_image *white, const clt_image *variance, const clt_image *seen,
                            const clt_image *deviation, double tolerance) {
  size_t values = clt_image_size(seen), impossible = 0;
  for (size_t k = 0; k < values; k++) {
    double own = (double)deviation->data[k], light = (double)white->data[k], noise = (double)variance->data[k];
    double allowed = DEVIATIONS * sqrt(own * own + noise) + tolerance * light;
    impossible += isfinite(noise) && (!isfinite(own) || (double)seen->data[k] - light > allowed);
  }
  return (double)impossible / (double)values;
}

void clt_change_format(const clt_change *change, char *text, size_t size) {
  snprintf(text, size, "cells around (%d, %d) are %.3g %% %s (%.2g %% of the picture differ)", change->x, change->y,
           fabs(change->percent), change->percent < 0 ? "darker" : "brighter", 100 * change->share);
}
