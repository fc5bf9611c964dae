#include "acquire/watch.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* How far a lamp drifts; more is another light. */
#define LAMP_MOST 0.1
#define PATIENCE_DEFAULT_S 30.0
#define DEVIATIONS 6.0
/* No tile is known better than to this part of its light. */
#define EXACTEST 1e-6
enum { TILES = 16, TILES_LEAST = 1 };

clt_status clt_watch_init(clt_watch *watch, const clt_acquire_options *options, const clt_rig_info *info,
                          clt_error *error) {
  *watch = (clt_watch){.every = options->watch == 0 && options->watch_s > 0 ? INT_MAX : options->watch,
                       .every_s = options->watch_s,
                       .doubted = info->doubted,
                       .patience_s = options->patience_s > 0 ? options->patience_s : PATIENCE_DEFAULT_S};
  clt_image *const images[] = {&watch->white, &watch->expected, &watch->variance};
  clt_status status = CLT_OK;
  for (size_t i = 0; watch->every > 0 && status == CLT_OK && i < sizeof images / sizeof images[0]; i++) {
    status = clt_image_init(images[i], info->channels, info->height, info->width, error);
  }
  for (size_t k = 0; watch->every > 0 && status == CLT_OK && k < clt_image_size(&watch->white); k++) {
    watch->white.data[k] = 1;
  }
  clt_group *const groups[] = {&watch->group, &watch->earlier};
  for (size_t i = 0; watch->every > 0 && status == CLT_OK && i < 2; i++) {
    status = clt_group_init(groups[i], info->channels, info->height, info->width, error);
  }
  clt_watch_forget_lamp(watch);
  return status;
}

void clt_watch_finish(clt_watch *watch) {
  clt_image_finish(&watch->white);
  clt_image_finish(&watch->expected);
  clt_image_finish(&watch->variance);
  clt_group_finish(&watch->group);
  clt_group_finish(&watch->earlier);
}

/* Sums of the tile's cells from (x0, y0) up to (x1, y1). */
typedef struct tile {
  int channel, x0, y0, x1, y1;
  double light, dark, difference, noise; /* dark is of black; noise is a variance */
} tile;

static void sum_tile(tile *t, const clt_image *expected, const clt_image *variance, const clt_image *black,
                     const clt_image *seen, const clt_image *deviation) {
  for (int y = t->y0; y < t->y1; y++) {
    for (int x = t->x0; x < t->x1; x++) {
      size_t at = ((size_t)t->channel * (size_t)seen->height + (size_t)y) * (size_t)seen->width + (size_t)x;
      double own = (double)deviation->data[at], noise = own * own + (double)variance->data[at];
      if (isfinite(noise)) {
        t->light += (double)expected->data[at];
        t->dark += black != NULL ? (double)black->data[at] : 0;
        t->difference += (double)seen->data[at] - (double)expected->data[at];
        t->noise += noise;
      }
    }
  }
}

/* The k-th of the tiles, wide x high of them a channel; `side` or fewer in each direction. */
static tile place_tile(const clt_image *image, int side, int k) {
  int wide = image->width < side ? image->width : side, high = image->height < side ? image->height : side;
  int u = k % wide, v = k / wide % high;
  return (tile){.channel = k / (wide * high),
                .x0 = u * image->width / wide,
                .y0 = v * image->height / high,
                .x1 = (u + 1) * image->width / wide,
                .y1 = (v + 1) * image->height / high};
}

static int count_tiles(const clt_image *image, int side) {
  return (image->width < side ? image->width : side) * (image->height < side ? image->height : side);
}

/* By factors lamp of what is above black; black NULL: by none. */
static clt_change compare_tiles(int side, const clt_image *expected, const clt_image *variance, const clt_image *black,
                                const double *lamp, const clt_image *seen, const clt_image *deviation,
                                double tolerance) {
  int count = count_tiles(seen, side) * seen->channels, changed = 0;
  double most = 0;
  clt_change change = {0};
  for (int k = 0; k < count; k++) {
    tile t = place_tile(seen, side, k);
    sum_tile(&t, expected, variance, black, seen, deviation);
    double brighter = black != NULL ? (lamp[t.channel] - 1) * (t.light - t.dark) : 0;
    double apart = t.difference - brighter, allowed = DEVIATIONS * sqrt(t.noise) + tolerance * fabs(t.light);
    changed += fabs(apart) > allowed;
    if (fabs(apart) > allowed && fabs(apart) - allowed > most) {
      most = fabs(apart) - allowed;
      change.x = (t.x0 + t.x1) / 2;
      change.y = (t.y0 + t.y1) / 2;
      change.percent = 100 * apart / fmax(fabs(t.light), 1e-3 * fabs(apart));
    }
  }
  change.share = (double)changed / count;
  return change;
}

/* What is little in every tile but alike in many is seen in larger ones. */
static clt_change compare(const clt_image *expected, const clt_image *variance, const clt_image *black,
                          const double *lamp, const clt_image *seen, const clt_image *deviation, double tolerance) {
  clt_change change = {0};
  for (int side = TILES; side >= TILES_LEAST && !(change.share > 0); side /= 2) {
    change = compare_tiles(side, expected, variance, black, lamp, seen, deviation, tolerance);
  }
  return change;
}

clt_change clt_watch_compare(const clt_image *expected, const clt_image *variance, const clt_image *seen,
                             const clt_image *deviation, double tolerance) {
  return compare(expected, variance, NULL, NULL, seen, deviation, tolerance);
}

/* How much brighter a tile is, and how exactly that is known. */
typedef struct tile_ratio {
  double ratio, weight;
} tile_ratio;

static int by_ratio(const void *a, const void *b) {
  const double x = ((const tile_ratio *)a)->ratio, y = ((const tile_ratio *)b)->ratio;
  return (x > y) - (x < y);
}

/* The weighted median over a channel's tiles of how much brighter they are; 1 where that is no lamp. */
static double find_lamp(const clt_image *expected, const clt_image *variance, const clt_image *black,
                        const clt_image *seen, const clt_image *deviation, int channel) {
  tile_ratio tiles[TILES * TILES];
  const int all = count_tiles(seen, TILES);
  size_t count = 0;
  double whole = 0, below = 0, lamp = 1;
  for (int k = 0; k < all; k++) {
    tile t = place_tile(seen, TILES, channel * all + k);
    sum_tile(&t, expected, variance, black, seen, deviation);
    double light = t.light - t.dark, weight = light / (sqrt(t.noise) + EXACTEST * fabs(light));
    if (light > DEVIATIONS * sqrt(t.noise)) {
      tiles[count++] = (tile_ratio){1 + t.difference / light, weight};
      whole += weight;
    }
  }
  qsort(tiles, count, sizeof *tiles, by_ratio);
  for (size_t k = 0; k < count && below <= whole / 2; k++) {
    below += tiles[k].weight;
    lamp = tiles[k].ratio;
  }
  return fabs(lamp - 1) <= LAMP_MOST ? lamp : 1;
}

clt_change clt_watch_compare_lamp(const clt_image *expected, const clt_image *variance, const clt_image *black,
                                  const clt_image *seen, const clt_image *deviation, double tolerance, double *lamp) {
  for (int c = 0; c < seen->channels; c++) {
    lamp[c] = find_lamp(expected, variance, black, seen, deviation, c);
  }
  return compare(expected, variance, black, lamp, seen, deviation, tolerance);
}

void clt_watch_correct(const clt_watch *watch, const clt_image *black, clt_image *seen, clt_image *deviation) {
  size_t cells = (size_t)seen->width * (size_t)seen->height;
  for (size_t k = 0; k < clt_image_size(seen); k++) {
    double lamp = watch->lamp[k / cells], dark = (double)black->data[k];
    if (lamp != 1) {
      seen->data[k] = (float)(dark + ((double)seen->data[k] - dark) / lamp);
      deviation->data[k] = (float)((double)deviation->data[k] / lamp);
    }
  }
}

void clt_watch_forget_lamp(clt_watch *watch) {
  for (int c = 0; c < CLT_CHANNELS_MAX; c++) {
    watch->lamp[c] = 1;
  }
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
