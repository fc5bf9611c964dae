/* Footprints from a pixel map. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"
#include "rig/footprint.h"

#define APART 4.0 /* times the lower quartile of radii: a footprint from which it is seen at two places */
enum { FEWEST = 3 };
#define LEAST_SHARE 1e-3 /* of a pixel or cell that is worth counting */

typedef struct cells {
  const clt_pixel_map *map;
  double pitch;
  int width, height;   /* the grid */
  double across, down; /* panel pixels of a cell */
  clt_footprints *footprints;
} cells;

/* Length that [a, b) and [c, d) share. */
static double shared(double a, double b, double c, double d) {
  return fmax(fmin(b, d) - fmax(a, c), 0);
}

/* Calls the cells of a pixel: counts them in start[i + 1], or where `next` is given enters the pixel at next[i]. */
static void visit_pixel(const cells *c, size_t pixel, int64_t *next) {
  const clt_pixel_map *map = c->map;
  double half = 0.5 * c->pitch, x = map->x[pixel], y = map->y[pixel];
  double unit = fmin(c->pitch, c->across) * fmin(c->pitch, c->down);
  int left = (int)fmax(floor((x - half) / c->across), 0),
      right = (int)fmin(floor((x + half) / c->across), c->width - 1);
  int top = (int)fmax(floor((y - half) / c->down), 0), bottom = (int)fmin(floor((y + half) / c->down), c->height - 1);
  for (int v = top; v <= bottom; v++) {
    double tall = shared(y - half, y + half, v * c->down, (v + 1) * c->down);
    for (int u = left; u <= right; u++) {
      double share = tall * shared(x - half, x + half, u * c->across, (u + 1) * c->across) / unit;
      size_t cell = (size_t)v * (size_t)c->width + (size_t)u;
      if (share < LEAST_SHARE) {
        continue;
      }
      if (next == NULL) {
        c->footprints->start[cell + 1]++;
      } else {
        int64_t at = next[cell]++;
        c->footprints->pixel[at] = (int32_t)pixel;
        c->footprints->weight[at] = map->confidence[pixel] * (float)share;
      }
    }
  }
}

static void visit_all(const cells *c, int64_t *next) {
  size_t pixels = (size_t)c->map->width * (size_t)c->map->height;
  for (size_t i = 0; i < pixels; i++) {
    if (c->map->fate[i] == CLT_PIXEL_DECODED && c->map->confidence[i] > 0) {
      visit_pixel(c, i, next);
    }
  }
}

/* Root mean square distance of a cell's pixels from their centroid, camera pixels. */
static float radius_of(const cells *c, size_t cell) {
  const clt_footprints *f = c->footprints;
  double s = 0, x = 0, y = 0, squares = 0;
  for (int64_t p = f->start[cell]; p < f->start[cell + 1]; p++) {
    double w = f->weight[p], u = f->pixel[p] % c->map->width, v = f->pixel[p] / c->map->width;
    s += w, x += w * u, y += w * v, squares += w * (u * u + v * v);
  }
  return s > 0 ? (float)sqrt(fmax(squares / s - (x * x + y * y) / (s * s), 0)) : 0;
}

/* radius has room for two values a cell. */
static void judge(const cells *c, float *radius, uint8_t *fate, clt_footprint_report *report) {
  const clt_footprints *f = c->footprints;
  size_t count = 0;
  for (size_t i = 0; i < f->cells; i++) {
    radius[i] = radius_of(c, i);
    if (f->start[i + 1] - f->start[i] >= FEWEST) {
      radius[f->cells + count++] = radius[i];
    }
  }
  clt_sort_floats(radius + f->cells, count);
  double limit = count > 0 ? fmax(APART * (double)radius[f->cells + count / 4], 2) : INFINITY;
  for (size_t i = 0; i < f->cells; i++) {
    int64_t pixels = f->start[i + 1] - f->start[i];
    clt_cell_fate what = pixels == 0 ? CLT_CELL_UNSEEN : (double)radius[i] > limit ? CLT_CELL_DOUBLE : CLT_CELL_SEEN;
    report->count[what]++;
    report->pixels += (double)pixels;
    if (fate != NULL) {
      fate[i] = (uint8_t)what;
    }
  }
  report->pixels /= fmax((double)(report->count[CLT_CELL_SEEN] + report->count[CLT_CELL_DOUBLE]), 1);
}

static clt_status out_of_memory(const cells *c, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "out of memory for the footprints of %d x %d cells", c->width, c->height);
}

static clt_status fill(const cells *c, uint8_t *fate, clt_footprint_report *report, clt_error *error) {
  clt_footprints *f = c->footprints;
  visit_all(c, NULL);
  for (size_t i = 0; i < f->cells; i++) {
    f->start[i + 1] += f->start[i];
  }
  size_t entries = (size_t)f->start[f->cells];
  f->pixel = clt_alloc(entries, sizeof *f->pixel);
  f->weight = clt_alloc(entries, sizeof *f->weight);
  int64_t *next = clt_alloc(f->cells, sizeof *next);
  float *radius = clt_alloc(2 * f->cells, sizeof *radius);
  bool enough = f->pixel != NULL && f->weight != NULL && next != NULL && radius != NULL;
  if (enough) {
    for (size_t i = 0; i < f->cells; i++) {
      next[i] = f->start[i];
    }
    visit_all(c, next);
    judge(c, radius, fate, report);
  }
  free(next);
  free(radius);
  return enough ? CLT_OK : out_of_memory(c, error);
}

clt_status clt_footprints_map(const clt_pixel_map *map, double pitch, int grid_width, int grid_height,
                              clt_footprints *footprints, uint8_t *fate, clt_footprint_report *report,
                              clt_error *error) {
  *footprints = (clt_footprints){0};
  *report = (clt_footprint_report){0};
  if (grid_width < 1 || grid_height < 1 || map->panel_width % grid_width != 0 || map->panel_height % grid_height != 0) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "a grid of %d x %d cells does not divide the panel of %d x %d pixels; choose one that does",
                    grid_width, grid_height, map->panel_width, map->panel_height);
  }
  cells c = {map,
             pitch,
             grid_width,
             grid_height,
             (double)map->panel_width / grid_width,
             (double)map->panel_height / grid_height,
             footprints};
  footprints->cells = (size_t)grid_width * (size_t)grid_height;
  footprints->start = clt_alloc(footprints->cells + 1, sizeof *footprints->start);
  clt_status status = footprints->start != NULL ? fill(&c, fate, report, error) : out_of_memory(&c, error);
  if (status != CLT_OK) {
    clt_footprints_finish(footprints);
  }
  return status;
}
